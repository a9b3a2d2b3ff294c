/// What an answer of physics may change at once in the force of local_contact.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "haptic_node/rendering/local_world.hpp"
#include "rtbus/clock.hpp"
#include "tests/unit/haptic/held_world.hpp"

namespace answer_change_test {

using Eigen::Vector3d;
using haptic::LocalSpring;
using haptic::LocalWorld;
using rtbus::ProxyContacts;

constexpr double kStiffness = 500.0, kDamping = 0.5, kPhysics_s = 0.05, kRadius_m = 5e-3;
/// A surface that rises at 0.2 m/s under 500 N/m, in 1 ms.
constexpr double kMost_n = 0.1;

/// A body of 0.1 kg in free space whose surface is at `x_m` and faces +x.
ProxyContacts body(double x_m, double velocity_m_s, double gap_m, std::uint64_t sample_ns) {
  ProxyContacts out;
  out.device_sequence = 1;
  out.device_time_ns = sample_ns;
  out.step_s = kPhysics_s;
  out.proxy_radius_m = kRadius_m;
  out.contacts = out.bodies = 1;
  out.contact_normal[0] = {1, 0, 0};
  out.contact_gap_m[0] = gap_m;
  out.contact_point_m[0] = {x_m, 0, 0};
  out.body_kind[0] = 2;
  out.body_inverse_mass_per_kg[0] = 10.0;
  out.body_centre_m[0] = {x_m - 0.01, 0, 0};
  out.body_velocity_m_s[0] = {velocity_m_s, 0, 0};
  return out;
}

/// A wall through the origin whose normal is at `angle_rad` to x.
ProxyContacts wall(double angle_rad, std::uint64_t sample_ns) {
  ProxyContacts out = body(0.0, 0.0, 0.0, sample_ns);
  out.body_kind[0] = 0;
  out.contact_normal[0] = {std::cos(angle_rad), std::sin(angle_rad), 0};
  return out;
}

struct AnswerChange : testing::Test, tests::HeldWorld {
  AnswerChange() : HeldWorld(kStiffness, kDamping) {}

  LocalSpring hand(const Vector3d& hand_m) const { return {hand_m, Vector3d::Zero(), kStiffness, kDamping}; }
};

TEST_F(AnswerChange, IsEasedInNoFasterThanASurfaceRises) {
  const Vector3d hand_m(kRadius_m - 4e-3, 0, 0);
  reset({kRadius_m, 0, 0});
  world->take(wall(0.0, now_ns), now_ns);
  for (int i = 0; i < 20; ++i) tick(hand_m);
  const Vector3d before_n = tick(hand_m);
  ASSERT_NEAR(before_n.x(), kStiffness * 4e-3, 1e-6);

  LocalWorld at_once = *world;
  world->foresee(hand(hand_m), now_ns + rtbus::kNsPerMs, kTick_s);
  for (LocalWorld* each : {world.get(), &at_once}) each->take(wall(0.9, now_ns), now_ns);
  const std::uint64_t began_ns = now_ns;
  double jump_n = 0.0, largest_n = 0.0;
  Vector3d eased_n = before_n, last_n = before_n;
  for (int i = 0; i < 60; ++i) {
    const Vector3d now_n = tick(hand_m);
    largest_n = std::max(largest_n, (now_n - eased_n).norm());
    eased_n = now_n;
    at_once.advance(hand(hand_m), began_ns + static_cast<std::uint64_t>(i + 1) * rtbus::kNsPerMs, kTick_s);
    jump_n = std::max(jump_n, (at_once.impulse_n_s() / kTick_s - last_n).norm());
    last_n = at_once.impulse_n_s() / kTick_s;
  }
  EXPECT_GT(jump_n, 5.0 * kMost_n) << "there is something to ease";
  EXPECT_LE(largest_n, 2.0 * kMost_n) << "what is eased in, and the surface that comes to its place meanwhile";
  EXPECT_EQ(eased_n, last_n) << "nothing of it is left";
}

// On a soft coupling 4 N take longer than a period to be eased in like a rising surface. Those of a cube that broke
// away from under the hand came as a step of 0.7 N.
TEST_F(AnswerChange, ALargeOneOnASoftCouplingIsNoStepAtTheDevice) {
  for (const double force_scale : {0.1, 1.0, 10.0}) {
    const Vector3d hand_m(kRadius_m - 20e-3, 0, 0);
    LocalSpring spring{hand_m, Vector3d::Zero(), 200.0 * force_scale, kDamping * force_scale, force_scale};
    LocalWorld eased, at_once;
    std::uint64_t at_ns = now_ns;
    const auto tick_n = [&](LocalWorld& each) {
      each.advance(spring, at_ns, kTick_s);
      return Vector3d(each.impulse_n_s() / (kTick_s * force_scale));
    };
    eased.reset({kRadius_m, 0, 0}, now_ns);
    eased.take(wall(0.0, at_ns), at_ns);
    Vector3d last_n = Vector3d::Zero(), now_n = last_n, there_n = last_n;
    for (int i = 0; i < 20; ++i, at_ns += rtbus::kNsPerMs) last_n = tick_n(eased);
    ASSERT_NEAR(last_n.x(), 4.0, 1e-6);
    at_once = eased;
    eased.foresee(spring, at_ns, kTick_s);
    for (LocalWorld* each : {&eased, &at_once}) each->take(wall(0.9, at_ns), at_ns);
    for (int i = 0; i < 150; ++i, at_ns += rtbus::kNsPerMs, last_n = now_n) {
      now_n = tick_n(eased);
      EXPECT_LE((now_n - last_n).norm(), 0.1) << "tick " << i << ", scale " << force_scale;
      there_n = tick_n(at_once);
    }
    EXPECT_EQ(now_n, there_n) << "nothing of it is left";
  }
}

TEST_F(AnswerChange, ASmallOneIsAsItWas) {
  const Vector3d hand_m(kRadius_m - 4e-3, 0, 0);
  reset({kRadius_m, 0, 0});
  world->take(wall(0.0, now_ns), now_ns);
  for (int i = 0; i < 20; ++i) tick(hand_m);
  LocalWorld at_once = *world;
  world->foresee(hand(hand_m), now_ns + rtbus::kNsPerMs, kTick_s);
  for (LocalWorld* each : {world.get(), &at_once}) each->take(wall(0.002, now_ns), now_ns);
  const std::uint64_t began_ns = now_ns;
  for (int i = 0; i < 20; ++i) {
    const Vector3d now_n = tick(hand_m);
    at_once.advance(hand(hand_m), began_ns + static_cast<std::uint64_t>(i + 1) * rtbus::kNsPerMs, kTick_s);
    EXPECT_EQ(now_n, at_once.impulse_n_s() / kTick_s);
  }
}

// A world that makes no sense asked for kilonewtons: the next answer takes all but what a period bears back at once.
TEST_F(AnswerChange, IsNotEasedInForEver) {
  const Vector3d hand_m(kRadius_m - 20.0, 0, 0);
  reset({kRadius_m, 0, 0});
  world->take(wall(0.0, now_ns), now_ns);
  for (int i = 0; i < 20; ++i) tick(hand_m);
  ASSERT_GT(tick(hand_m).norm(), 5e3);
  world->foresee(hand(hand_m), now_ns + rtbus::kNsPerMs, kTick_s);
  world->take(wall(0.0, now_ns), now_ns);
  const Vector3d away_m(1.0, 0, 0);
  EXPECT_LE(tick(away_m).norm(), kMost_n / kTick_s * kPhysics_s);
  for (int i = 0; i < 60; ++i) tick(away_m);
  EXPECT_EQ(tick(away_m), Vector3d::Zero());
}

// Told 1 mm before the proxy, at 1 m/s towards it; by now its plane is 49 mm on the other side of it.
TEST_F(AnswerChange, ABodyThatHasGonePastIsNotMet) {
  reset({kRadius_m, 0, 0});
  for (int i = 0; i < 50; ++i) tick(kRadius_m);
  ProxyContacts passing = body(-1e-3, 1.0, 1e-3, now_ns - 50 * rtbus::kNsPerMs);
  world->take(passing, now_ns);
  for (int i = 0; i < 50; ++i) EXPECT_EQ(tick(kRadius_m), 0.0) << i;
}

// What physics itself finds so deep is another matter: the proxy is let out.
TEST_F(AnswerChange, ABodyThatPhysicsHasAroundTheProxyIsMet) {
  reset({kRadius_m, 0, 0});
  ProxyContacts around = body(0.03, 0.0, -0.03, now_ns);
  around.body_inverse_mass_per_kg[0] = 1e-3;
  world->take(around, now_ns);
  for (int i = 0; i < 50; ++i) tick(kRadius_m);
  EXPECT_GT(tick(kRadius_m), 0.1);
}

// The body that is pressed spins; when its contact is told no more the plane does not come round with it.
TEST_F(AnswerChange, WhatFadesOnlyRecedes) {
  reset({kRadius_m, 0, 0});
  ProxyContacts spinning = body(0.0, 0.0, 0.0, now_ns);
  spinning.body_inverse_mass_per_kg[0] = 0.1;
  world->take(spinning, now_ns);
  for (int i = 0; i < 5; ++i) tick(kRadius_m - 2e-3);
  ASSERT_GT(tick(kRadius_m - 2e-3), 0.5);
  spinning = body(0.0, 0.0, 0.0, now_ns);
  spinning.body_inverse_mass_per_kg[0] = 0.1;
  spinning.body_angular_velocity_rad_s[0] = {0, 0, 60};
  spinning.contacts = 0;
  world->take(spinning, now_ns);
  double before_n = tick({kRadius_m - 2e-3, 0.03, 0}).norm();
  for (int i = 0; i < 60; ++i) {
    const double now_n = tick({kRadius_m - 2e-3, 0.03, 0}).x();
    EXPECT_LE(now_n, before_n + 1e-9) << i;
    before_n = now_n;
  }
  EXPECT_NEAR(before_n, 0.0, 1e-9);
}

}  // namespace answer_change_test
