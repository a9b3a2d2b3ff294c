#pragma once
/// @file plane_contacts.hpp
/// How boxes, hulls, cylinders and capsules meet a plane.
#include <BulletCollision/CollisionDispatch/btConvexPlaneCollisionAlgorithm.h>
#include <btBulletDynamicsCommon.h>

namespace physics::bullet {

/// Bullet's algorithm for a convex body and a plane finds one point in a step, and keeps those of steps before. What
/// slides, turns or rolls has lost some of them in most steps, and rocks. This one finds all of them in each step, and
/// where the haptic loop finds them: the corners of a box, of a hull up to four that are low (rtbus::shapes::
/// face_points(), hull_points()), of a cylinder those of the rim and the ends of its side, and both ends of a capsule.
/// A body of a pile keeps Bullet's: with all points a stack of light boxes takes more iterations to rest. So does a
/// very light one, which takes room under the tool.
class PlaneContacts final : public btCollisionAlgorithm {
 public:
  /// For btCollisionDispatcher::registerCollisionCreateFunc, in either order of the two.
  struct Factory final : btCollisionAlgorithmCreateFunc {
    /// @param others Bullet's, for hulls of too many points.
    Factory(bool plane_first, btCollisionAlgorithmCreateFunc* others) : others_(others) { m_swapped = plane_first; }
    btCollisionAlgorithm* CreateCollisionAlgorithm(btCollisionAlgorithmConstructionInfo& info,
                                                   const btCollisionObjectWrapper* first,
                                                   const btCollisionObjectWrapper* second) override;

   private:
    btCollisionAlgorithmCreateFunc* others_;
  };
  /// Bullet's numbers of the bodies that it is for.
  static constexpr int kShapes[] = {BOX_SHAPE_PROXYTYPE, CONVEX_HULL_SHAPE_PROXYTYPE, CYLINDER_SHAPE_PROXYTYPE,
                                    CAPSULE_SHAPE_PROXYTYPE};

  /// Told by the solver in each step: whether that body is one of a pile. One that has never been solved is.
  static void set_in_pile(btCollisionObject& body, bool in_pile) {
    if (body.getUserIndex2() != kBullets) body.setUserIndex2(in_pile ? kInPile : kAlone);
  }
  /// For ever.
  static void leave_to_bullet(btCollisionObject& body) { body.setUserIndex2(kBullets); }

  PlaneContacts(const btCollisionAlgorithmConstructionInfo& info, const btCollisionObjectWrapper* first,
                const btCollisionObjectWrapper* second, bool plane_first);
  ~PlaneContacts() override;
  PlaneContacts(const PlaneContacts&) = delete;
  PlaneContacts& operator=(const PlaneContacts&) = delete;

  void processCollision(const btCollisionObjectWrapper* first, const btCollisionObjectWrapper* second,
                        const btDispatcherInfo& info, btManifoldResult* out) override;
  btScalar calculateTimeOfImpact(btCollisionObject*, btCollisionObject*, const btDispatcherInfo&,
                                 btManifoldResult*) override {
    return 1;
  }
  void getAllContactManifolds(btManifoldArray& out) override { out.push_back(manifold_); }

 private:
  struct Found;
  static void find(const btCollisionShape& shape, const btTransform& pose, const btTransform& plane, double within,
                   Found& out);

  static constexpr int kInPile = -1, kAlone = 1, kBullets = 2;  ///< -1 is what Bullet begins with.

  btPersistentManifold* manifold_;
  btConvexPlaneCollisionAlgorithm bullets_;  ///< Works on the same manifold.
  bool plane_first_;
};

}  // namespace physics::bullet
