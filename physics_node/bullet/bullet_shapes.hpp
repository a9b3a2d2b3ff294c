#pragma once
/// @file bullet_shapes.hpp
/// Shapes of a scene as Bullet's collision shapes, and the length scale that suits them.
#include <memory>

#include "physics_node/bullet/units.hpp"
#include "rtbus/config/scene.hpp"
#include "rtbus/shapes/hull.hpp"
#include "rtbus/shapes/surface.hpp"

namespace physics::bullet {

/// A collision shape with what it points to. Lengths are Bullet's.
struct MadeShape {
  std::unique_ptr<btTriangleMesh> triangles;  ///< Of a mesh; must outlive the shape, so it stands before it.
  /// Of a hull of few points, in Bullet's units about the centre of mass; its shape points there (getUserPointer()).
  std::unique_ptr<const rtbus::shapes::Hull> hull;
  std::unique_ptr<btCollisionShape> shape;
  std::unique_ptr<const rtbus::shapes::Surface> surface;  ///< Of a mesh, in Bullet's units: where a sphere is near it.
  /// p_BC: centre of mass in the body's frame [m]. Bullet's body frame has its origin there. Zero but for a hull.
  Eigen::Vector3d centre_m = Eigen::Vector3d::Zero();
};

/// Margins: Bullet surrounds hulls and meshes by a skin of absolute thickness, 0.04 units. Here it is 0.5 % of the
/// shortest extent, by which the body is felt larger; the other shapes keep their size, and a cylinder's rim is rounded
/// by so much.
[[nodiscard]] MadeShape make_shape(const rtbus::config::BodyShape& shape, double scale);

/// Shortest extent of the shape [m]; 0 for a plane and a mesh, which have none.
[[nodiscard]] double smallest_extent_m(const rtbus::config::BodyShape& shape);

/// Shortest extent among the bodies that move, soft ones included [m]; kDefaultExtentM when none does.
[[nodiscard]] double smallest_moving_extent_m(const rtbus::config::Scene& scene);

inline constexpr double kDefaultExtentM = 0.02;

/// Size that the smallest moving body gets [units]. Bullet grows every bounding box by 0.02 units, and each pair whose
/// boxes meet costs a test: at 0.6 units, 500 cubes of 20 mm that stand 1 mm apart make 5346 pairs and touch in 500; at
/// 10 units (0.04 mm) they make 500.
inline constexpr double kGoodExtent = 10.0;

/// Units per metre that make a body of `extent_m` kGoodExtent units large: 500 for cubes of 20 mm, 5000 for beads of 2
/// mm.
[[nodiscard]] double length_scale(double extent_m);

/// Bullet's lengths that suit bodies of 0.6 units (depth of split impulse and of continuous detection, margins: 0.04
/// units) keep their ratio to the smallest body when multiplied by this.
inline constexpr double kToleranceScale = kGoodExtent / 0.6;

}  // namespace physics::bullet
