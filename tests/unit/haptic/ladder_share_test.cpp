/// What the safety ladder takes from a force, as the body gets it.
#include "haptic_node/rendering/ladder_share.hpp"

#include <gtest/gtest.h>

#include <algorithm>

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

}  // namespace ladder_share_test
