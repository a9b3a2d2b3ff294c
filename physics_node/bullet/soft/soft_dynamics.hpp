#pragma once
/// @file soft_dynamics.hpp
/// Bullet's soft-rigid world, with contacts between soft and rigid bodies of our own making.
#include <functional>
#include <memory>

#include <BulletSoftBody/btDefaultSoftBodySolver.h>
#include <BulletSoftBody/btSoftRigidDynamicsWorld.h>
#include <btBulletDynamicsCommon.h>

namespace physics::bullet {

/// Bullet finds soft-rigid contacts in a sparse field of distances sampled 0.25 units apart, which is built cell by
/// cell when something first comes near, knows no planes, and takes no account of where the rigid body goes in the
/// step. Here whoever owns the world hands in the contacts (`collide`), and Bullet's solver of them does the rest.
/// Steps keep their double precision; Bullet hands them to soft bodies as float.
class SoftDynamics final : public btSoftRigidDynamicsWorld {
 public:
  SoftDynamics(btDispatcher* dispatcher, btBroadphaseInterface* broadphase, btConstraintSolver* solver,
               btCollisionConfiguration* configuration);
  ~SoftDynamics() override;

  /// Called once per step, when nodes are where they would come to without contacts.
  std::function<void()> collide;
  /// Called when rigid bodies have been moved, before soft bodies are solved.
  std::function<void()> moved;

 private:
  SoftDynamics(btDispatcher* dispatcher, btBroadphaseInterface* broadphase, btConstraintSolver* solver,
               btCollisionConfiguration* configuration, std::unique_ptr<btDefaultSoftBodySolver> soft_solver);
  void predictUnconstraintMotion(btScalar h) override;
  void internalSingleStepSimulation(btScalar h) override;
  void performDiscreteCollisionDetection() override;

  std::unique_ptr<btDefaultSoftBodySolver> soft_solver_;
};

}  // namespace physics::bullet
