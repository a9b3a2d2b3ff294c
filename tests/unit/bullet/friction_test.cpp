/// Friction of the engine bullet, against the closed form: a block on a floor, pushed by a hand whose method moves the
/// proxy itself, beside its centre.
#include <gtest/gtest.h>

#include <cmath>

#include "tests/unit/bullet/scenes.hpp"

namespace {

using tests::Vector3d;

constexpr double kBlockKg = 0.3, kPairFriction = 0.3, kGravity = 9.81, kPartS = 1e-3;
constexpr double kBoundN = kPairFriction * kBlockKg * kGravity;

struct PushedBlock {
  std::unique_ptr<physics::World> world;
  std::size_t proxy = 0;

  PushedBlock() {
    rtbus::config::Scene scene = tests::floor_scene();
    scene.bodies.push_back(tests::body("block", rtbus::shapes::Box{Vector3d::Constant(0.02)}, {0, 0.02, 0}, kBlockKg));
    scene.bodies[0].friction = scene.bodies[1].friction = std::sqrt(kPairFriction);
    world = tests::bullet(scene);
    proxy = world->add_proxy({"haptic0", 0.1, 0.005, 0.0, {0, 0.2, 0}});
    world->place_proxy(proxy, {0, 0.2, 0}, Vector3d::Zero());
  }

  /// At 8 mm above the centre: far from tipping it.
  void push(const Vector3d& force_n, double seconds) const {
    const Vector3d arm_m(0, 0.008, 0);
    for (int i = 0; i < std::lround(seconds / kPartS); ++i) {
      world->apply_hand_force(proxy, 1, force_n, arm_m.cross(force_n));
      world->step(kPartS);
    }
  }
  [[nodiscard]] Vector3d place() const { return world->body_pose(1).position_m; }
};

const Vector3d kDirections[] = {{1, 0, 0}, {0, 0, 1}, Vector3d(1, 0, 1).normalized()};

// Bullet alone moves a block by 0.5 to 2 µm that is pushed at its centre. At 8 mm above it, it crept by 5 mm.
TEST(BulletFriction, HoldsABlockThatIsPushedBelowTheBound) {
  for (const Vector3d& direction : kDirections) {
    PushedBlock block;
    block.push(Vector3d::Zero(), 0.2);
    block.push(0.8 * kBoundN * direction, 0.5);
    const Vector3d before = block.place();
    block.push(0.8 * kBoundN * direction, 4.0);
    EXPECT_LE((block.place() - before).norm(), 4e-6) << direction.transpose();
  }
}

// The bound is a circle: a box of two bounds would hold 1.41 times as much along its diagonal.
TEST(BulletFriction, LetsItSlideAboveTheBoundAsFastAsCoulombSays) {
  for (const Vector3d& direction : kDirections) {
    PushedBlock block;
    block.push(Vector3d::Zero(), 0.2);
    const Vector3d before = block.place();
    block.push(1.2 * kBoundN * direction, 0.5);
    const double way_m = 0.5 * 0.2 * kBoundN / kBlockKg * 0.5 * 0.5;
    EXPECT_NEAR(direction.dot(block.place() - before), way_m, 0.02 * way_m) << direction.transpose();
  }
}

// A box that carries one of its own weight is held by the friction of both. With Bullet's own it crept by millimetres.
TEST(BulletFriction, HoldsABoxThatCarriesAnother) {
  rtbus::config::Scene scene = tests::floor_scene();
  for (const double y_m : {0.02, 0.06}) {
    scene.bodies.push_back(tests::body("box" + std::to_string(scene.bodies.size()),
                                       rtbus::shapes::Box{Vector3d::Constant(0.02)}, {0, y_m, 0}, kBlockKg));
  }
  for (rtbus::config::Body& each : scene.bodies) each.friction = std::sqrt(kPairFriction);
  const auto world = tests::bullet(scene);
  const std::size_t proxy = world->add_proxy({"haptic0", 0.1, 0.005, 0.0, {0, 0.2, 0}});
  world->place_proxy(proxy, {0, 0.2, 0}, Vector3d::Zero());
  const auto push = [&](std::size_t body, double bounds, double seconds) {
    const Vector3d force_n = bounds * kBoundN * Vector3d(1, 0, 1).normalized();
    for (int i = 0; i < std::lround(seconds / kPartS); ++i) {
      world->apply_hand_force(proxy, body, force_n, Vector3d(0, 0.008, 0).cross(force_n));
      world->step(kPartS);
    }
    return world->body_pose(body).position_m;
  };
  push(1, 0.0, 0.2);
  for (const auto& [body, bounds] : {std::pair{1U, 1.6}, std::pair{2U, 0.8}}) {  // both of them, the upper one alone
    const Vector3d before = push(body, bounds, 0.5);
    const double crept_m = (push(body, bounds, 4.0) - before).norm();
    std::printf("body %u crept by %.2f um\n", body, 1e6 * crept_m);
    EXPECT_LE(crept_m, 100e-6) << body;
  }
}

}  // namespace
