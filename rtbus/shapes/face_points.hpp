#pragma once
/// @file face_points.hpp
/// Faces of planes and boxes, and where a box, or a cylinder that stands, lies on one.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <optional>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "rtbus/shapes/shapes.hpp"

namespace rtbus::shapes {

/// A rectangle, or a plane without edges.
struct Face {
  Eigen::Vector3d normal = Eigen::Vector3d::UnitY(), centre_m = Eigen::Vector3d::Zero();  ///< Outward; in W.
  Eigen::Vector3d u = Eigen::Vector3d::UnitX(), v = Eigen::Vector3d::UnitZ();             ///< Unit, along the edges.
  double half_u_m = std::numeric_limits<double>::infinity(), half_v_m = half_u_m;

  /// Whether a point is on it, or straight above or below.
  [[nodiscard]] bool is_under(const Eigen::Vector3d& point_m) const noexcept {
    const Eigen::Vector3d from_m = point_m - centre_m;
    return std::abs(u.dot(from_m)) <= half_u_m && std::abs(v.dot(from_m)) <= half_v_m;
  }
  [[nodiscard]] Face without_edges() const noexcept {
    Face out = *this;
    out.half_u_m = out.half_v_m = std::numeric_limits<double>::infinity();
    return out;
  }
};

/// The face of a plane or box that a point is farthest beyond. @returns none for what is neither. @realtime Yes.
[[nodiscard]] std::optional<Face> face_towards(const PlacedShape& holder, const Eigen::Vector3d& point_m) noexcept;

/// The face that looks most along `direction`. @returns as above. @realtime Yes.
[[nodiscard]] std::optional<Face> face_along(const PlacedShape& holder, const Eigen::Vector3d& direction) noexcept;

/// Corners of the area that two faces share.
struct FacePoints {
  static constexpr std::size_t kMost = 4;
  Eigen::Vector3d normal = Eigen::Vector3d::UnitY();  ///< Unit, from the holder to the held body, in W.
  std::array<Eigen::Vector3d, kMost> point_m{};       ///< Of the held body, in W.
  std::array<double, kMost> gap_m{};                  ///< Along the normal; negative: inside.
  std::size_t count = 0;                              ///< 0: the two lie beside each other.

  /// Whether none is beyond its edges.
  [[nodiscard]] bool are_over(const Face& face) const noexcept {
    return std::all_of(point_m.begin(), point_m.begin() + static_cast<std::ptrdiff_t>(count),
                       [&face](const Eigen::Vector3d& each_m) { return face.is_under(each_m); });
  }
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

/// The same on a face, cut off at its edges. @realtime Yes.
void face_points(const Box& held, const Eigen::Quaterniond& q_WB, const Eigen::Vector3d& p_WB, const Face& face,
                 FacePoints& out) noexcept;

/// The rim of the cap that looks at the face: its lowest point, the one across, and those to both sides. What of the
/// cap is beyond an edge of a box is cut off.
/// @param held A cylinder that does not lie on its side. @param q_WB Its orientation. @param p_WB Its centre, in W.
/// @param holder What it lies on: a plane or a box. @param out Set; its count is 0 where that is not so.
/// @param way_W Where its lowest point is taken to be while it stands upright, where all are as low: to where it would
/// tip. Any length; along the axis or zero: anywhere.
/// @returns as above. @realtime Yes.
[[nodiscard]] bool face_points(const Cylinder& held, const Eigen::Quaterniond& q_WB, const Eigen::Vector3d& p_WB,
                               const PlacedShape& holder, const Eigen::Vector3d& way_W, FacePoints& out) noexcept;

/// The same on a face, cut off at its edges. @realtime Yes.
void face_points(const Cylinder& held, const Eigen::Quaterniond& q_WB, const Eigen::Vector3d& p_WB, const Face& face,
                 const Eigen::Vector3d& way_W, FacePoints& out) noexcept;

}  // namespace rtbus::shapes
