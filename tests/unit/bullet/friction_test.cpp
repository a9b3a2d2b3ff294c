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

/// Not a cube: what ω×Iω does to it is not zero.
rtbus::config::Body long_box(double mass_kg) {
  return tests::body("long", rtbus::shapes::Box{Vector3d(0.02, 0.01, 0.01)}, {0, 0.01, 0}, mass_kg);
}

// In a step a push beside the middle of 2 g makes a spin of 0.7 rad/s, which the floor takes away. Bullet's gyroscopic
// torque is of the spin before that, and turned the box by 88 mrad in a second.
TEST(BulletFriction, HoldsALightBoxThatIsPressedHard) {
  rtbus::config::Scene scene = tests::floor_scene();
  scene.bodies.push_back(long_box(0.002));
  scene.bodies[0].friction = scene.bodies[1].friction = 2.0;
  const auto world = tests::bullet(scene);
  const std::size_t proxy = world->add_proxy({"haptic0", 0.1, 0.005, 0.0, {0, 0.2, 0}});
  world->place_proxy(proxy, {0, 0.2, 0}, Vector3d::Zero());
  const Vector3d force_n(0.05, -0.41, 0.005), arm_m(-0.15e-3, 0.01, 1.7e-3);
  constexpr double kStepS = 2.7e-3;
  const auto push = [&](double seconds) {
    for (int i = 0; i < std::lround(seconds / kStepS); ++i) {
      world->apply_hand_force(proxy, 1, force_n, arm_m.cross(force_n));
      world->step(kStepS);
    }
    return world->body_pose(1);
  };
  const physics::BodyPose before = push(0.5), after = push(1.0);
  EXPECT_LE((after.position_m - before.position_m).norm(), 1e-6);
  EXPECT_LE(after.orientation.angularDistance(before.orientation), 1e-4);
}

// A hand that gives nothing leaves a spinning box as it is: its gyroscopic torque is neither lost nor counted twice.
TEST(BulletFriction, LeavesASpinAlone) {
  rtbus::config::Scene scene = tests::floor_scene();
  scene.gravity_m_s2.setZero();
  scene.bodies.push_back(long_box(0.1));
  scene.bodies[1].p_WB.y() = 0.2;
  const auto spun = [&scene](bool touched) {
    const auto world = tests::bullet(scene);
    const std::size_t proxy = world->add_proxy({"haptic0", 0.1, 0.005, 0.0, {0, 0.4, 0}});
    world->place_proxy(proxy, {0, 0.4, 0}, Vector3d::Zero());
    world->apply_hand_force(proxy, 1, Vector3d::Zero(), Vector3d(0.02, 0.05, 0.03));
    for (int i = 0; i < 500; ++i) {
      world->step(kPartS);
      if (touched) world->apply_hand_force(proxy, 1, Vector3d::Zero(), Vector3d::Zero());
    }
    return world->body_pose(1).orientation;
  };
  const double turned_rad = spun(true).angularDistance(Eigen::Quaterniond::Identity());
  EXPECT_GT(turned_rad, 0.5) << "it spins";
  EXPECT_LE(spun(true).angularDistance(spun(false)), 1e-4);
}

/// Boxes of kBlockKg, the first one pushed or another, at 8 mm above its centre.
struct PushedBoxes {
  std::unique_ptr<physics::World> world;
  std::size_t proxy = 0;

  explicit PushedBoxes(const std::vector<Vector3d>& places_m) {
    rtbus::config::Scene scene = tests::floor_scene();
    for (const Vector3d& place_m : places_m) {
      scene.bodies.push_back(tests::body("box" + std::to_string(scene.bodies.size()),
                                         rtbus::shapes::Box{Vector3d::Constant(0.02)}, place_m, kBlockKg));
    }
    for (rtbus::config::Body& each : scene.bodies) each.friction = std::sqrt(kPairFriction);
    world = tests::bullet(scene);
    proxy = world->add_proxy({"haptic0", 0.1, 0.005, 0.0, {0, 0.4, 0}});
    world->place_proxy(proxy, {0, 0.4, 0}, Vector3d::Zero());
    push(1, Vector3d::Zero(), 0.2);
  }

  Vector3d push(std::size_t body, const Vector3d& force_n, double seconds) const {
    for (int i = 0; i < std::lround(seconds / kPartS); ++i) {
      world->apply_hand_force(proxy, body, force_n, Vector3d(0, 0.008, 0).cross(force_n));
      world->step(kPartS);
    }
    return world->body_pose(body).position_m;
  }
  /// In four seconds.
  [[nodiscard]] double creeps_m(std::size_t body, const Vector3d& force_n) const {
    const Vector3d before = push(body, force_n, 0.5);
    const double crept_m = (push(body, force_n, 4.0) - before).norm();
    std::printf("body %zu crept by %.2f um\n", body, 1e6 * crept_m);
    return crept_m;
  }
};

// A box that carries one of its own weight is held by the friction of both. With Bullet's own it crept by millimetres.
TEST(BulletFriction, HoldsABoxThatCarriesAnother) {
  const PushedBoxes boxes({{0, 0.02, 0}, {0, 0.06, 0}});
  const Vector3d bound_n = kBoundN * Vector3d(1, 0, 1).normalized();
  EXPECT_LE(boxes.creeps_m(1, 1.6 * bound_n), 100e-6) << "both of them";
  EXPECT_LE(boxes.creeps_m(2, 0.8 * bound_n), 100e-6) << "the upper one alone";
}

// A pyramid of six: three on the floor, and none on more than two others.
TEST(BulletFriction, HoldsAPyramidOfSix) {
  const PushedBoxes boxes(
      {{0, 0.02, 0}, {0, 0.02, -0.041}, {0, 0.02, -0.082}, {0, 0.06, -0.0205}, {0, 0.06, -0.0615}, {0, 0.1, -0.041}});
  EXPECT_LE(boxes.creeps_m(6, 0.8 * kBoundN * Vector3d(1, 0, 1).normalized()), 100e-6);
}

}  // namespace
