/// The stack in Bullet and nothing else: what a step costs without this project. Settings are those of BulletWorld.
#include <btBulletDynamicsCommon.h>

#include <cmath>
#include <cstdio>
#include <memory>
#include <vector>

#include "tests/overhead/stack.hpp"

namespace {

constexpr double kScale = 10.0 / overhead::kEdge_m;  // units per metre
constexpr double kTolerance = 10.0 / 0.6;

struct Bare {
  btDefaultCollisionConfiguration configuration;
  btCollisionDispatcher dispatcher{&configuration};
  btDbvtBroadphase broadphase;
  btSequentialImpulseConstraintSolver solver;
  btDiscreteDynamicsWorld world{&dispatcher, &broadphase, &solver, &configuration};
  btStaticPlaneShape plane{btVector3(0, 1, 0), 0};
  btBoxShape box{btVector3(1, 1, 1) * btScalar(0.5 * overhead::kEdge_m * kScale)};
  btSphereShape ball{btScalar(overhead::kProxyRadius_m * kScale)};
  std::vector<std::unique_ptr<btRigidBody>> bodies;
  std::unique_ptr<btRigidBody> proxy;

  btRigidBody& add(btCollisionShape& shape, double mass_kg, const btVector3& at, double friction, int group, int mask) {
    btVector3 inertia(0, 0, 0);
    if (mass_kg > 0.0) shape.calculateLocalInertia(btScalar(mass_kg), inertia);
    btRigidBody::btRigidBodyConstructionInfo info(btScalar(mass_kg), nullptr, &shape, inertia);
    info.m_startWorldTransform.setOrigin(at);
    info.m_friction = btScalar(friction);
    bodies.push_back(std::make_unique<btRigidBody>(info));
    world.addRigidBody(bodies.back().get(), group, mask);
    return *bodies.back();
  }

  explicit Bare(const overhead::Size& size) {
    world.setGravity(btVector3(0, btScalar(-9.81 * kScale), 0));
    world.setForceUpdateAllAabbs(false);
    world.getDispatchInfo().m_allowedCcdPenetration *= btScalar(kTolerance);
    btContactSolverInfo& info = world.getSolverInfo();
    info.m_numIterations = overhead::kIterations;
    info.m_solverMode |= SOLVER_RANDMIZE_ORDER;
    info.m_splitImpulsePenetrationThreshold *= btScalar(kTolerance);
    info.m_restitutionVelocityThreshold = btScalar(2.0 * 9.81 * overhead::kStep_s * kScale);
    solver.setRandSeed(1);
    gDeactivationTime = btScalar(0.5);
    box.setMargin(btScalar(0.05 * overhead::kEdge_m * kScale));

    add(plane, 0.0, btVector3(0, 0, 0), overhead::kFriction, 1, 2 | 4);
    const double pitch_m = overhead::kEdge_m + overhead::kGap_m;
    for (int i = 0; i < size.wide; ++i) {
      for (int j = 0; j < size.high; ++j) {
        for (int k = 0; k < size.deep; ++k) {
          const btVector3 at(btScalar(i * pitch_m), btScalar((j + 0.5) * overhead::kEdge_m), btScalar(-k * pitch_m));
          btRigidBody& cube = add(box, overhead::kMass_kg, at * btScalar(kScale), overhead::kFriction, 2, 1 | 2 | 4);
          cube.setSleepingThresholds(btScalar(0.06 * std::sqrt(9.81 * overhead::kEdge_m) * kScale),
                                     btScalar(0.045 * std::sqrt(9.81 / overhead::kEdge_m)));
        }
      }
    }
    btRigidBody::btRigidBodyConstructionInfo tool(btScalar(overhead::kProxyMass_kg), nullptr, &ball);
    proxy = std::make_unique<btRigidBody>(tool);
    proxy->setFlags(proxy->getFlags() | BT_DISABLE_WORLD_GRAVITY);
    proxy->setActivationState(DISABLE_DEACTIVATION);
    proxy->setWorldTransform(btTransform(btQuaternion::getIdentity(), target()));
    proxy->setCcdMotionThreshold(ball.getRadius() * btScalar(0.05));
    proxy->setCcdSweptSphereRadius(ball.getRadius());
    world.addRigidBody(proxy.get(), 4, 1 | 2);
  }
  ~Bare() {
    world.removeRigidBody(proxy.get());
    for (const auto& body : bodies) world.removeRigidBody(body.get());
  }

  static btVector3 target() {
    return btVector3(0, btScalar(overhead::kProxyHeight_m), btScalar(overhead::kProxyDistance_m)) * btScalar(kScale);
  }

  /// The spring in its plainest form: its force, set from outside.
  void step() {
    proxy->applyCentralForce((target() - proxy->getWorldTransform().getOrigin()) *
                                 btScalar(overhead::kStiffness_n_per_m) -
                             proxy->getLinearVelocity() * btScalar(overhead::kDamping_n_s_per_m));
    world.stepSimulation(btScalar(overhead::kStep_s), 0);
  }
};

}  // namespace

/// What callgrind counts.
extern "C" __attribute__((noinline)) void measured_steps(Bare& bare, int steps) {
  for (int i = 0; i < steps; ++i) bare.step();
}

int main(int argc, char** argv) {
  const overhead::Size size = overhead::size_of(argc, argv);
  Bare bare(size);
  for (int i = 0; i < overhead::kWarmUpSteps; ++i) bare.step();
  measured_steps(bare, size.steps);
  std::printf("%d contact manifolds\n", bare.dispatcher.getNumManifolds());
  return 0;
}
