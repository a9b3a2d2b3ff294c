#pragma once
/// @file bullet_shapes.hpp
/// Shapes of a scene as Bullet's collision shapes, and the length scale that suits them.
#include <memory>

#include "physics_node/bullet/units.hpp"
#include "rtbus/config/scene.hpp"

namespace physics::bullet {

/// A collision shape with what it points to. Lengths are Bullet's.
struct MadeShape {
  std::unique_ptr<btTriangleMesh> triangles;  ///< Of a mesh; must outlive the shape, so it stands before it.
  std::unique_ptr<btCollisionShape> shape;
  /// p_BC: centre of mass in the body's frame [m]. Bullet's body frame has its origin there. Zero but for a hull.
  Eigen::Vector3d centre_m = Eigen::Vector3d::Zero();
};

/// Margins: Bullet surrounds hulls and meshes by a skin of absolute thickness, 0.04 units. Here it is 0.5 % of the
/// shortest extent, by which the body is felt larger; the other shapes keep their size.
[[nodiscard]] MadeShape make_shape(const rtbus::config::BodyShape& shape, double scale);

/// Shortest extent of the shape [m]; 0 for a plane and a mesh, which have none.
[[nodiscard]] double smallest_extent_m(const rtbus::config::BodyShape& shape);

/// Shortest extent among the bodies that move [m]; kDefaultExtentM when none does.
[[nodiscard]] double smallest_moving_extent_m(const rtbus::config::Scene& scene);

inline constexpr double kDefaultExtentM = 0.02;

/// Units per metre that make a body of `extent_m` 0.6 units large, but never smaller than it is in metres: 30 for cubes of
/// 20 mm, 300 for beads of 2 mm, 1 for boxes of a metre. Between 10 and 50 nothing changes for 20 mm; at 1 the same
/// stack costs ten times as much, because every bounding box grows by 0.02 units.
[[nodiscard]] double length_scale(double extent_m);

}  // namespace physics::bullet
