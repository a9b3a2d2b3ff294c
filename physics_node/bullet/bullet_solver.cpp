#include "physics_node/bullet/bullet_solver.hpp"

namespace physics::bullet {
namespace {

btVector3 velocity_at(const btCollisionObject& object, const btVector3& point) {
  const btRigidBody* const body = btRigidBody::upcast(&object);
  if (body == nullptr) return {0, 0, 0};
  return body->getVelocityInLocalPoint(point - body->getWorldTransform().getOrigin());
}

}  // namespace

void BulletSolver::convertContacts(btPersistentManifold** manifolds, int count, const btContactSolverInfo& info) {
  for (int i = 0; i < count; ++i) {
    btPersistentManifold& manifold = *manifolds[i];
    const btCollisionObject& a = *manifold.getBody0();
    const btCollisionObject& b = *manifold.getBody1();
    if (a.getRestitution() * b.getRestitution() <= 0) continue;  // Bullet's combination of a pair
    for (int j = 0; j < manifold.getNumContacts(); ++j) {
      btManifoldPoint& point = manifold.getContactPoint(j);
      const btVector3 closing =
          velocity_at(b, point.getPositionWorldOnB()) - velocity_at(a, point.getPositionWorldOnA());
      if (point.m_normalWorldOnB.dot(closing) > info.m_restitutionVelocityThreshold) {
        point.m_contactPointFlags |= BT_CONTACT_FLAG_HAS_CONTACT_ERP;
        point.m_contactERP = 0;
      } else {
        point.m_contactPointFlags &= ~BT_CONTACT_FLAG_HAS_CONTACT_ERP;
      }
    }
  }
  btSequentialImpulseConstraintSolver::convertContacts(manifolds, count, info);
}

}  // namespace physics::bullet
