#pragma once
/// @file body_points.hpp
/// The points of a body that are lowest over a face, where the haptic loop finds them. Lengths are Bullet's units.
#include <array>
#include <cstddef>

#include <btBulletDynamicsCommon.h>

#include "rtbus/shapes/face_points.hpp"

namespace physics::bullet {

/// Of a box its corners, of a hull up to four that are low (rtbus::shapes::face_points(), hull_points()), of a cylinder
/// those of the rim and the ends of its side, and both ends of a capsule.
struct BodyPoints {
  static constexpr std::array kShapes{BOX_SHAPE_PROXYTYPE, CONVEX_HULL_SHAPE_PROXYTYPE, CYLINDER_SHAPE_PROXYTYPE,
                                      CAPSULE_SHAPE_PROXYTYPE};
  static constexpr std::size_t kMost = 2 * rtbus::shapes::FacePoints::kMost;

  Eigen::Vector3d normal = Eigen::Vector3d::UnitY();  ///< From the face to the body.
  std::array<Eigen::Vector3d, kMost> point{};         ///< Of the body.
  std::array<double, kMost> gap{};                    ///< Above the face.
  std::size_t count = 0;
  double within = 0.0;  ///< What is farther does not touch.

  /// @returns false: a hull of too many points, which is for Bullet. @param held Has one of kShapes.
  [[nodiscard]] static bool knows(const btCollisionObjectWrapper& held);
  /// Those over the face, whose edges are not looked at.
  void find(const btCollisionObjectWrapper& held, const rtbus::shapes::Face& face);

  void add(const Eigen::Vector3d& at, double above);
  /// @param along From each to another one.
  void add(const rtbus::shapes::FacePoints& points, const Eigen::Vector3d& along = Eigen::Vector3d::Zero());
  /// Adds number `i` to the manifold of `out`.
  void tell(std::size_t i, btManifoldResult& out) const;
};

}  // namespace physics::bullet
