#include "haptic_node/passivity.hpp"

#include <gtest/gtest.h>

#include <cmath>

namespace {

using haptic::Passivity;
using haptic::PassivityConfig;

/// A tip that moves by `moved_m` under `force_n`, from wherever it is.
void move(Passivity& passivity, Eigen::Vector3d& tip_m, const Eigen::Vector3d& force_n,
          const Eigen::Vector3d& moved_m) {
  if (tip_m.isZero(0.0)) passivity.observe(Eigen::Vector3d::Zero(), tip_m, 0.0);
  tip_m += moved_m;
  passivity.observe(force_n, tip_m, 0.001);
}

PassivityConfig strict() {
  PassivityConfig config;
  config.energy_cap_j = 0.01;
  config.damping_max_n_s_per_m = 5.0;
  return config;
}

TEST(Passivity, CountsTheWorkOfTheHand) {
  Passivity passivity(strict());
  Eigen::Vector3d tip = Eigen::Vector3d::Zero();
  // A force of −2 N against a hand that moves +1 mm: the hand does 2 mJ of work on us.
  move(passivity, tip, {-2.0, 0.0, 0.0}, {0.001, 0.0, 0.0});
  EXPECT_NEAR(passivity.absorbed_j(), 0.002, 1e-15);
  move(passivity, tip, {-2.0, 0.0, 0.0}, {-0.001, 0.0, 0.0});
  EXPECT_NEAR(passivity.absorbed_j(), 0.0, 1e-15);
}

TEST(Passivity, CapsWhatMayBeGivenBack) {
  Passivity passivity(strict());
  Eigen::Vector3d tip = Eigen::Vector3d::Zero();
  for (int k = 0; k < 100; ++k) move(passivity, tip, {-2.0, 0.0, 0.0}, {0.001, 0.0, 0.0});
  EXPECT_NEAR(passivity.absorbed_j(), 0.2, 1e-12);
  EXPECT_DOUBLE_EQ(passivity.observed_j(), 0.01);
}

TEST(Passivity, LeavesAForceAloneWhileTheEnergyIsPositive) {
  Passivity passivity(strict());
  Eigen::Vector3d tip = Eigen::Vector3d::Zero();
  move(passivity, tip, {-2.0, 0.0, 0.0}, {0.001, 0.0, 0.0});
  bool acted = true;
  EXPECT_EQ(passivity.control({1.0, 2.0, 3.0}, {0.1, 0.0, 0.0}, 0.001, acted), Eigen::Vector3d(1.0, 2.0, 3.0));
  EXPECT_FALSE(acted);
}

TEST(Passivity, DampsUntilTheDeficitIsPaid) {
  Passivity passivity(strict());
  Eigen::Vector3d tip = Eigen::Vector3d::Zero();
  move(passivity, tip, {1.0, 0.0, 0.0}, {0.0001, 0.0, 0.0});  // we pushed the hand along: −0.1 mJ
  ASSERT_LT(passivity.observed_j(), 0.0);
  bool acted = false;
  const Eigen::Vector3d velocity(0.5, 0.0, 0.0);
  const Eigen::Vector3d force = passivity.control(Eigen::Vector3d::Zero(), velocity, 0.001, acted);
  EXPECT_TRUE(acted);
  // α = E/(T v²) = 1e-4/(1e-3·0.25) = 0.4 N·s/m → −0.2 N along the motion.
  EXPECT_NEAR(force.x(), -0.2, 1e-12);
  move(passivity, tip, force, velocity * 0.001);
  EXPECT_NEAR(passivity.observed_j(), 0.0, 1e-12);
}

TEST(Passivity, NeverDampsHarderThanItsCeiling) {
  Passivity passivity(strict());
  Eigen::Vector3d tip = Eigen::Vector3d::Zero();
  move(passivity, tip, {10.0, 0.0, 0.0}, {0.01, 0.0, 0.0});
  bool acted = false;
  const Eigen::Vector3d force = passivity.control(Eigen::Vector3d::Zero(), {0.01, 0.0, 0.0}, 0.001, acted);
  EXPECT_NEAR(force.x(), -5.0 * 0.01, 1e-12);
}

TEST(Passivity, CreditsWhatTheDeviceBurnsByItself) {
  PassivityConfig config = strict();
  config.coulomb_friction_n = 0.05;
  config.viscous_damping_n_s_per_m = 0.04;
  Passivity passivity(config);
  Eigen::Vector3d tip = Eigen::Vector3d::Zero();
  move(passivity, tip, Eigen::Vector3d::Zero(), {0.0003, 0.0, 0.0});
  EXPECT_NEAR(passivity.observed_j(), 0.0003 * (0.04 * 0.3 + 0.05), 1e-15);
  EXPECT_EQ(passivity.absorbed_j(), 0.0);
}

TEST(Passivity, EarnsNothingFromAnEncoderThatToggles) {
  PassivityConfig config = strict();
  config.coulomb_friction_n = 0.05;
  config.viscous_damping_n_s_per_m = 0.04;
  config.position_quantum_m = 23e-6;
  Passivity passivity(config);
  for (int k = 0; k < 12'000; ++k)
    passivity.observe(Eigen::Vector3d::Zero(), {k % 2 == 0 ? 0.0 : 23e-6, 0.0, 0.0}, 0.001);
  EXPECT_EQ(passivity.observed_j(), 0.0);
  // A real way does: 10 mm at 0.1 m/s burn nearly f_c·s + b·v·s.
  for (int k = 0; k <= 100; ++k) passivity.observe(Eigen::Vector3d::Zero(), {1e-4 * k, 0.0, 0.0}, 0.001);
  EXPECT_GT(passivity.observed_j(), 0.6 * (0.05 + 0.04 * 0.1) * 0.01);
  EXPECT_LT(passivity.observed_j(), (0.05 + 0.04 * 0.1) * 0.01);
}

TEST(Passivity, BoundsItsDeficit) {
  Passivity passivity(strict());
  Eigen::Vector3d tip = Eigen::Vector3d::Zero();
  for (int k = 0; k < 100; ++k) move(passivity, tip, {2.0, 0.0, 0.0}, {0.001, 0.0, 0.0});
  EXPECT_DOUBLE_EQ(passivity.observed_j(), -0.01);
  EXPECT_NEAR(passivity.absorbed_j(), -0.2, 1e-12);
}

// The reason it exists: a sampled spring stiffer than its own damping can pay for. Frictionless mass of 41 g on a wall
// of 5000 N/m at 1 kHz: without control each bounce comes back faster than it went in.
TEST(Passivity, KeepsAnActiveWallFromFeedingTheBounce) {
  const auto exit_speed = [](bool controlled) {
    PassivityConfig config;
    config.energy_cap_j = 1.0;
    config.damping_max_n_s_per_m = 4.1;
    Passivity passivity(config);
    double x = 0.0;
    double v = -0.1;
    double force = 0.0;
    for (int tick = 0; tick < 200 && !(x > 0.0 && v > 0.0); ++tick) {
      for (int sub = 0; sub < 10; ++sub) {
        v += force / 0.041 * 1e-4;
        x += v * 1e-4;
      }
      passivity.observe({0.0, force, 0.0}, {0.0, x, 0.0}, 1e-3);
      const Eigen::Vector3d wish(0.0, x < 0.0 ? -5000.0 * x : 0.0, 0.0);
      bool acted = false;
      force = controlled ? passivity.control(wish, {0.0, v, 0.0}, 1e-3, acted).y() : wish.y();
    }
    return v;
  };
  EXPECT_GT(exit_speed(false), 0.12);
  EXPECT_LT(exit_speed(true), exit_speed(false) - 0.02);
}

TEST(Passivity, OnlyObservesWhenControlIsOff) {
  PassivityConfig config = strict();
  config.control = false;
  Passivity passivity(config);
  Eigen::Vector3d tip = Eigen::Vector3d::Zero();
  move(passivity, tip, {2.0, 0.0, 0.0}, {0.001, 0.0, 0.0});
  ASSERT_LT(passivity.observed_j(), 0.0) << "there is a deficit";
  bool acted = true;
  EXPECT_EQ(passivity.control({1.0, 0.0, 0.0}, {0.1, 0.0, 0.0}, 0.001, acted), Eigen::Vector3d(1.0, 0.0, 0.0));
  EXPECT_FALSE(acted);
}

PassivityConfig sprung() {
  PassivityConfig config = strict();
  config.stiffness_n_per_m = 1000.0;
  config.counts_world_work = true;
  config.allowance_n_s_per_m = 4.0;
  config.noise_speed_m_s = 0.03;
  return config;
}

TEST(Passivity, ShortensAForceToItsEnergy) {
  Passivity passivity(sprung());
  bool acted = false;
  // Nothing in the observed energy: 0.25 mJ are free, √(2·1000·0.25e-3) = 0.707 N.
  const Eigen::Vector3d force = passivity.limit({0.0, 5.0, 0.0}, 0.0, Eigen::Vector3d::Zero(), acted);
  EXPECT_TRUE(acted);
  EXPECT_NEAR(force.y(), std::sqrt(0.5), 1e-12);
  EXPECT_EQ(force.x(), 0.0);
}

TEST(Passivity, LeavesAForceThatTheHandHasPaidFor) {
  Passivity passivity(sprung());
  Eigen::Vector3d tip(0.0, 0.1, 0.0);
  passivity.observe(Eigen::Vector3d::Zero(), tip, 0.0);
  // Into a spring of 1000 N/m by 2 mm, in steps of 1 um: 2 mJ, and 2 N at the end.
  for (int k = 1; k <= 2000; ++k) {
    tip.y() -= 1e-6;
    passivity.observe({0.0, 1000.0 * 1e-6 * (k - 0.5), 0.0}, tip, 0.001);
  }
  bool acted = true;
  EXPECT_EQ(passivity.limit({0.0, 2.0, 0.0}, 0.0, Eigen::Vector3d::Zero(), acted).y(), 2.0);
  EXPECT_FALSE(acted);
}

TEST(Passivity, LetsAForceAgainstTheMotionTakeEnergyIn) {
  Passivity passivity(sprung());
  bool acted = false;
  const Eigen::Vector3d into_it = passivity.limit({0.0, 5.0, 0.0}, 0.0, {0.0, -0.53, 0.0}, acted);
  EXPECT_NEAR(into_it.y(), std::sqrt(0.5) + 4.0 * 0.5, 1e-9);
  const Eigen::Vector3d along = passivity.limit({0.0, 5.0, 0.0}, 0.0, {0.0, 0.53, 0.0}, acted);
  EXPECT_NEAR(along.y(), std::sqrt(0.5), 1e-9);
  const Eigen::Vector3d noise = passivity.limit({0.0, 5.0, 0.0}, 0.0, {0.0, -0.02, 0.0}, acted);
  EXPECT_NEAR(noise.y(), std::sqrt(0.5), 1e-9);
}

TEST(Passivity, SpendsWhatTheWorldGives) {
  Passivity passivity(sprung());
  passivity.give(2e-3);
  EXPECT_DOUBLE_EQ(passivity.observed_j(), 2e-3);
  bool acted = false;
  EXPECT_EQ(passivity.limit({0.0, 2.0, 0.0}, 0.0, Eigen::Vector3d::Zero(), acted).y(), 2.0);
}

// Physics may take energy out of the coupling before the hand has put it in. That makes no deficit, and no profit
// later.
TEST(Passivity, NeitherOwesNorEarnsWhatTheWorldBorrows) {
  Passivity passivity(sprung());
  passivity.give(-3e-3);
  EXPECT_EQ(passivity.observed_j(), 0.0);
  passivity.give(3e-3);
  EXPECT_EQ(passivity.observed_j(), 0.0);
  passivity.give(1e-3);
  EXPECT_DOUBLE_EQ(passivity.observed_j(), 1e-3);
}

}  // namespace
