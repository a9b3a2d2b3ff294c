/// What a hand gives to bodies when its law moves the proxy by itself (DeviceState::hand_impulse_…): Newton's third law
/// at the side of the world.
#include <gtest/gtest.h>

#include <cmath>

#include "physics_node/stepper.hpp"
#include "tests/unit/bullet/scenes.hpp"

namespace {

using physics::Stepper;
using tests::Vector3d;

constexpr double kMassKg = 0.1, kStepS = 0.05;
constexpr int kParts = 50;

/// One cube in free space.
std::unique_ptr<Stepper> cube_in_space() {
  rtbus::config::Scene scene;
  scene.file = "test.yaml";
  scene.gravity_m_s2.setZero();
  scene.bodies.push_back(tests::body("cube", rtbus::shapes::Box{Vector3d::Constant(0.01)}, {0, 0, 0}, kMassKg));
  physics::ProxyConfig proxy;
  proxy.device = "haptic0";
  proxy.radius_m = 0.005;
  proxy.stiffness_n_per_m = 500.0;
  return std::make_unique<Stepper>(tests::bullet(scene), std::vector<physics::ProxyConfig>{proxy}, kParts);
}

rtbus::DeviceState hand(std::uint64_t sample_ns) {
  rtbus::DeviceState device;
  device.sample_time_ns = sample_ns;
  device.mapping_epoch = 1;
  device.enabled = 1;
  device.wants = rtbus::kWantsContacts | rtbus::kOwnsProxy;
  device.hand_impulse_generation[0] = 1;
  return device;
}

TEST(PushedBody, GetsTheImpulseOnceAndWhereInTheStepItFell) {
  for (const double at : {0.0, 0.3, 0.5, 0.9}) {
    const auto stepper = cube_in_space();
    rtbus::DeviceState device = hand(1'000'000'000);
    stepper->set_device(0, device, 1);
    stepper->step(kStepS);
    // 0.02 N·s along z within the millisecond that begins at `at` of the step.
    const auto tick = static_cast<std::uint64_t>(at * kParts);
    for (std::uint64_t i = 1; i <= kParts; ++i) {
      device.sample_time_ns += 1'000'000;
      if (i == tick + 1) device.hand_impulse_n_s[0] = {0, 0, 0.02};
      if (i < kParts) stepper->hear(0, device);
    }
    stepper->set_device(0, device, 2);
    stepper->step(kStepS);
    const double speed = 0.02 / kMassKg;
    EXPECT_NEAR(stepper->world().body_pose(0).position_m.z(), speed * kStepS * (1.0 - at), 1e-6 * speed) << at;
    EXPECT_NEAR(stepper->answer(0).contact_force_n[2], -0.02 / kStepS, 1e-9);
    const double before_m = stepper->world().body_pose(0).position_m.z();
    device.sample_time_ns += 50'000'000;
    stepper->set_device(0, device, 3);
    stepper->step(kStepS);
    EXPECT_NEAR(stepper->world().body_pose(0).position_m.z() - before_m, speed * kStepS, 1e-6)
        << "coasts, once is enough";
    EXPECT_EQ(stepper->answer(0).contact_force_n[2], 0.0);
  }
}

// Of samples that are gone only the sums of those around them are known.
TEST(PushedBody, GetsEvenlyWhatNobodyToldTheTimeOf) {
  const auto stepper = cube_in_space();
  rtbus::DeviceState device = hand(1'000'000'000);
  stepper->set_device(0, device, 1);
  stepper->step(kStepS);
  // Nothing in the first half, 0.02 N·s in the second.
  device.sample_time_ns += 25'000'000;
  stepper->hear(0, device);
  device.sample_time_ns += 25'000'000;
  device.hand_impulse_n_s[0] = {0, 0, 0.02};
  stepper->set_device(0, device, 2);
  stepper->step(kStepS);
  const double speed = 0.02 / kMassKg;
  // Each of 25 parts gets its share at its beginning.
  EXPECT_NEAR(stepper->world().body_pose(0).position_m.z(), speed * kStepS * 0.26, 1e-6 * speed);
}

// Neither a sample of another epoch, nor one that is older than the newest, nor one without force tells anything.
TEST(PushedBody, HearsNoSampleThatDoesNotGoOn) {
  const auto stepper = cube_in_space();
  rtbus::DeviceState device = hand(1'000'000'000);
  device.hand_impulse_n_s[0] = {0, 0, 0.01};
  stepper->hear(0, device);
  stepper->set_device(0, device, 1);
  rtbus::DeviceState other = device;
  other.hand_impulse_n_s[0] = {0, 0, 5.0};
  stepper->hear(0, other);
  other.sample_time_ns += 10'000'000;
  other.mapping_epoch = 2;
  stepper->hear(0, other);
  other.mapping_epoch = 1;
  other.enabled = 0;
  stepper->hear(0, other);
  other.enabled = 1;
  other.hand_impulse_n_s[0] = {0, 0, std::nan("")};
  stepper->hear(0, other);
  device.sample_time_ns += 50'000'000;
  stepper->set_device(0, device, 2);
  stepper->step(kStepS);
  EXPECT_NEAR(stepper->world().body_pose(0).position_m.norm(), 0.0, 1e-12);
}

TEST(PushedBody, TurnsByTheAngularImpulse) {
  const auto stepper = cube_in_space();
  stepper->set_device(0, hand(1'000'000'000), 1);
  stepper->step(kStepS);
  rtbus::DeviceState pushed = hand(1'050'000'000);
  const double inertia = kMassKg * 0.02 * 0.02 / 6.0;
  pushed.hand_impulse_n_s[0] = {0, 0, 1e-4};
  pushed.hand_angular_impulse_n_m_s[0] = {0, inertia * 2.0, 0};  // 2 rad/s
  stepper->set_device(0, pushed, 2);
  stepper->step(kStepS);
  rtbus::ProxyContacts around;
  stepper->contacts(0, 0.1, around);
  ASSERT_EQ(around.bodies, 1U);
  EXPECT_NEAR(around.body_angular_velocity_rad_s[0][1], 2.0, 0.02);
  EXPECT_NEAR(around.body_proxy_force_n[0][2], 1e-4 / kStepS, 1e-6);
}

// The proxy is inside the cube and pulled hard: it does not push, and is where the hand's method has it.
TEST(PushedBody, TheProxyItselfTouchesNothing) {
  const auto stepper = cube_in_space();
  rtbus::DeviceState inside = hand(1'000'000'000);
  inside.target_position_m = {0.003, 0.004, 0.005};
  for (int i = 1; i <= 5; ++i) {
    inside.sample_time_ns += 50'000'000;
    inside.target_position_m[0] += 0.001;
    stepper->set_device(0, inside, static_cast<std::uint64_t>(i));
    stepper->step(kStepS);
  }
  EXPECT_NEAR(stepper->world().body_pose(0).position_m.norm(), 0.0, 1e-12);
  EXPECT_NEAR(stepper->answer(0).position_m[0], 0.008, 1e-9);
  EXPECT_EQ(stepper->answer(0).contacts, 0U);
}

// A row that begins anew for another body counts from zero; a new epoch gives nothing of before.
TEST(PushedBody, CountsFromZeroForAnotherTurnAndForgetsAtANewEpoch) {
  const auto stepper = cube_in_space();
  rtbus::DeviceState device = hand(1'000'000'000);
  device.hand_impulse_n_s[0] = {0, 0, 5.0};  // of a life before
  stepper->set_device(0, device, 1);
  stepper->step(kStepS);
  EXPECT_NEAR(stepper->world().body_pose(0).position_m.norm(), 0.0, 1e-12);
  device.sample_time_ns += 50'000'000;
  device.hand_impulse_generation[0] = 2;
  device.hand_impulse_n_s[0] = {0.01, 0, 0};
  stepper->set_device(0, device, 2);
  stepper->step(kStepS);
  EXPECT_NEAR(stepper->answer(0).contact_force_n[0], -0.01 / kStepS, 1e-9);
  device.mapping_epoch = 2;
  device.hand_impulse_n_s[0] = {0.5, 0, 0};
  stepper->set_device(0, device, 3);
  stepper->step(kStepS);
  EXPECT_EQ(stepper->answer(0).contact_force_n[0], 0.0);
}

}  // namespace
