#pragma once
/// @file face_points.hpp
/// Where a box, or a cylinder that stands, lies on a plane or on a box.
#include <array>
#include <cstddef>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "rtbus/shapes/shapes.hpp"

namespace rtbus::shapes {

/// Corners of the area that two faces share.
struct FacePoints {
  static constexpr std::size_t kMost = 4;
  Eigen::Vector3d normal = Eigen::Vector3d::UnitY();  ///< Unit, from the holder to the held body, in W.
  std::array<Eigen::Vector3d, kMost> point_m{};       ///< Of the held body, in W.
  std::array<double, kMost> gap_m{};                  ///< Along the normal; negative: inside.
  std::size_t count = 0;                              ///< 0: the two lie beside each other.
};

/// Of all faces of both, the one from which the other body is farthest (S. Gottschalk, M. C. Lin, D. Manocha,
/// "OBBTree", SIGGRAPH 1996: separating axes) is the plane of the contact. What looks at it of the other body is cut
/// off at its edges. So a box that lies flat has its own corners, and one that tips over the edge of what holds it has
/// the ends of that edge; where two edges cross there is one point. Of more than four corners the four that are
/// farthest apart along the diagonals of the face.
/// @param held A box. @param q_WB Its orientation. @param p_WB Its centre, in W.
/// @param holder What it lies on: a plane or a box. @param out Set; its count is 0 where that is not so.
/// @returns false where the holder is neither. @realtime Yes.
[[nodiscard]] bool face_points(const Box& held, const Eigen::Quaterniond& q_WB, const Eigen::Vector3d& p_WB,
                               const PlacedShape& holder, FacePoints& out) noexcept;

/// The rim of the cap that looks at the face: its lowest point, the one across, and those to both sides. What of the
/// cap is beyond an edge of a box is cut off.
/// @param held A cylinder that does not lie on its side. @param q_WB Its orientation. @param p_WB Its centre, in W.
/// @param holder What it lies on: a plane or a box. @param out Set; its count is 0 where that is not so.
/// @param way_W Where its lowest point is taken to be while it stands upright, where all are as low: to where it would
/// tip. Any length; along the axis or zero: anywhere.
/// @returns as above. @realtime Yes.
[[nodiscard]] bool face_points(const Cylinder& held, const Eigen::Quaterniond& q_WB, const Eigen::Vector3d& p_WB,
                               const PlacedShape& holder, const Eigen::Vector3d& way_W, FacePoints& out) noexcept;

}  // namespace rtbus::shapes
