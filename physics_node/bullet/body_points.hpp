#pragma once
/// @file body_points.hpp
/// The points of a body that are lowest over a face, where the haptic loop finds them. Lengths are Bullet's units.
#include <array>
#include <cstddef>
#include <span>

#include <btBulletDynamicsCommon.h>
#include <Eigen/Core>

#include "rtbus/shapes/face_points.hpp"

namespace physics::bullet {

struct TouchPoint {
  Eigen::Vector3d point, normal;  ///< Of the body, and from what holds it to the body.
  double gap;                     ///< Along the normal.
};

/// Puts `points` in the place of those of the manifold; where it has no room for all, the lowest. Of points that Bullet
/// would take for one the lowest counts. Each goes on from the impulses of the nearest one before.
/// @param out Of the pair, in the order of the manifold.
void replace_points(std::span<const TouchPoint> points, btPersistentManifold& manifold, btManifoldResult& out);

/// Whether all points of a body are found in each step: it is neither one of a pile nor left to Bullet. One that has
/// never been solved counts as one of a pile.
[[nodiscard]] bool is_met_at_all_points(const btCollisionObjectWrapper& body);
/// Told by the solver in each step.
void set_in_pile(btCollisionObject& body, bool in_pile);
/// Bullet's algorithms meet that body from now on.
void leave_to_bullet(btCollisionObject& body);

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

  /// Finds those over the face anew. A box and a cylinder are cut off at its edges.
  /// @param held Has one of kShapes. @param face In W.
  void find(const btCollisionObjectWrapper& held, const rtbus::shapes::Face& face);
  /// Adds points of the body, each moved by `along`.
  void add(const rtbus::shapes::FacePoints& points, const Eigen::Vector3d& along = Eigen::Vector3d::Zero());

  [[nodiscard]] std::span<const TouchPoint> all() const { return {points_.data(), count_}; }
  [[nodiscard]] double within() const { return within_; }

 private:
  void add(const Eigen::Vector3d& point, const Eigen::Vector3d& normal, double gap);

  double within_;
  std::array<TouchPoint, 2 * rtbus::shapes::FacePoints::kMost> points_;
  std::size_t count_ = 0;
};

}  // namespace physics::bullet
