#pragma once
/// @file still_camera.hpp
/// A perspective camera in W that fits a cloud of points into a picture.
#include <span>
#include <vector>

#include <Eigen/Core>
#include <Eigen/Geometry>

namespace tools {

struct StillView {
  double azimuth_deg = 22.0;    ///< From +z (where the hand comes from) towards +x.
  double elevation_deg = 30.0;  ///< Above the horizon.
};

struct Camera {
  static constexpr double kAngle_deg = 26.0;  ///< Of the picture's width.
  int width_px = 1600, height_px = 1000;
  Eigen::Vector3d eye_m = Eigen::Vector3d::UnitZ();
  Eigen::Vector3d look_at_m = Eigen::Vector3d::Zero();

  /// Pixel from the left and from the bottom.
  [[nodiscard]] Eigen::Vector2d project(const Eigen::Vector3d& p_m) const;
  /// Pixels that a length across the view takes at `p_m` [px/m].
  [[nodiscard]] double px_per_m(const Eigen::Vector3d& p_m) const;
};

/// The nearest camera of that direction that has all points within the margins. @param points At least one.
[[nodiscard]] Camera fit_camera(std::span<const Eigen::Vector3d> points, const StillView& view, int width_px,
                                int height_px);

}  // namespace tools
