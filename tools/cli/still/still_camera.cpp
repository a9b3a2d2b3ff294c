#include "tools/cli/still/still_camera.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace tools {

namespace {

// Room for the caption above and the legend below, as shares of the picture.
constexpr double kSide = 0.09, kTop = 0.15, kBottom = 0.20;

/// Axes of the picture: right, up, into it.
struct Axes {
  Eigen::Vector3d right, up, into;
};
Axes axes_of(const Camera& camera) {
  const Eigen::Vector3d into = (camera.look_at_m - camera.eye_m).normalized();
  const Eigen::Vector3d right = into.cross(Eigen::Vector3d::UnitY()).normalized();
  return {right, right.cross(into), into};
}

double focal_px(const Camera& camera) {
  return 0.5 * camera.width_px / std::tan(0.5 * Camera::kAngle_deg * std::numbers::pi / 180.0);
}

}  // namespace

Eigen::Vector2d Camera::project(const Eigen::Vector3d& p_m) const {
  const Axes axes = axes_of(*this);
  const Eigen::Vector3d d = p_m - eye_m;
  const double scale = focal_px(*this) / std::max(d.dot(axes.into), 1e-9);
  return {0.5 * width_px + scale * d.dot(axes.right), 0.5 * height_px + scale * d.dot(axes.up)};
}

double Camera::px_per_m(const Eigen::Vector3d& p_m) const {
  return focal_px(*this) / std::max((p_m - eye_m).dot(axes_of(*this).into), 1e-9);
}

Camera fit_camera(std::span<const Eigen::Vector3d> points, const StillView& view, int width_px, int height_px) {
  Camera camera;
  camera.width_px = width_px;
  camera.height_px = height_px;
  Eigen::Vector3d low = points.front(), high = points.front();
  for (const Eigen::Vector3d& p : points) low = low.cwiseMin(p), high = high.cwiseMax(p);
  const double radians = std::numbers::pi / 180.0;
  const double a = view.azimuth_deg * radians, e = view.elevation_deg * radians;
  const Eigen::Vector3d towards_eye(std::sin(a) * std::cos(e), std::sin(e), std::cos(a) * std::cos(e));
  const double radius_m = std::max(0.5 * (high - low).norm(), 1e-6);

  camera.look_at_m = 0.5 * (low + high);
  const double left = kSide * width_px, right = (1.0 - kSide) * width_px;
  const double bottom = kBottom * height_px, top = (1.0 - kTop) * height_px;
  for (int round = 0; round < 4; ++round) {
    // The smallest distance at which the points, centred, are no larger than the window.
    double near_m = 1.05 * radius_m, far_m = 200.0 * radius_m;
    Eigen::Vector2d seen_low, seen_high;
    for (int i = 0; i < 50; ++i) {
      const double distance_m = std::sqrt(near_m * far_m);
      camera.eye_m = camera.look_at_m + distance_m * towards_eye;
      seen_low.setConstant(1e12), seen_high.setConstant(-1e12);
      for (const Eigen::Vector3d& p : points) {
        const Eigen::Vector2d seen = camera.project(p);
        seen_low = seen_low.cwiseMin(seen), seen_high = seen_high.cwiseMax(seen);
      }
      const bool fits = (seen_high - seen_low).x() <= right - left && (seen_high - seen_low).y() <= top - bottom;
      (fits ? far_m : near_m) = distance_m;
    }
    // Then the window's middle onto theirs.
    const Eigen::Vector2d off = 0.5 * (seen_low + seen_high) - 0.5 * Eigen::Vector2d(left + right, bottom + top);
    const Axes axes = axes_of(camera);
    const double m_per_px = 1.0 / camera.px_per_m(camera.look_at_m);
    const Eigen::Vector3d shift = m_per_px * (off.x() * axes.right + off.y() * axes.up);
    camera.look_at_m += shift;
    camera.eye_m += shift;
  }
  return camera;
}

}  // namespace tools
