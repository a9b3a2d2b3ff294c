#include "physics_node/bullet/soft/soft_dynamics.hpp"

#include <utility>

namespace physics::bullet {

SoftDynamics::SoftDynamics(btDispatcher* dispatcher, btBroadphaseInterface* broadphase, btConstraintSolver* solver,
                           btCollisionConfiguration* configuration)
    : SoftDynamics(dispatcher, broadphase, solver, configuration, std::make_unique<btDefaultSoftBodySolver>()) {}

SoftDynamics::SoftDynamics(btDispatcher* dispatcher, btBroadphaseInterface* broadphase, btConstraintSolver* solver,
                           btCollisionConfiguration* configuration,
                           std::unique_ptr<btDefaultSoftBodySolver> soft_solver)
    : btSoftRigidDynamicsWorld(dispatcher, broadphase, solver, configuration, soft_solver.get()),
      soft_solver_(std::move(soft_solver)) {}

SoftDynamics::~SoftDynamics() = default;

void SoftDynamics::predictUnconstraintMotion(btScalar h) {
  btDiscreteDynamicsWorld::predictUnconstraintMotion(h);
  soft_solver_->predictMotion(h);
}

void SoftDynamics::performDiscreteCollisionDetection() {
  btSoftRigidDynamicsWorld::performDiscreteCollisionDetection();
  collide();
}

/// As Bullet's own, with the step in full precision.
void SoftDynamics::internalSingleStepSimulation(btScalar h) {
  btSoftBodyArray& bodies = getSoftBodyArray();
  soft_solver_->optimize(bodies);
  btDiscreteDynamicsWorld::internalSingleStepSimulation(h);
  moved();
  btSoftBody::solveClusters(bodies);
  soft_solver_->solveConstraints(h);
  for (int i = 0; i < bodies.size(); ++i) bodies[i]->defaultCollisionHandler(bodies[i]);
  soft_solver_->updateSoftBodies();
}

}  // namespace physics::bullet
