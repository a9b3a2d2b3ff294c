#include "physics_node/stepper.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>

#include <gtest/gtest.h>

#include "physics_node/analytic/analytic_world.hpp"

namespace {

using physics::AnalyticWorld;
using physics::ProxyConfig;
using physics::Stepper;
using rtbus::shapes::PlacedShape;
using rtbus::shapes::Plane;

ProxyConfig proxy_config(double stiffness_n_per_m = 200.0) {
  ProxyConfig config;
  config.device = "haptic0";
  config.stiffness_n_per_m = stiffness_n_per_m;
  config.position_m = {0, 0.3, 0};
  return config;
}

Stepper floor_stepper(int substeps = 1, const ProxyConfig& config = proxy_config()) {
  PlacedShape floor;
  floor.shape = Plane{};
  return Stepper(std::make_unique<AnalyticWorld>(std::vector{floor}), {config}, substeps);
}

rtbus::DeviceState device_at(double x, double y, std::uint32_t enabled = 1) {
  rtbus::DeviceState device;
  device.target_position_m = {x, y, 0};
  device.enabled = enabled;
  device.sample_time_ns = 777;
  return device;
}

TEST(Stepper, LeavesTheProxyAloneUntilTheDeviceSpeaks) {
  Stepper stepper = floor_stepper();
  for (int i = 0; i < 10; ++i) stepper.step(1e-3);
  const rtbus::ProxyState state = stepper.answer(0);
  EXPECT_EQ(state.position_m, (rtbus::Vec3{0, 0.3, 0}));
  EXPECT_EQ(state.device_sequence, 0U);
  EXPECT_EQ(state.step_index, 10U);
}

TEST(Stepper, PutsTheProxyOntoTheFirstTarget) {
  Stepper stepper = floor_stepper();
  stepper.set_device(0, device_at(0.1, 0.2), 5);
  stepper.step(1e-3);
  const rtbus::ProxyState state = stepper.answer(0);
  EXPECT_EQ(state.position_m, (rtbus::Vec3{0.1, 0.2, 0}));
  EXPECT_EQ(state.coupling_force_n, (rtbus::Vec3{0, 0, 0}));
}

// A device in steady motion: the proxy is where the device will be, with no force between them, whatever the parts.
TEST(Stepper, LeadsTheDeviceBySoManySteps) {
  for (const int parts : {1, 10}) {
    ProxyConfig config = proxy_config();
    config.lead_steps = 1.5;
    Stepper stepper = floor_stepper(parts, config);
    for (int i = 0; i < 200; ++i) {
      rtbus::DeviceState device = device_at(0.03 * i * 0.01, 0.1);
      device.target_velocity_m_s = {0.03, 0, 0};
      stepper.set_device(0, device, 1 + i);
      stepper.step(0.01);
    }
    EXPECT_NEAR(stepper.answer(0).position_m[0], 0.03 * (199 + 1.5) * 0.01, 1e-9) << parts;
    EXPECT_NEAR(stepper.answer(0).coupling_force_n[0], 0.0, 1e-6) << parts;
  }
}

TEST(Stepper, AnswersWithWhatItWasTold) {
  Stepper stepper = floor_stepper();
  rtbus::DeviceState device = device_at(0, 0.1);
  device.mapping_epoch = 3;
  stepper.set_device(0, device, 42);
  stepper.step(0.002);
  const rtbus::ProxyState state = stepper.answer(0);
  EXPECT_EQ(state.device_sequence, 42U);
  EXPECT_EQ(state.device_time_ns, 777U);
  EXPECT_EQ(state.mapping_epoch, 3U);
  EXPECT_EQ(state.step_s, 0.002);
  EXPECT_DOUBLE_EQ(stepper.simulated_s(), 0.002);
}

TEST(Stepper, HoldsTheProxyAtTheTargetWithoutForceWhileDisabled) {
  Stepper stepper = floor_stepper();
  stepper.set_device(0, device_at(0, 0.1), 1);
  for (int i = 0; i < 50; ++i) {
    rtbus::DeviceState device = device_at(0.001 * i, 0.1, 0);
    device.target_velocity_m_s = {1, 0, 0};
    stepper.set_device(0, device, 2 + i);
    stepper.step(1e-3);
    ASSERT_EQ(stepper.answer(0).position_m, (rtbus::Vec3{0.001 * i, 0.1, 0}));
    ASSERT_EQ(stepper.answer(0).coupling_force_n, (rtbus::Vec3{0, 0, 0}));
  }
}

TEST(Stepper, TellsTheWorkOfTheWorldSinceTheEpochBegan) {
  Stepper stepper = floor_stepper(3);
  double work_j = 0.0, y_m = 0.0;
  for (int i = 0; i < 500; ++i) {
    stepper.set_device(0, device_at(0, -0.01), 1 + i);
    if (i == 0) y_m = -0.01;
    stepper.step(1e-3);
    const rtbus::ProxyState answer = stepper.answer(0);
    work_j -= answer.coupling_force_n[1] * (answer.position_m[1] - y_m);
    y_m = answer.position_m[1];
    ASSERT_NEAR(answer.coupling_work_j, work_j, 1e-5) << i;
  }
  EXPECT_NEAR(work_j, 0.5 * 200 * 0.01 * 0.01, 0.2e-3) << "what the spring holds then";
  const double before_silence_j = stepper.answer(0).coupling_work_j;
  stepper.release(0);
  stepper.set_device(0, device_at(0, -0.01), 999);
  EXPECT_EQ(stepper.answer(0).coupling_work_j, before_silence_j) << "the proxy is put onto the hand; no work is done";
  rtbus::DeviceState anew = device_at(0, 0.05);
  anew.mapping_epoch += 1;
  stepper.set_device(0, anew, 1000);
  stepper.step(1e-3);
  EXPECT_NEAR(stepper.answer(0).coupling_work_j, 0.0, 1e-6);
}

TEST(Stepper, StartsAtZeroForceWhenEnabledInsideABody) {
  Stepper stepper = floor_stepper();
  stepper.set_device(0, device_at(0, -0.01, 0), 1);
  stepper.step(1e-3);
  double before_n = 0.0;
  for (int i = 0; i < 1000; ++i) {
    stepper.set_device(0, device_at(0, -0.01, 1), 2 + i);
    stepper.step(1e-3);
    const double force_n = -stepper.answer(0).coupling_force_n[1];
    ASSERT_LE(force_n, before_n + 200 * AnalyticWorld::kRecoverySpeedMS * 2e-3 + 1e-9) << i;  // K · speed · two steps
    before_n = force_n;
  }
  EXPECT_NEAR(before_n, 2.0, 1e-6);  // in the end K · depth
}

TEST(Stepper, RebasesWhenTheMappingChanges) {
  Stepper stepper = floor_stepper();
  stepper.set_device(0, device_at(0, 0.1), 1);
  stepper.step(1e-3);
  rtbus::DeviceState device = device_at(0.5, 0.4);
  device.mapping_epoch = 1;
  stepper.set_device(0, device, 2);
  stepper.step(1e-3);
  EXPECT_EQ(stepper.answer(0).position_m, (rtbus::Vec3{0.5, 0.4, 0}));
  EXPECT_EQ(stepper.answer(0).velocity_m_s, (rtbus::Vec3{0, 0, 0}));
}

TEST(Stepper, PressesWithTheStiffnessAtTheDeviceWhateverTheScale) {
  // Depth at the device is depth / s, force at the device is force / force_scale; their ratio stays K.
  for (const double scale : {0.1, 1.0, 10.0}) {
    Stepper stepper = floor_stepper();
    rtbus::DeviceState device = device_at(0, 0.002 * scale);
    device.position_scale = scale;
    device.force_scale = 1.0 / scale;
    stepper.set_device(0, device, 1);
    device.target_position_m[1] = -0.002 * scale;
    for (int i = 0; i < 4000; ++i) {
      stepper.set_device(0, device, 2 + i);
      stepper.step(1e-3);
    }
    const double force_at_device_n = stepper.answer(0).contact_force_n[1] / device.force_scale;
    EXPECT_NEAR(force_at_device_n, 200 * 0.002, 1e-6) << scale;
  }
}

TEST(Stepper, UsesTheDampingOfTheFileAtTheDevice) {
  ProxyConfig config = proxy_config(1.0);
  config.damping_n_s_per_m = 3.0;
  Stepper stepper = floor_stepper(1, config);
  rtbus::DeviceState device = device_at(0, 0.1);
  device.position_scale = 2.0;
  device.force_scale = 0.5;
  stepper.set_device(0, device, 1);
  device.target_velocity_m_s = {0.4, 0, 0};
  stepper.set_device(0, device, 2);
  stepper.step(1e-4);
  // Implicitly, from rest at the target: v⁺ = h·B·v_T/(m + h·B + h²·K), with B and K scaled by 0.5/2.
  const double h = 1e-4, B = 0.75, K = 0.25;
  EXPECT_NEAR(stepper.answer(0).velocity_m_s[0], h * B * 0.4 / (0.1 + h * B + h * h * K), 1e-15);
}

TEST(Stepper, IgnoresAndCountsStatesThatAreNotFiniteOrHaveNoScale) {
  Stepper stepper = floor_stepper();
  stepper.set_device(0, device_at(0, 0.1), 1);
  rtbus::DeviceState bad = device_at(std::numeric_limits<double>::quiet_NaN(), 0);
  stepper.set_device(0, bad, 2);
  bad = device_at(0.2, 0.2);
  bad.target_velocity_m_s[2] = std::numeric_limits<double>::infinity();
  stepper.set_device(0, bad, 3);
  bad = device_at(0.2, 0.2);
  bad.position_scale = 0.0;
  stepper.set_device(0, bad, 4);
  stepper.step(1e-3);
  EXPECT_EQ(stepper.ignored_states(), 3U);
  EXPECT_EQ(stepper.answer(0).device_sequence, 1U);
  EXPECT_EQ(stepper.answer(0).position_m, (rtbus::Vec3{0, 0.1, 0}));
}

TEST(Stepper, LetsGoOfTheProxyOfASilentDevice) {
  Stepper stepper = floor_stepper();
  rtbus::DeviceState device = device_at(0, 0.1);
  stepper.set_device(0, device, 1);
  device.target_velocity_m_s = {0.5, 0, 0};
  stepper.set_device(0, device, 2);
  for (int i = 0; i < 5000; ++i) stepper.step(1e-3);
  const rtbus::Vec3 held = stepper.answer(0).position_m;
  EXPECT_GT(held[0], 0.01);  // the damper holds it ahead of the target
  stepper.release(0);
  for (int i = 0; i < 100; ++i) stepper.step(1e-3);
  EXPECT_EQ(stepper.answer(0).position_m, held);
  EXPECT_EQ(stepper.answer(0).velocity_m_s, (rtbus::Vec3{0, 0, 0}));
  EXPECT_EQ(stepper.answer(0).coupling_force_n, (rtbus::Vec3{0, 0, 0}));
}

TEST(Stepper, ReportsContactsWithTheSampleTheyAnswer) {
  Stepper stepper = floor_stepper();
  rtbus::DeviceState device = device_at(0, 0.0005);
  device.wants = rtbus::kWantsContacts;
  EXPECT_FALSE(stepper.wants_contacts(0));
  stepper.set_device(0, device, 42);
  EXPECT_TRUE(stepper.wants_contacts(0));
  stepper.step(1e-3);
  rtbus::ProxyContacts contacts;
  stepper.contacts(0, 0.0, contacts);
  EXPECT_EQ(contacts.device_sequence, 42U);
  EXPECT_EQ(contacts.device_time_ns, 777U);
  EXPECT_EQ(contacts.step_index, 1U);
  EXPECT_EQ(contacts.radius_m, 1e-3);  // at rest: two steps at 0.2 m/s are less than a millimetre
  ASSERT_EQ(contacts.contacts, 1U);
  EXPECT_NEAR(contacts.contact_gap_m[0], 0.0005, 1e-12);
  EXPECT_EQ(contacts.contact_normal[0], (rtbus::Vec3{0, 1, 0}));
  EXPECT_EQ(contacts.bodies, 1U);
  EXPECT_EQ(contacts.contact_inverse_mass_per_kg[0], rtbus::Symmetric3{});
  // The radius grows with the step and with the speed, as of one who falls; one that is given stands.
  stepper.step(0.05);
  EXPECT_NEAR(stepper.contact_radius_m(0), 2 * 0.05 * (0.2 + 0.05 * 9.81), 1e-12);
  device.target_velocity_m_s = {0.6, 0, 0};
  stepper.set_device(0, device, 43);
  EXPECT_NEAR(stepper.contact_radius_m(0), 2 * 0.05 * (0.6 + 0.05 * 9.81), 1e-12);
  // Over a network answers are older than two steps. A hand that says so is answered as far as it goes meanwhile, and
  // still so when the next answers were faster.
  device.answer_age_s = 0.25;
  stepper.set_device(0, device, 44);
  EXPECT_NEAR(stepper.contact_radius_m(0), 0.25 * (0.6 + 0.05 * 9.81), 1e-12);
  device.answer_age_s = 0.2;
  stepper.set_device(0, device, 45);
  EXPECT_NEAR(stepper.contact_radius_m(0), physics::Stepper::kAgeKept * 0.25 * (0.6 + 0.05 * 9.81), 1e-12);
  stepper.contacts(0, 1e-4, contacts);
  EXPECT_EQ(contacts.contacts, 0U);
  stepper.release(0);
  EXPECT_FALSE(stepper.wants_contacts(0));
}

TEST(Stepper, StartsAnewWithADeviceThatWasSilent) {
  Stepper stepper = floor_stepper();
  stepper.set_device(0, device_at(0, 0.1), 1);
  stepper.step(1e-3);
  stepper.release(0);
  stepper.step(1e-3);
  EXPECT_EQ(stepper.answer(0).position_m, (rtbus::Vec3{0, 0.1, 0}));
  stepper.set_device(0, device_at(0.3, 0.2), 2);
  stepper.step(1e-3);
  EXPECT_EQ(stepper.answer(0).position_m, (rtbus::Vec3{0.3, 0.2, 0}));
  stepper.set_device(0, device_at(0.4, 0.2), 3);
  stepper.step(1e-3);
  EXPECT_LT(stepper.answer(0).position_m[0], 0.35);  // from here on it is pulled, not put
}

TEST(Stepper, TracksASteadyMotionWithoutLagHoweverCoarseTheSteps) {
  // The proxy at the end of a step belongs to the sample it answers: no drag in free air once the start has decayed.
  struct Case {
    double dt_s;
    int substeps;
  };
  for (const Case c : {Case{1e-3, 1}, Case{1.0 / 18, 56}, Case{0.2, 200}, Case{0.2, 1}}) {
    Stepper stepper = floor_stepper(c.substeps);
    double x = 0.0;
    const int steps = static_cast<int>(4.0 / c.dt_s);
    for (int i = 0; i < steps; ++i) {
      x = 0.1 * i * c.dt_s;
      rtbus::DeviceState device = device_at(x, 0.1);
      device.target_velocity_m_s = {0.1, 0, 0};
      stepper.set_device(0, device, 1 + i);
      stepper.step(c.dt_s);
    }
    EXPECT_NEAR(stepper.answer(0).position_m[0], x, 1e-6) << c.dt_s << ' ' << c.substeps;
    EXPECT_NEAR(stepper.answer(0).coupling_force_n[0], 0.0, 1e-4) << c.dt_s << ' ' << c.substeps;
  }
}

TEST(Stepper, ReportsForcesAsMeansOverTheWholeStep) {
  Stepper stepper = floor_stepper(20);
  stepper.set_device(0, device_at(0, 0.05), 1);
  double before = 0.0;
  for (int i = 0; i < 30; ++i) {
    stepper.set_device(0, device_at(0, -0.01), 2 + i);
    stepper.step(0.02);
    const rtbus::ProxyState state = stepper.answer(0);
    const double impulse = (state.coupling_force_n[1] + state.contact_force_n[1]) * 0.02;
    ASSERT_NEAR(0.1 * (state.velocity_m_s[1] - before), impulse, 1e-12) << i;
    before = state.velocity_m_s[1];
  }
}

TEST(Stepper, IsBitIdenticalWhenRunTwice) {
  rtbus::ProxyState last[2];
  for (rtbus::ProxyState& out : last) {
    Stepper stepper = floor_stepper(3);
    for (int i = 0; i < 3000; ++i) {
      stepper.set_device(0, device_at(0.05 * std::sin(0.01 * i), 0.02 * std::cos(0.017 * i)), 1 + i);
      stepper.step(1e-3);
    }
    out = stepper.answer(0);
  }
  // ProxyState has no padding, so equal bytes mean equal answers.
  EXPECT_EQ(std::memcmp(static_cast<const void*>(&last[0]), static_cast<const void*>(&last[1]), sizeof last[0]), 0);
}

rtbus::DeviceState ordering(double y, double velocity_y, double stiffness, double damping, double horizon) {
  rtbus::DeviceState device = device_at(0, y);
  device.target_velocity_m_s = {0, velocity_y, 0};
  device.hand_stiffness_n_per_m = stiffness;
  device.hand_damping_n_s_per_m = damping;
  device.prediction_periods = horizon;
  return device;
}

TEST(StepperHandForce, IsZeroUnlessOrdered) {
  Stepper stepper = floor_stepper();
  stepper.set_device(0, device_at(0, 0.1), 1);
  stepper.step(1e-3);
  stepper.set_device(0, device_at(0, -0.1), 2);
  stepper.step(1e-3);
  EXPECT_EQ(stepper.answer(0).hand_force_n, (rtbus::Vec3{0, 0, 0}));
}

// Eq. (3): K(P_p − P_h) − B·V_p; eq. (4): the proxy at P_p + n·h·V_p. In the improved form the damper is relative.
TEST(StepperHandForce, FollowsEquations3And4) {
  for (const bool paper : {true, false}) {
    for (const double horizon : {0.0, 1.3}) {
      ProxyConfig config = proxy_config(100.0);
      config.wire.paper = paper;
      Stepper stepper = floor_stepper(1, config);
      stepper.set_device(0, ordering(0.05, 0.0, 300.0, 2.0, horizon), 1);
      stepper.step(5e-3);
      stepper.set_device(0, ordering(0.04, -0.7, 300.0, 2.0, horizon), 2);
      stepper.step(5e-3);
      const rtbus::ProxyState state = stepper.answer(0);
      const double velocity = state.velocity_m_s[1];
      ASSERT_LT(velocity, -1e-3) << "the proxy must be moving, else the case proves little";
      const double damped = paper ? -velocity : velocity - -0.7;
      const double expected = 300.0 * (state.position_m[1] + horizon * 5e-3 * velocity - 0.04) + 2.0 * damped;
      EXPECT_NEAR(state.hand_force_n[1], expected, 1e-12) << paper << horizon;
    }
  }
}

TEST(StepperHandForce, IsInTheWorldsScale) {
  ProxyConfig config = proxy_config(100.0);
  Stepper stepper = floor_stepper(1, config);
  rtbus::DeviceState device = ordering(0.1, 0.0, 300.0, 0.0, 0.0);
  device.position_scale = 10.0;
  device.force_scale = 0.1;
  stepper.set_device(0, device, 1);
  stepper.step(1e-3);
  device.target_position_m = {0, -0.05, 0};  // 5 mm at the device
  stepper.set_device(0, device, 2);
  for (int i = 0; i < 3000; ++i) stepper.step(1e-3);
  // 300 N/m · 5 mm = 1.5 N on the hand are 0.15 N in this world.
  EXPECT_NEAR(stepper.answer(0).hand_force_n[1], 0.15, 1e-6);
}

TEST(StepperHandForce, IsZeroWhileDisabledAndAfterSilence) {
  Stepper stepper = floor_stepper();
  stepper.set_device(0, ordering(0.05, 0, 300, 0, 0), 1);
  stepper.step(1e-3);
  stepper.set_device(0, ordering(-0.05, 0, 300, 0, 0), 2);
  stepper.step(1e-3);
  ASSERT_GT(stepper.answer(0).hand_force_n[1], 1.0);
  stepper.release(0);
  stepper.step(1e-3);
  EXPECT_EQ(stepper.answer(0).hand_force_n, (rtbus::Vec3{0, 0, 0}));
  rtbus::DeviceState off = ordering(-0.05, 0, 300, 0, 0);
  off.enabled = 0;
  stepper.set_device(0, off, 3);
  stepper.step(1e-3);
  EXPECT_EQ(stepper.answer(0).hand_force_n, (rtbus::Vec3{0, 0, 0}));
}

// Paper's form: F = K(P_h − P_p) − B·V_p once, at the step's beginning, held over all its parts.
TEST(StepperExplicitSpring, IsComputedOncePerStepAndHeld) {
  ProxyConfig config = proxy_config(100.0);
  config.damping_n_s_per_m = 3.0;
  config.wire.paper = true;
  Stepper stepper = floor_stepper(4, config);
  stepper.set_device(0, device_at(0, 0.10), 1);
  stepper.step(0.02);
  double x = 0.10, v = 0.0;
  for (int packet = 2; packet < 8; ++packet) {
    const double target = 0.10 + 0.002 * packet;
    rtbus::DeviceState device = device_at(0, target);
    device.target_velocity_m_s = {0, 9.0, 0};  // the paper's damper does not look at it
    stepper.set_device(0, device, static_cast<std::uint64_t>(packet));
    stepper.step(0.02);
    const double force = 100.0 * (target - x) - 3.0 * v;
    for (int part = 0; part < 4; ++part) {
      v += 0.005 * force / config.mass_kg;
      x += 0.005 * v;
    }
    EXPECT_NEAR(stepper.answer(0).position_m[1], x, 1e-12);
    EXPECT_NEAR(stepper.answer(0).velocity_m_s[1], v, 1e-12);
    EXPECT_NEAR(stepper.answer(0).coupling_force_n[1], force, 1e-12);
  }
}

// 20 ms, 0.07 kg: the explicit spring is stable at 200 N/m and explodes at 500 N/m; the implicit one does neither.
TEST(StepperExplicitSpring, DivergesWhereTheImplicitOneSettles) {
  const auto farthest = [](bool paper, double stiffness) {
    ProxyConfig config = proxy_config(stiffness);
    config.mass_kg = 0.07;
    config.damping_n_s_per_m = 2.0 * 0.85 * std::sqrt(stiffness * config.mass_kg);
    config.wire.paper = paper;
    Stepper stepper = floor_stepper(20, config);
    stepper.set_device(0, device_at(0, 1.0), 1);
    stepper.step(0.02);
    stepper.set_device(0, device_at(0, 1.01), 2);
    double far_m = 0.0;
    for (int i = 0; i < 200; ++i) {
      stepper.step(0.02);
      if (i > 100) far_m = std::max(far_m, std::abs(stepper.answer(0).position_m[1] - 1.01));
    }
    return far_m;
  };
  EXPECT_LT(farthest(true, 200.0), 1e-6);
  EXPECT_GT(farthest(true, 500.0), 0.1);
  EXPECT_LT(farthest(false, 500.0), 1e-6);
  EXPECT_LT(farthest(false, 50000.0), 1e-6);
}

}  // namespace
