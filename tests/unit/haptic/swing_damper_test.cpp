#include "haptic_node/rendering/swing_damper.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

namespace swing_damper_test {

using Eigen::Vector3d;
using haptic::SolverContact;
using haptic::SwingDamper;
using haptic::Tuning;

constexpr double kH = 1e-3, kShare = Tuning{}.swing_share;

SolverContact pushed(double normal_n_s) {
  SolverContact out;
  out.normal = {1, 0, 0};
  out.normal_n_s = normal_n_s;
  out.impulse_n_s = normal_n_s * out.normal;
  return out;
}

/// What one contact of 1 N is pushed more after `seconds` in which the surface came at `speed_m_s` [N].
double more_n(SwingDamper& damper, double speed_m_s, double seconds, bool rests = true) {
  const SolverContact row = pushed(1.0 * kH);
  for (int i = 0; i < std::lround(seconds / kH); ++i) {
    damper.see(row, {speed_m_s, 0, 0});
    damper.follow(rests);
  }
  return damper.more_n_s(row).x() / kH;
}

TEST(SwingDamper, PushesMoreWhatComesAndLessWhatGoesByItsShareAtMost) {
  SwingDamper damper{Tuning{}};
  EXPECT_EQ(more_n(damper, 0.0, 0.1), 0.0) << "nothing moves";
  EXPECT_NEAR(more_n(damper, 0.5, 0.2), kShare, 1e-6);
  EXPECT_NEAR(more_n(damper, -0.5, 0.2), -kShare, 1e-6);
  EXPECT_NEAR(more_n(damper, 0.5e-3, 0.2), 0.5 * kShare, 1e-6) << "slower, less";
}

TEST(SwingDamper, ChangesNoForceAtOnce) {
  SwingDamper damper{Tuning{}};
  (void)more_n(damper, -1.0, 1.0);
  EXPECT_NEAR(more_n(damper, 1.0, kH), -kShare + 2.0 * kShare * -std::expm1(-1.0 / 3.0), 1e-9);
}

TEST(SwingDamper, LeavesAHandThatMovesAlone) {
  SwingDamper damper{Tuning{}};
  EXPECT_EQ(more_n(damper, 0.5, 0.2, false), 0.0);
  (void)more_n(damper, 0.5, 0.2);
  EXPECT_NEAR(more_n(damper, 0.5, 0.2, false), 0.0, 1e-8) << "and lets go of one that begins to";
}

TEST(SwingDamper, ForgetsAStepThatMadeNoSense) {
  SwingDamper damper{Tuning{}};
  for (const double wild_m_s : {std::nan(""), -HUGE_VAL}) {
    (void)more_n(damper, wild_m_s, kH);
    EXPECT_NEAR(more_n(damper, 0.5, 0.2), kShare, 1e-6);
  }
}

TEST(SwingDamper, CountsWhatTheHandBearsOnAWallBeside) {
  SwingDamper damper{Tuning{}};
  const SolverContact row = pushed(1.0 * kH);
  for (int i = 0; i < 200; ++i) {
    damper.see(row, {0.5, 0, 0});
    damper.see(pushed(3.0 * kH));
    damper.follow(true);
  }
  EXPECT_NEAR(damper.more_n_s(row).x() / kH, kShare / 4.0, 1e-6);
}

TEST(SwingDamper, TakesEnergyOutOfASwingUpToTheFastestThatABoxHas) {
  constexpr double kLeans_n = 1.0, kSwings_n = 0.2;
  for (const double hz : {1.0, 3.0, 10.0, 35.0, 1.0 / (14.0 * kH)}) {
    SwingDamper damper{Tuning{}};
    double taken = 0.0;  // of the surface, N·m for each metre per second
    for (int i = 0; i < 4000; ++i) {
      const double phase = 2.0 * std::numbers::pi * hz * kH * i, speed_m_s = 0.05 * std::cos(phase);
      const SolverContact row = pushed((kLeans_n - kSwings_n * std::sin(phase)) * kH);
      taken += speed_m_s * damper.more_n_s(row).x();
      damper.see(row, {speed_m_s, 0, 0});
      damper.follow(true);
    }
    EXPECT_GT(taken, 0.0) << hz << " Hz";
  }
}

}  // namespace swing_damper_test
