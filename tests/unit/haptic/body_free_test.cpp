/// A free body on its way from the instant of an answer to now, against closed forms.
#include "haptic_node/rendering/body_free.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <cstdint>
#include <utility>

#include <Eigen/Geometry>

#include "tests/unit/haptic/falling_box.hpp"

namespace body_free_test {

using haptic::SupportPool;
using tests::FallingBox;

constexpr std::uint64_t kSample_ns = 1'000'000'000;

/// What the body makes of an answer that is `age_s` old. @returns its turn since.
/// @param pushed By a hand, evenly over that time.
Eigen::Quaterniond replay(const rtbus::ProxyContacts& answer, double age_s, int parts, haptic::BodyMotion& motion,
                          const haptic::Impulse& pushed = {}) {
  constexpr double kTick_s = 1e-3;
  const haptic::KnownShapes shapes(FallingBox::shapes());
  const haptic::Tuning tuning;
  const haptic::OtherHands nobody(0);
  haptic::ImpulseHistory history;
  if (!pushed.is_zero()) {
    history.add(kSample_ns, kSample_ns + static_cast<std::uint64_t>(age_s * 1e9), 0, haptic::Impulse{}, pushed);
  }
  std::array<haptic::SolverContact, SupportPool::kSupports> scratch;
  const haptic::SinceAnswer since{kSample_ns,
                                  kSample_ns + static_cast<std::uint64_t>(age_s * 1e9),
                                  parts,
                                  kTick_s,
                                  history,
                                  pushed,
                                  {nobody, answer, 0},
                                  scratch.data(),
                                  tuning,
                                  shapes};
  SupportPool supports, before;
  supports.spare = SupportPool::kSupports - 1;
  haptic::FreeBody body;
  body.take({answer, 0, true, 1, 0.0}, since, 0.0, supports, before, motion);
  std::array<haptic::FreeBody::Replayed, 1> alone{{{&body, &motion, &since}}};
  haptic::FreeBody::replay(alone, supports);
  return alone[0].turned;
}

/// @returns how far it has turned, towards +x.
double falls(double past_rad, double age_s, int parts, haptic::BodyMotion& motion, const haptic::Impulse& pushed = {}) {
  return -2.0 * replay(FallingBox::answer(past_rad, kSample_ns), age_s, parts, motion, pushed).z();
}

/// The box stands on a face, at rest, and the floor bears its weight at `x_m` beside its centre: something holds
/// it that is not told.
rtbus::ProxyContacts stands_on_a_face(double x_m) {
  rtbus::ProxyContacts answer = FallingBox::answer(-FallingBox::kBalanced_rad, kSample_ns);
  answer.body_external_torque_n_m[0] = {};
  answer.support_point_m[0][0] += x_m - FallingBox::kHalf_m.x();
  return answer;
}

/// Its weight turns it the faster, the farther it has turned. A replay whose weight pushed where it did at first made
/// a box under a hand swing for ever.
TEST(FreeBody, FallsOverItsEdgeAsFastAsAPendulum) {
  constexpr double kAge_s = 0.1;
  const double grown = FallingBox::kLambda_per_s * kAge_s;
  for (const int parts : {8, 15, 100}) {
    for (const double past_rad : {0.01, -0.01, 0.02}) {
      haptic::BodyMotion motion;
      const double turned_rad = falls(past_rad, kAge_s, parts, motion);
      EXPECT_NEAR(turned_rad / (past_rad * (std::cosh(grown) - 1.0)), 1.0, 0.03)
          << parts << " parts, " << past_rad << " rad";
      EXPECT_NEAR(-motion.angular_velocity_rad_s.z() / (past_rad * FallingBox::kLambda_per_s * std::sinh(grown)), 1.0,
                  0.03)
          << parts << " parts, " << past_rad << " rad";
    }
  }
}

TEST(FreeBody, StaysOnItsEdge) {
  haptic::BodyMotion motion;
  (void)falls(0.02, 0.1, 8, motion);
  EXPECT_LT((motion.centre_m - motion.q_WB * FallingBox::centre_B_m() - FallingBox::kEdge_m).norm(), 30e-6);
}

// A hand that turns it by more than half a radian would not touch it there any more: something holds it from that. It
// stands then, on the friction of its edge, and does not lie where it would have fallen.
TEST(FreeBody, WhatIsHeldFromTurningStands) {
  constexpr double kPushed_n_s = 0.1;
  const haptic::Impulse pushed{{kPushed_n_s, 0, 0}, {0, 0, -0.04 * kPushed_n_s}};
  const Eigen::Vector3d told_m = rtbus::vector_of(FallingBox::answer(0.02, 1).body_centre_m[0]);
  for (const int parts : {8, 13}) {
    haptic::BodyMotion motion;
    EXPECT_EQ(falls(0.02, 0.1, parts, motion, pushed), 0.0);
    EXPECT_LT((motion.centre_m - told_m).norm(), 1e-3) << parts << " parts";
    EXPECT_LT(motion.velocity_m_s.norm(), 0.01) << parts << " parts";
  }
}

// Its corners bear what they bore, and give way to nothing. When each was taken to bear a quarter, it tilted in each
// answer.
TEST(FreeBody, WhatRestsOnOneSideDoesNotTilt) {
  for (const double x_m : {0.0, 0.006, -0.009}) {
    haptic::BodyMotion motion;
    EXPECT_LT(replay(stands_on_a_face(x_m), 0.1, 8, motion).vec().norm(), 1e-7) << x_m;
    EXPECT_LT(motion.velocity_m_s.norm(), 1e-6) << x_m;
  }
}

// Which corner of a hull comes first depends on a nanometre.
TEST(FreeBody, ACornerGoesOnWithWhatItBore) {
  using Eigen::Vector3d;
  rtbus::shapes::Hull hull;
  for (const double x : {-1.0, 1.0}) {
    for (const double y : {-1.0, 1.0}) {
      for (const double z : {-1.0, 1.0})
        hull.points_m.emplace_back(Vector3d(x, y, z).cwiseProduct(FallingBox::kHalf_m));
    }
  }
  auto known = FallingBox::shapes();
  known[0].shape = hull;
  const haptic::KnownShapes shapes(known);
  const haptic::Tuning tuning;
  const haptic::OtherHands nobody(0);
  const haptic::ImpulseHistory history;
  const haptic::Impulse nothing;
  rtbus::ProxyContacts answer = stands_on_a_face(0.0);
  const haptic::SinceAnswer since{kSample_ns, kSample_ns,          1,       1e-3,   history,
                                  nothing,    {nobody, answer, 0}, nullptr, tuning, shapes};
  haptic::FreeBody body;
  haptic::BodyMotion motion;
  const auto take = [&](const Eigen::Quaterniond& turn, SupportPool& supports, const SupportPool& old) {
    supports.spare = SupportPool::kSupports - 1;
    answer.body_orientation_wxyz[0] = {turn.w(), turn.x(), turn.y(), turn.z()};
    body.take({answer, 0, true, 1, 0.0}, since, 0.0, supports, old, motion);
    ASSERT_EQ(supports.count, 4U);
  };
  const Eigen::Quaterniond about_x(Eigen::AngleAxisd(1e-9, Vector3d::UnitX()));
  const Eigen::Quaterniond about_z(Eigen::AngleAxisd(1e-9, Vector3d::UnitZ()));
  SupportPool none, before, after;
  take(about_x, before, none);
  for (std::size_t i = 0; i < 4; ++i) before.rows[i].impulse_n_s = {0.0, 1.0 + static_cast<double>(i), 0.0};
  take(about_z, after, before);
  for (std::size_t i = 0; i < 4; ++i) {
    const auto was = static_cast<std::size_t>(after.rows[i].impulse_n_s.y() - 1.0);
    ASSERT_LT(was, 4U);
    EXPECT_LT((after.rows[i].from_centre_m - before.rows[was].from_centre_m).norm(), 1e-6) << i;
  }
}

/// A body on an edge, whose ends an answer tells in another order than the one before.
TEST(FreeBody, GoesOnWithWhatTheNearestSupportBore) {
  constexpr std::uint64_t kNow_ns = 1'000'000'000;
  rtbus::ProxyContacts answer = FallingBox::answer(0.0, kNow_ns);
  answer.supports = 2;
  answer.support_normal[1] = answer.support_normal[0];
  answer.support_points = {2, 2};
  answer.support_point_m[0][2] = -FallingBox::kHalf_m.z();
  answer.support_point_m[1] = answer.support_point_m[0];
  answer.support_point_m[1][2] = FallingBox::kHalf_m.z();
  const haptic::KnownShapes unknown;
  const haptic::Tuning tuning;
  const haptic::OtherHands nobody(0);
  const haptic::ImpulseHistory history;
  const haptic::Impulse nothing;
  const haptic::SinceAnswer since{kNow_ns, kNow_ns, 1,      1e-3, history, nothing, {nobody, answer, 0},
                                  nullptr, tuning,  unknown};
  haptic::FreeBody body;
  haptic::BodyMotion motion;
  SupportPool before, after;
  body.take({answer, 0, true, 2, 0.0}, since, 0.0, before, after, motion);
  ASSERT_EQ(before.count, 2U);
  before.rows[0].impulse_n_s = {0.0, 1.0, 0.0};
  before.rows[1].impulse_n_s = {0.0, 2.0, 0.0};
  std::swap(answer.support_point_m[0], answer.support_point_m[1]);
  body.take({answer, 0, true, 2, 0.0}, since, 0.0, after, before, motion);
  ASSERT_EQ(after.count, 2U);
  EXPECT_EQ(after.rows[0].impulse_n_s.y(), 2.0);
  EXPECT_EQ(after.rows[1].impulse_n_s.y(), 1.0);
}

}  // namespace body_free_test
