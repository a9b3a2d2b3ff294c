#pragma once
/// @file shapes.hpp
/// Analytic shapes: exact distance and normal of plane, sphere, box, capsule and cylinder. A leaf that both nodes use
/// (the `direct` force method and the analytic engine); depends on Eigen alone. Each shape stands in the frame of its
/// body.
#include <variant>

#include <Eigen/Core>
#include <Eigen/Geometry>

namespace rtbus::shapes {

/// Half-space below the plane through the origin; outside is y > 0 of the body's frame.
struct Plane {};
/// A ball around the origin of the body's frame.
struct Sphere {
  double radius_m = 0.0;
};
/// A box around the origin, its edges along the axes of the body's frame.
struct Box {
  Eigen::Vector3d half_size_m = Eigen::Vector3d::Zero();
};
using Shape = std::variant<Plane, Sphere, Box>;

/// Axis along y of the body's frame, origin in the middle.
struct Capsule {
  double radius_m = 0.0;
  double length_m = 0.0;  ///< From end to end, caps included; above 2·radius_m.
};
/// Axis along y of the body's frame, origin in the middle.
struct Cylinder {
  double radius_m = 0.0;
  double length_m = 0.0;
};

/// Nearest point of a surface.
struct SurfacePoint {
  double distance_m = 0.0;                            ///< Negative inside.
  Eigen::Vector3d normal = Eigen::Vector3d::UnitY();  ///< Outward, unit length, where the query was mapped to.
  Eigen::Vector3d point_m = Eigen::Vector3d::Zero();  ///< On the surface.
};

/// Signed distance of `p` to `shape`, both in the body's frame. At a sphere's centre the normal is +y; inside a box it
/// is that of the nearest face (the lower axis index wins a tie). @realtime Yes.
[[nodiscard]] SurfacePoint nearest_surface(const Shape& shape, const Eigen::Vector3d& p) noexcept;
[[nodiscard]] SurfacePoint nearest_surface(const Box& box, const Eigen::Vector3d& p) noexcept;
/// On the axis the normal is +x. @realtime Yes.
[[nodiscard]] SurfacePoint nearest_surface(const Capsule& capsule, const Eigen::Vector3d& p) noexcept;
/// Inside: the nearer of side and cap, the side where they are equal. @realtime Yes.
[[nodiscard]] SurfacePoint nearest_surface(const Cylinder& cylinder, const Eigen::Vector3d& p) noexcept;

/// A shape somewhere: X_WB as rotation and translation.
struct PlacedShape {
  Shape shape;
  Eigen::Quaterniond q_WB = Eigen::Quaterniond::Identity();
  Eigen::Vector3d p_WB = Eigen::Vector3d::Zero();
  double friction = 0.0;  ///< Coulomb coefficient.
};

/// The same in W. @realtime Yes.
[[nodiscard]] SurfacePoint nearest_surface(const PlacedShape& placed, const Eigen::Vector3d& p_W) noexcept;

}  // namespace rtbus::shapes
