#pragma once
/// @file face_points.hpp
/// Where a box lies on a plane or on a face of another box.
#include <array>
#include <cstddef>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "rtbus/shapes/shapes.hpp"

namespace rtbus::shapes {

/// Corners of the area that two faces share.
struct FacePoints {
  static constexpr std::size_t kMost = 4;
  Eigen::Vector3d normal = Eigen::Vector3d::UnitY();  ///< Of the holder's face, unit, in W.
  std::array<Eigen::Vector3d, kMost> point_m{};       ///< Of the held box, in W.
  std::array<double, kMost> gap_m{};                  ///< From the holder's face; negative: inside.
  std::size_t count = 0;                              ///< 0: the face of the box lies beside that of the holder.
};

/// The face of `held` that looks at the holder, cut off at the edges of the holder's face. Of more than four corners
/// the four that are farthest apart along the diagonals of the holder's face.
/// @param held A box. @param q_WB Its orientation. @param p_WB Its centre, in W.
/// @param holder What it lies on: a plane or a box. @param out Set; its count is 0 where that is not so.
/// @param toward Unit, from the holder towards the box: picks the face of the holder.
/// @returns false where the holder has no face within 18 degrees of that direction. @realtime Yes.
[[nodiscard]] bool face_points(const Box& held, const Eigen::Quaterniond& q_WB, const Eigen::Vector3d& p_WB,
                               const PlacedShape& holder, const Eigen::Vector3d& toward, FacePoints& out) noexcept;

}  // namespace rtbus::shapes
