#pragma once
/// @file body_points.hpp
/// The points of a body that are lowest over a face, where the haptic loop finds them. Lengths are Bullet's units.
#include <array>
#include <cstddef>
#include <span>

#include <btBulletDynamicsCommon.h>

#include "rtbus/shapes/face_points.hpp"

namespace physics::bullet {

struct TouchPoint {
  Eigen::Vector3d point, normal;  ///< Of the body, and from what holds it to the body.
  double gap;                     ///< Along the normal.
};

/// Puts them in the place of the manifold's points, as many as it has room for. Each goes on from the impulses of the
/// nearest one before. @param out Of the pair, in the order of the manifold.
void tell(std::span<const TouchPoint> points, btPersistentManifold& manifold, btManifoldResult& out);

/// Of a box its corners, of a hull up to four that are low (rtbus::shapes::face_points(), hull_points()), of a cylinder
/// those of the rim and the ends of its side, and both ends of a capsule.
class BodyPoints {
 public:
  static constexpr std::array kShapes{BOX_SHAPE_PROXYTYPE, CONVEX_HULL_SHAPE_PROXYTYPE, CYLINDER_SHAPE_PROXYTYPE,
                                      CAPSULE_SHAPE_PROXYTYPE};
  /// @returns false: a hull of too many points, which is for Bullet. @param held Has one of kShapes.
  [[nodiscard]] static bool knows(const btCollisionObjectWrapper& held);

  /// @param within What is farther does not touch.
  explicit BodyPoints(double within) : within_(within) {}

  /// Those over the face, whose edges are not looked at.
  void find(const btCollisionObjectWrapper& held, const rtbus::shapes::Face& face);
  /// These. @param along From each to another one.
  void add(const rtbus::shapes::FacePoints& points, const Eigen::Vector3d& along = Eigen::Vector3d::Zero());
  void clear() { count_ = 0; }

  [[nodiscard]] std::span<const TouchPoint> all() const { return {points_.data(), count_}; }
  [[nodiscard]] double within() const { return within_; }

 private:
  void add(const Eigen::Vector3d& point, const Eigen::Vector3d& normal, double gap);

  double within_;
  std::array<TouchPoint, 2 * rtbus::shapes::FacePoints::kMost> points_;
  std::size_t count_ = 0;
};

}  // namespace physics::bullet
