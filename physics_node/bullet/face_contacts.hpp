#pragma once
/// @file face_contacts.hpp
/// How boxes, hulls, cylinders and capsules meet a plane or the face of a box.
#include <btBulletDynamicsCommon.h>

#include "physics_node/bullet/body_points.hpp"

namespace physics::bullet {

/// Bullet's algorithms for these keep points of earlier steps, and most find one in a step. What slides, turns or rolls
/// has lost some of them in most steps, and rocks. This one finds all of them in each step (BodyPoints).
///
/// A box, and a cylinder that stands, are cut off where a box ends. What else is beyond an edge is left to Bullet's
/// algorithm, and so are two boxes that move. Bullet's also meets a body of a pile: with all points a stack of light
/// boxes takes more iterations to rest. And it meets very light ones, which take room under the tool.
class FaceContacts final : public btCollisionAlgorithm {
 public:
  class Factory;
  /// One for each pair of shapes. Outlives the dispatcher.
  class Factories;

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

  btPersistentManifold* manifold_;
  btCollisionAlgorithm* fallback_;  ///< Bullet's, on the same manifold.
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
