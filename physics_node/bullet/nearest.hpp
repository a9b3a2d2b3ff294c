#pragma once
/// @file nearest.hpp
/// Where a sphere is nearest to a body of Bullet's: geometry alone, nothing of the world is touched or changed.
#include <vector>

#include "physics_node/bullet/bullet_shapes.hpp"

namespace physics::bullet {

/// Lengths in Bullet's units, W.
struct NearPoint {
  Eigen::Vector3d point = Eigen::Vector3d::Zero();    ///< On the body's surface.
  Eigen::Vector3d normal = Eigen::Vector3d::UnitY();  ///< Unit, outward.
  double gap = 0.0;                                   ///< To the sphere's surface; negative: penetrates.
};

/// Appends the points of `made`, placed at `pose`, that are at most `max_gap` from the sphere: one for a convex shape;
/// for a mesh the places where its distance has a minimum (rtbus::shapes::Surface), the nearest kMostMinima.
///
/// The surface is the one that Bullet's contacts act on: edges of boxes and cylinders are rounded by their margin (a
/// tenth of the smallest half extent), hulls stand out by their skin (meshes do not: Bullet solves sphere and triangle
/// without it). Closed forms in double precision; a hull goes through Bullet's GJK.
void nearest_points(const MadeShape& made, const btTransform& pose, const Eigen::Vector3d& centre, double radius,
                    double max_gap, std::vector<NearPoint>& out);

}  // namespace physics::bullet
