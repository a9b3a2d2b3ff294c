#pragma once
/// @file face_contacts.hpp
/// How boxes, hulls, cylinders and capsules meet a plane, and all but boxes the face of a box.
#include <btBulletDynamicsCommon.h>

#include "physics_node/bullet/body_points.hpp"

namespace physics::bullet {

/// Bullet's algorithms for these find one point in a step, and keep those of steps before. What slides, turns or rolls
/// has lost some of them in most steps, and rocks. This one finds all of them in each step (BodyPoints).
///
/// What is partly beyond an edge of the box keeps Bullet's, unless it is a cylinder that stands. So does a body of a
/// pile: with all points a stack of light boxes takes more iterations to rest. So does a very light one, which takes
/// room under the tool.
class FaceContacts final : public btCollisionAlgorithm {
 public:
  class Factory;
  /// For all shapes that it is for. Outlives the dispatcher.
  class Factories;

  /// Told by the solver in each step: whether that body is one of a pile. One that has never been solved is.
  static void set_in_pile(btCollisionObject& body, bool in_pile) {
    if (body.getUserIndex2() != kBullets) body.setUserIndex2(in_pile ? kInPile : kAlone);
  }
  /// Neither of a pile nor left to Bullet.
  [[nodiscard]] static bool is_alone(const btCollisionObjectWrapper& body);
  /// For ever.
  static void leave_to_bullet(btCollisionObject& body) { body.setUserIndex2(kBullets); }

  ~FaceContacts() override;
  FaceContacts(const FaceContacts&) = delete;
  FaceContacts& operator=(const FaceContacts&) = delete;

  void processCollision(const btCollisionObjectWrapper* first, const btCollisionObjectWrapper* second,
                        const btDispatcherInfo& info, btManifoldResult* out) override;
  btScalar calculateTimeOfImpact(btCollisionObject*, btCollisionObject*, const btDispatcherInfo&,
                                 btManifoldResult*) override {
    return 1;
  }
  void getAllContactManifolds(btManifoldArray& out) override { out.push_back(manifold_); }

 private:
  FaceContacts(const btCollisionAlgorithmConstructionInfo& info, const btCollisionObjectWrapper* first,
               const btCollisionObjectWrapper* second, const Factory& factory, bool holder_first);
  [[nodiscard]] static bool are_held_by(const rtbus::shapes::Face& face, const BodyPoints& points);
  [[nodiscard]] static bool find(const btCollisionObjectWrapper& held, const btCollisionObjectWrapper& holder,
                                 BodyPoints& out);

  static constexpr int kInPile = -1, kAlone = 1, kBullets = 2;  ///< -1 is what Bullet begins with.

  btPersistentManifold* manifold_;
  btCollisionAlgorithm* bullets_;  ///< Works on the same manifold.
  bool holder_first_;
};

/// For btCollisionDispatcher::registerCollisionCreateFunc, in either order of the two.
class FaceContacts::Factory final : public btCollisionAlgorithmCreateFunc {
 public:
  /// @param others Bullet's, for hulls of too many points, and for what is beyond the edges of a box.
  Factory(bool holder_first, btCollisionAlgorithmCreateFunc* others) : others_(others) { m_swapped = holder_first; }
  btCollisionAlgorithm* CreateCollisionAlgorithm(btCollisionAlgorithmConstructionInfo& info,
                                                 const btCollisionObjectWrapper* first,
                                                 const btCollisionObjectWrapper* second) override;

 private:
  friend class FaceContacts;
  btCollisionAlgorithmCreateFunc* others_;
};

class FaceContacts::Factories {
 public:
  explicit Factories(btCollisionConfiguration& bullets);
  void add_to(btCollisionDispatcher& dispatcher);

 private:
  Factory on_plane_, under_plane_, on_box_, under_box_;  ///< Which of the two comes first: the body, or the holder.
  Factory two_boxes_;                                    ///< What stands is the holder.
};

}  // namespace physics::bullet
