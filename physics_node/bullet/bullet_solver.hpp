#pragma once
/// @file bullet_solver.hpp
/// Bullet's contact solver, with bounces as high as their restitution says.
#include <btBulletDynamicsCommon.h>

namespace physics::bullet {

/// Bullet finds a contact when the bodies already overlap, by up to the way of one step, and adds the speed that pushes a
/// fifth of that depth out in one step to the speed after the bounce: on average a tenth of the impact speed too much. Here a
/// contact that bounces in this step is not pushed out in it: the bounce itself separates the bodies.
class BulletSolver final : public btSequentialImpulseConstraintSolver {
 private:
  void convertContacts(btPersistentManifold** manifolds, int count, const btContactSolverInfo& info) override;
};

}  // namespace physics::bullet
