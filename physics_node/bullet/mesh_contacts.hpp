#pragma once
/// @file mesh_contacts.hpp
/// How boxes, hulls, cylinders and capsules lie on the flat parts of a mesh.
#include <btBulletDynamicsCommon.h>

namespace physics::bullet {

/// Bullet's algorithm finds one point for each triangle in a step, and keeps those of steps before. Where the mesh is
/// flat under a body, this one finds all points of the body in each step, as on a plane (FaceContacts): where each of
/// them that touches the plane of a triangle is straight above that, or above another one in the same plane. What is
/// partly beyond an edge, or on a bump, or touches at more than four points, is left to Bullet's algorithm.
class MeshContacts final : public btCollisionAlgorithm {
 public:
  class Factory;
  /// One for each pair of shapes. Outlives the dispatcher.
  class Factories;

  ~MeshContacts() override;
  MeshContacts(const MeshContacts&) = delete;
  MeshContacts& operator=(const MeshContacts&) = delete;

  void processCollision(const btCollisionObjectWrapper* first, const btCollisionObjectWrapper* second,
                        const btDispatcherInfo& info, btManifoldResult* out) override;
  btScalar calculateTimeOfImpact(btCollisionObject* first, btCollisionObject* second, const btDispatcherInfo& info,
                                 btManifoldResult* out) override {
    return fallback_->calculateTimeOfImpact(first, second, info, out);
  }
  void getAllContactManifolds(btManifoldArray& out) override { fallback_->getAllContactManifolds(out); }

 private:
  MeshContacts(const btCollisionAlgorithmConstructionInfo& info, btCollisionAlgorithm* bullets, bool mesh_first);

  btCollisionAlgorithm* fallback_;
  btPersistentManifold* manifold_ = nullptr;  ///< Of Bullet's algorithm, in the order body, mesh.
  bool mesh_first_;
};

/// For btCollisionDispatcher::registerCollisionCreateFunc, in either order of the two.
class MeshContacts::Factory final : public btCollisionAlgorithmCreateFunc {
 public:
  /// @param others Bullet's.
  Factory(bool mesh_first, btCollisionAlgorithmCreateFunc* others) : others_(others) { m_swapped = mesh_first; }
  btCollisionAlgorithm* CreateCollisionAlgorithm(btCollisionAlgorithmConstructionInfo& info,
                                                 const btCollisionObjectWrapper* first,
                                                 const btCollisionObjectWrapper* second) override;

 private:
  btCollisionAlgorithmCreateFunc* others_;
};

class MeshContacts::Factories {
 public:
  explicit Factories(btCollisionConfiguration& bullets);
  void add_to(btCollisionDispatcher& dispatcher);

 private:
  Factory on_mesh_, under_mesh_;
};

}  // namespace physics::bullet
