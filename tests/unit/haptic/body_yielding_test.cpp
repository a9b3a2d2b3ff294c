/// Soft bodies in the world of local_contact: a patch behind a compliance, put right by answers.
#include "haptic_node/rendering/body_yielding.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "haptic_node/rendering/local_world.hpp"
#include "rtbus/clock.hpp"
#include "tests/unit/haptic/held_world.hpp"

namespace {

using haptic::LocalWorld;
using haptic::YieldingBody;
using rtbus::ProxyContacts;

constexpr double kTickS = 1e-3, kHandN_m = 300.0, kHandNs_m = 0.5;
constexpr double kPhysicsS = 0.05;
constexpr double kCompliance = 0.01;
/// A soft body that fills x < 0 and has no rigid one beside it; its surface is `gap_m` before the proxy at `proxy_x_m`.
ProxyContacts soft(double proxy_x_m, double gap_m, std::uint64_t sample_ns, double compliance = kCompliance) {
  ProxyContacts out;
  out.device_sequence = 1;
  out.device_time_ns = sample_ns;
  out.step_s = kPhysicsS;
  out.contacts = out.bodies = 1;
  out.proxy_position_m = {proxy_x_m, 0, 0};
  out.contact_normal[0] = {1, 0, 0};
  out.contact_gap_m[0] = gap_m;
  out.contact_compliance_m_per_n[0] = compliance;
  out.body_kind[0] = YieldingBody::kKind;
  out.body_index[0] = 7;
  out.body_inverse_mass_per_kg[0] = 500.0;
  return out;
}

struct YieldingBodyTest : testing::Test, tests::HeldWorld {
  YieldingBodyTest() : HeldWorld(kHandN_m, kHandNs_m) {}
};

TEST_F(YieldingBodyTest, IsASpringInSeriesWithTheHands) {
  world->reset({0.002, 0, 0});
  world->take(soft(0.002, 0.002, now_ns), now_ns);
  double force_n = 0.0;
  for (int i = 0; i <= 100; ++i) force_n = tick(0.002 - 1e-4 * i, -0.1);
  for (int i = 0; i < 50; ++i) force_n = tick(-0.008);
  const double series = 1.0 / (1.0 / kHandN_m + haptic::Tuning{}.softer * kCompliance);
  EXPECT_NEAR(force_n, series * 0.008, 1e-3 * force_n);
  ASSERT_EQ(world->hand_impulses().entries().size(), 1U);
  EXPECT_EQ(world->hand_impulses().entries()[0].body, 7U);
  EXPECT_NEAR(world->hand_impulses().entries()[0].impulse_n_s.x(), -force_n * kTickS, 1e-12);
  for (int i = 0; i < 100; ++i) force_n = tick(0.001);
  EXPECT_EQ(force_n, 0.0);
}

/// A body of physics that gives way by `truth` m/N, told of a period late; the hand holds still. The force at the end.
double settle(YieldingBodyTest& test, double truth, double told) {
  constexpr double kHand = -0.008;
  test.world->reset({0.0, 0, 0});
  double force_n = 0.0, proxy_m = 0.0, sampled_proxy_m = 0.0, sampled_force_n = 0.0;
  std::uint64_t sample_ns = test.now_ns;
  test.world->take(soft(0.0, 0.0, sample_ns, told), test.now_ns);
  for (int step = 0; step < 60; ++step) {
    for (int i = 0; i < 50; ++i) force_n = test.tick(kHand);
    proxy_m = test.world->position_m().x();
    // The answer to the sample of a period ago.
    if (step > 0) {
      test.world->take(soft(sampled_proxy_m, sampled_proxy_m + truth * sampled_force_n, sample_ns, told), test.now_ns);
    }
    sampled_proxy_m = proxy_m;
    sampled_force_n = force_n;
    sample_ns = test.now_ns;
  }
  return force_n;
}

TEST_F(YieldingBodyTest, AWrongComplianceIsPutRightByAnswers) {
  for (const double told : {0.003, 0.01, 0.03}) {
    const double due_n = 0.008 / (1.0 / kHandN_m + 0.01);
    EXPECT_NEAR(settle(*this, 0.01, told), due_n, 0.02 * due_n) << told;
  }
}

TEST_F(YieldingBodyTest, AnAnswerThatAgreesChangesNoForceAndAnotherOneDoesNotJump) {
  world->reset({0.0, 0, 0});
  world->take(soft(0.0, 0.0, now_ns), now_ns);
  double before_n = 0.0;
  for (int i = 0; i < 100; ++i) before_n = tick(-0.006);
  // Where the local world had it, and then 1 mm farther out and tilted.
  const double proxy_m = world->position_m().x();
  world->take(soft(proxy_m, 0.0, now_ns), now_ns);
  EXPECT_NEAR(tick(-0.006), before_n, 1e-3 * before_n);
  ProxyContacts tilted = soft(proxy_m, -1e-3, now_ns);
  tilted.contact_normal[0] = {std::cos(0.1), std::sin(0.1), 0};
  world->take(tilted, now_ns);
  double largest_step_n = 0.0, force_n = before_n;
  for (int i = 0; i < 200; ++i) {
    const double next_n = tick(-0.006);
    largest_step_n = std::max(largest_step_n, std::abs(next_n - force_n));
    force_n = next_n;
  }
  EXPECT_GT(force_n, before_n + 0.01);
  EXPECT_LT(largest_step_n, 0.25 * (force_n - before_n));
}

TEST_F(YieldingBodyTest, MakesNoEnergyPressedAndReleased) {
  world->reset({0.0, 0, 0});
  world->take(soft(0.0, 0.0, now_ns), now_ns);
  // Half a tick before and half a tick after it: what the hold of a tick gives is the loop's, and the passivity
  // observer's.
  const auto way_m = [](int i) { return -0.004 * (1.0 - std::cos(2.0 * M_PI * i / 400.0)); };
  double put_in_j = 0.0, most_j = 0.0;
  for (int i = 0; i < 400; ++i) {
    const double moved_m = 0.5 * (way_m(i + 1) - way_m(i - 1));
    put_in_j -= tick(way_m(i), moved_m / kTickS) * moved_m;
    most_j = std::max(most_j, put_in_j);
  }
  EXPECT_GT(most_j, 1e-4);
  EXPECT_GE(put_in_j, 0.0);
}

TEST_F(YieldingBodyTest, ABodyThatIsGoneRecedes) {
  world->reset({0.0, 0, 0});
  world->take(soft(0.0, 0.0, now_ns), now_ns);
  double force_n = 0.0;
  for (int i = 0; i < 100; ++i) force_n = tick(-0.006);
  ASSERT_GT(force_n, 0.1);
  ProxyContacts nothing;
  nothing.device_time_ns = now_ns;
  nothing.step_s = kPhysicsS;
  world->take(nothing, now_ns);
  double before_n = force_n;
  for (int i = 0; i < 300; ++i) {
    force_n = tick(-0.006);
    EXPECT_LE(force_n, before_n + 1e-9);
    EXPECT_GT(force_n, before_n - 0.1);
    before_n = force_n;
  }
  EXPECT_EQ(force_n, 0.0);
}

}  // namespace
