/// What the safety ladder takes from a force, as the body gets it.
#include "haptic_node/rendering/ladder_share.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "haptic_node/rendering/local_world.hpp"
#include "rtbus/clock.hpp"
#include "tests/unit/haptic/held_world.hpp"

namespace ladder_share_test {

using Eigen::Vector3d;
using haptic::Impulse;
using haptic::LadderShare;

Impulse along_x(double size) { return {{size, 0, 0}, {0, 0, 0.01 * size}}; }

TEST(LadderShare, GivesInAllWhatThereWas) {
  LadderShare share;
  Impulse given, was;
  for (const double each : {1.0, 1.0, 3.0, -2.0, -2.5, 0.0, 0.7, 0.7, 0.7, 0.0, 0.0}) {
    given += share.due();
    share.step();
    share.add(along_x(0.4 * each));
    share.add(along_x(0.6 * each));
    was += along_x(each);
  }
  for (int i = 0; i < 3; ++i) {
    given += share.due();
    share.step();
  }
  EXPECT_NEAR(given.linear_n_s.x(), was.linear_n_s.x(), 1e-12);
  EXPECT_NEAR(given.angular_n_m_s.z(), was.angular_n_m_s.z(), 1e-12);
}

TEST(LadderShare, ExpectsWhatLastsAndNotWhatHappensOnce) {
  LadderShare share;
  share.add(along_x(1.0));
  EXPECT_DOUBLE_EQ(share.due().linear_n_s.x(), 1.0) << "once";
  share.step();
  share.add(along_x(1.0));
  EXPECT_DOUBLE_EQ(share.due().linear_n_s.x(), 2.0) << "that of the last step, and that of the next one";
  share.step();
  share.add(along_x(1.0));
  EXPECT_DOUBLE_EQ(share.due().linear_n_s.x(), 1.0) << "as it was expected";
  share.step();
  share.add(along_x(1.5));
  EXPECT_DOUBLE_EQ(share.due().linear_n_s.x(), 1.5) << "and half of it that was not";
  share.replayed();
  EXPECT_DOUBLE_EQ(share.due().linear_n_s.x(), 1.0) << "the body has had that, so this is the next step's";
}

// Seed 2000458596. A hand presses with 5 N against a body of 0.1 kg, and the ladder leaves 0.3 N, which the friction of
// the floor bears, up to 0.5 N. With each answer the body got 4.7 N for a tick, and went
// 0.7 mm.
TEST(LadderShare, ABodyIsNotPushedByWhatTheLadderTakes) {
  constexpr double kStiffness = 500.0, kDepth_m = 0.01, kLeft_n = 0.3, kWeight_n = 1.0, kFriction = 0.5;
  tests::HeldWorld hand(kStiffness, 0.5);
  const auto answer = [&] {
    rtbus::ProxyContacts out;
    out.device_sequence = 1;
    out.device_time_ns = hand.now_ns - 2 * rtbus::kNsPerMs;
    out.step_s = 0.01;
    out.contacts = out.bodies = out.supports = 1;
    out.contact_normal[0] = {1, 0, 0};
    out.body_kind[0] = 2;
    out.body_inverse_mass_per_kg[0] = 10.0;
    out.body_centre_m[0] = {-0.01, 0, 0};
    out.support_normal[0] = {0, 1, 0};
    out.support_point_m[0] = {-0.01, -0.01, 0};
    out.support_force_n[0] = kWeight_n;
    out.support_friction[0] = kFriction;
    out.support_points[0] = 4;
    out.body_friction_bound_n[0] = kFriction * kWeight_n;
    return out;
  };
  hand.reset(Vector3d::Zero());
  double farthest_m = 0.0;
  for (int i = 0; i < 300; ++i) {
    if (i % 10 == 0) hand.world->take(answer(), hand.now_ns);
    const Vector3d force_n = hand.tick(Vector3d(-kDepth_m, 0, 0));
    hand.world->felt(-Vector3d(std::min(force_n.x(), kLeft_n), 0, 0) * tests::HeldWorld::kTick_s);
    if (i >= 100) farthest_m = std::max(farthest_m, hand.world->position_m().norm());
  }
  EXPECT_LT(farthest_m, 20e-6);
}

// Seed 2006011757. A body is pressed to the tip by 2 N, and an answer has it 3 mm away from it. The hand's force fades
// meanwhile, and holds the body up, which nobody touches: in the world it comes back later than under the 2 N alone.
TEST(LadderShare, ABodyThatHasComeOffGetsWhatFades) {
  constexpr double kStiffness = 500.0, kDamping = 50.0, kPull_n = 2.0, kBody_kg = 0.1, kAway_m = 3e-3, kRadius_m = 5e-3;
  tests::HeldWorld hand(kStiffness, kDamping);
  double surface_m = 0.0, velocity_m_s = 0.0;
  const auto answer = [&](std::uint64_t sample_ns) {
    rtbus::ProxyContacts out;
    out.device_sequence = 1;
    out.device_time_ns = sample_ns;
    out.step_s = 0.02;
    out.proxy_radius_m = kRadius_m;
    out.contacts = out.bodies = 1;
    out.contact_normal[0] = {1, 0, 0};
    out.contact_gap_m[0] = -surface_m;
    out.contact_point_m[0] = {surface_m, 0, 0};
    out.body_kind[0] = 2;
    out.body_inverse_mass_per_kg[0] = 1.0 / kBody_kg;
    out.body_centre_m[0] = {surface_m - 0.01, 0, 0};
    out.body_velocity_m_s[0] = {velocity_m_s, 0, 0};
    out.body_external_force_n[0] = {kPull_n, 0, 0};
    return out;
  };
  const Vector3d hand_m(kRadius_m - kPull_n / kStiffness, 0, 0);
  const auto tick = [&](tests::HeldWorld& each) {
    const Vector3d force_n = each.tick(hand_m);
    each.world->felt(-force_n * tests::HeldWorld::kTick_s);
    return force_n.x();
  };
  hand.reset({kRadius_m, 0, 0});
  hand.world->take(answer(hand.now_ns), hand.now_ns);
  for (int i = 0; i < 20; ++i) ASSERT_NEAR(tick(hand), kPull_n, 1e-6);
  surface_m = -kAway_m;
  hand.world->foresee({hand_m, Vector3d::Zero(), kStiffness, kDamping}, hand.now_ns + rtbus::kNsPerMs,
                      tests::HeldWorld::kTick_s);
  hand.world->take(answer(hand.now_ns), hand.now_ns);
  for (int i = 0; i < 15; ++i) {
    const double force_n = tick(hand);
    ASSERT_GT(force_n, 0.3) << "it fades";
    velocity_m_s += tests::HeldWorld::kTick_s * (kPull_n - force_n) / kBody_kg;
    surface_m += tests::HeldWorld::kTick_s * velocity_m_s;
  }
  ASSERT_LT(surface_m, -0.1 * kAway_m) << "nothing touches it yet";
  tests::HeldWorld told(kStiffness, kDamping, *hand.world);
  told.now_ns = hand.now_ns;
  told.world->take(answer(told.now_ns), told.now_ns);
  const auto ticks_away = [&](tests::HeldWorld& each) {
    int ticks = 0;
    while (ticks < 100 && tick(each) < 1.5 * kPull_n) ++ticks;
    return ticks;
  };
  const int ticks = ticks_away(hand), right = ticks_away(told);
  EXPECT_GT(right, 3);
  EXPECT_LT(right, 100) << "it comes back";
  EXPECT_NEAR(ticks, right, 3) << "when an answer with the world's own place has it back. Its plane still recedes.";
}

}  // namespace ladder_share_test
