#include "haptic_node/safety.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <numbers>
#include <optional>
#include <random>

#include "tests/unit/haptic/safety_steps.hpp"

namespace {

using namespace safety_steps;

TEST(SafetyLadder, RampsUpFromZeroAfterEnable) {
  SafetyLadder ladder(desktop());
  double last = -1.0;
  for (int k = 1; k <= 200; ++k) {
    const SafetyOutput out = step(ladder, healthy({0.0, 1.0, 0.0}));
    EXPECT_GE(out.force_n.y(), last);
    EXPECT_LE(out.force_n.y(), static_cast<double>(k) * kDt_s / 0.2 + 1e-12);
    last = out.force_n.y();
  }
  EXPECT_NEAR(last, 1.0, 1e-9);
}

TEST(SafetyLadder, ForceOfAnOrderComesByARampAndEndsWithTheGate) {
  SafetyLadder ladder = opened();
  SafetyInput input = healthy(Eigen::Vector3d::Zero());
  input.extra_force_n = {1.0, 0.0, 0.0};
  double last_n = 0.0;
  for (int k = 1; k <= 50; ++k) {
    const SafetyOutput out = step(ladder, input);
    EXPECT_NEAR(out.force_n.x() - last_n, 0.02, 1e-9) << "N in 1 ms, tick " << k;
    EXPECT_EQ(out.force_n, out.extra_force_n);
    last_n = out.force_n.x();
  }
  EXPECT_NEAR(last_n, 1.0, 1e-9);
  input.estop = true;
  for (int k = 0; k < 40; ++k) {
    const double n = step(ladder, input).force_n.x();
    EXPECT_LT(n, last_n);
    last_n = n;
  }
  EXPECT_EQ(last_n, 0.0);
}

TEST(SafetyLadder, ForceOfAnOrderAndOfTheMethodStayWithinTheLimitTogether) {
  SafetyConfig config = desktop();
  config.continuous_force_n = config.max_force_n;
  SafetyLadder ladder = opened(config);
  SafetyInput input = healthy({7.0, 0.0, 0.0});
  input.extra_force_n = {0.0, 5.0, 0.0};
  SafetyOutput out;
  for (int k = 0; k < 300; ++k) {
    out = step(ladder, input);
    EXPECT_LE(out.force_n.norm(), 7.9 * (1.0 + 1e-12));
  }
  EXPECT_NEAR(out.force_n.norm(), 7.9, 1e-9);
  EXPECT_NEAR(out.extra_force_n.y() / (out.force_n - out.extra_force_n).x(), 5.0 / 7.0, 1e-6);
}

TEST(SafetyLadder, ForceOfAnOrderIsNoConcernOfTheEnergyStage) {
  SafetyConfig config = desktop();
  config.stiffness_n_per_m = config.passivity.stiffness_n_per_m = 400.0;
  SafetyLadder ladder = opened(config);
  SafetyInput input = healthy(Eigen::Vector3d::Zero());
  input.extra_force_n = {1.0, 0.0, 0.0};
  // It pulls a hand that gives way at 50 mm/s, for 20 mm: 20 mJ that no hand has put in.
  SafetyOutput out;
  for (int k = 0; k < 400; ++k) {
    input.position_m.x() += 50e-6;
    input.velocity_m_s = {0.05, 0.0, 0.0};
    out = step(ladder, input);
  }
  EXPECT_NEAR(out.force_n.x(), 1.0, 1e-9);
  EXPECT_EQ(out.acted & haptic::kPassivity, 0u);
  EXPECT_GE(ladder.passivity().observed_j(), 0.0);
}

TEST(SafetyLadder, FadesAtAnEstopHoldsZeroAndRampsAsAtTheStartAfterwards) {
  SafetyLadder ladder = opened();
  for (int k = 0; k < 10; ++k) (void)step(ladder, healthy({0.0, 1.0, 0.0}));
  SafetyInput stopped = healthy({0.0, 1.0, 0.0});
  stopped.estop = true;
  stopped.enabled = false;  // as the loop has it
  SafetyOutput out;
  double last_n = 1.0;
  for (int k = 0; k < 40; ++k) {
    out = step(ladder, stopped);
    EXPECT_LE(out.force_n.norm(), last_n);
    last_n = out.force_n.norm();
  }
  EXPECT_NEAR(last_n, 0.0, 1e-9) << "within 40 ms";
  for (int k = 0; k < 1000; ++k) out = step(ladder, stopped);
  EXPECT_EQ(out.force_n.norm(), 0.0);
  EXPECT_EQ(out.acted & (haptic::kEstop | haptic::kDisabled | haptic::kStale), haptic::kEstop);
  int cycles = 0;
  do {
    out = step(ladder, healthy({0.0, 1.0, 0.0}));
    ++cycles;
  } while (out.force_n.y() < 1.0 - 1e-9 && cycles < 1000);
  EXPECT_NEAR(cycles, 200, 2) << "the start ramp, not the shorter one after a loss";
}

/// Cycles until the whole force is there.
int cycles_of_the_ramp(SafetyLadder& ladder) {
  int cycles = 0;
  SafetyOutput out;
  do {
    out = step(ladder, healthy({0.0, 1.0, 0.0}));
    ++cycles;
  } while (out.force_n.y() < 1.0 - 1e-9 && cycles < 1000);
  return cycles;
}

TEST(SafetyLadder, RampsAsAtTheStartAfterADeviceThatWasLostAndAfterTheButtonOfTheUser) {
  SafetyLadder ladder = opened();
  for (int k = 0; k < 10; ++k) (void)step(ladder, healthy({0.0, 1.0, 0.0}));
  SafetyInput lost = healthy({0.0, 1.0, 0.0});
  lost.device_ok = lost.enabled = false;  // as the loop has it
  (void)step(ladder, lost);
  EXPECT_NEAR(cycles_of_the_ramp(ladder), 200, 2) << "a single tick without the device";
  SafetyInput disabled = healthy({0.0, 1.0, 0.0});
  disabled.enabled = false;
  for (int k = 0; k < 100; ++k) (void)step(ladder, disabled);
  EXPECT_NEAR(cycles_of_the_ramp(ladder), 200, 2) << "let go, and pressed again";
  disabled.clutched = true;
  for (int k = 0; k < 100; ++k) (void)step(ladder, disabled);
  EXPECT_NEAR(cycles_of_the_ramp(ladder), 100, 2) << "a clutch";
  SafetyInput stale = healthy({0.0, 1.0, 0.0});
  stale.link_alive = false;
  for (int k = 0; k < 100; ++k) (void)step(ladder, stale);
  EXPECT_NEAR(cycles_of_the_ramp(ladder), 100, 2) << "a loss of physics";
}

TEST(SafetyLadder, LetsAnOrdinaryForceThroughUntouched) {
  SafetyLadder ladder = opened();
  const SafetyOutput out = step(ladder, healthy({0.5, -1.0, 0.25}));
  EXPECT_EQ(out.force_n, Eigen::Vector3d(0.5, -1.0, 0.25));
  EXPECT_EQ(out.acted, 0u);
}

TEST(SafetyLadder, ClampsTheNormAndKeepsTheDirection) {
  SafetyConfig config = desktop();
  config.continuous_force_n = config.max_force_n;
  SafetyLadder ladder = opened(config);
  SafetyOutput out;
  for (int k = 0; k < 20; ++k) out = step(ladder, healthy({300.0, 400.0, 0.0}));
  EXPECT_NEAR(out.force_n.norm(), 7.9, 1e-9);
  EXPECT_NEAR(out.force_n.x() / out.force_n.y(), 0.75, 1e-9);
  EXPECT_TRUE(out.acted & haptic::kClamped);
}

TEST(SafetyLadder, LimitsGrowthToTheSlewRate) {
  SafetyLadder ladder = opened();
  const SafetyOutput first = step(ladder, healthy({7.0, 0.0, 0.0}));
  EXPECT_NEAR(first.force_n.x(), 3.0, 1e-9);
  EXPECT_TRUE(first.acted & haptic::kSlewLimited);
  EXPECT_NEAR(step(ladder, healthy({7.0, 0.0, 0.0})).force_n.x(), 6.0, 1e-9);
  EXPECT_NEAR(step(ladder, healthy({7.0, 0.0, 0.0})).force_n.x(), 7.0, 1e-9);
}

// Found by `rtbus evaluate worst-physics`: a physics that asks for the whole force, and later claims to have supplied
// it.
TEST(SafetyLadder, LimitsGrowthToTheSlewRateAlsoWhenTheWorldClaimsItsEnergyAtOnce) {
  SafetyConfig config = desktop();
  config.stiffness_n_per_m = config.passivity.stiffness_n_per_m = 200.0;
  config.passivity.energy_cap_j = 0.156;
  config.passivity.counts_world_work = true;
  SafetyLadder ladder = opened(config);
  double held_n = 0.0;
  for (int k = 0; k < 100; ++k) held_n = step(ladder, healthy({0.0, 7.0, 0.0})).force_n.norm();
  ASSERT_LT(held_n, 0.5) << "nobody has supplied it";
  SafetyInput claims = healthy({0.0, 7.0, 0.0});
  claims.world_work_j = 1.0;
  const SafetyOutput first = step(ladder, claims);
  EXPECT_NEAR(first.force_n.norm(), held_n + 3.0, 1e-9);
  EXPECT_NE(first.acted & haptic::kSlewLimited, 0u);
  EXPECT_NEAR(step(ladder, healthy({0.0, 7.0, 0.0})).force_n.norm(), held_n + 6.0, 1e-9);
  EXPECT_NEAR(step(ladder, healthy({0.0, 7.0, 0.0})).force_n.norm(), 7.0, 1e-9);
}

// Likewise: the limit is on what is new, not on the norm.
TEST(SafetyLadder, LimitsGrowthToTheSlewRateAlsoWhereTheForceThatWasHeldBackTurns) {
  SafetyConfig config = desktop();
  config.stiffness_n_per_m = config.passivity.stiffness_n_per_m = 200.0;
  config.passivity.energy_cap_j = 0.156;
  config.passivity.counts_world_work = true;
  SafetyLadder ladder = opened(config);
  SafetyInput claims = healthy({0.0, 7.0, 0.0});
  claims.world_work_j = 0.8 * 0.8 / (2.0 * 200.0);
  Eigen::Vector3d before_n = step(ladder, claims).force_n;
  for (int k = 0; k < 100; ++k) before_n = step(ladder, healthy({0.0, 7.0, 0.0})).force_n;
  ASSERT_NEAR(before_n.y(), 0.8, 0.3) << "nobody has supplied more";
  claims = healthy(7.0 * Eigen::Vector3d(0.0, 0.5, std::sqrt(0.75)));
  claims.world_work_j = 1.0;
  const Eigen::Vector3d now_n = step(ladder, claims).force_n;
  ASSERT_GT(now_n.y(), before_n.y());
  EXPECT_LE((now_n - before_n).norm(), 3.0 + 1e-9);
  EXPECT_GT((now_n - before_n).norm(), 2.9);
}

TEST(SafetyLadder, LetsForceFallAtOnce) {
  SafetyLadder ladder = opened();
  for (int k = 0; k < 5; ++k) (void)step(ladder, healthy({7.0, 0.0, 0.0}));
  EXPECT_EQ(step(ladder, healthy(Eigen::Vector3d::Zero())).force_n.norm(), 0.0);
}

TEST(SafetyLadder, TakesAReversalThroughZeroAndThenSlowly) {
  SafetyLadder ladder = opened();
  for (int k = 0; k < 5; ++k) (void)step(ladder, healthy({7.0, 0.0, 0.0}));
  const SafetyOutput out = step(ladder, healthy({-7.0, 0.0, 0.0}));
  EXPECT_NEAR(out.force_n.x(), -3.0, 1e-9) << "equal norms are no licence to reverse at once";
  EXPECT_TRUE(out.acted & haptic::kSlewLimited);
}

TEST(SafetyLadder, LimitsASidewaysJump) {
  SafetyLadder ladder = opened();
  for (int k = 0; k < 5; ++k) (void)step(ladder, healthy({7.0, 0.0, 0.0}));
  EXPECT_LE(step(ladder, healthy({0.0, 7.0, 0.0})).force_n.norm(), 3.0 + 1e-9);
}

TEST(SafetyLadder, DoesNotTakeVelocityNoiseForMotion) {
  SafetyLadder ladder = opened();
  SafetyInput input = healthy({7.9, 0.0, 0.0});
  input.velocity_m_s = {-0.009, 0.0, 0.0};  // what one encoder step leaves behind the filter
  EXPECT_LE(step(ladder, input).force_n.norm(), 3.0 + 1e-9);
}

TEST(SafetyLadder, LetsAWallGrowAsFastAsTheHandMovesIntoIt) {
  SafetyConfig config = desktop();
  config.stiffness_n_per_m = 2000.0;
  SafetyLadder ladder = opened(config);
  SafetyInput input = healthy({0.0, 5.0, 0.0});
  input.velocity_m_s = {0.0, -0.6, 0.0};
  // 3 N/ms and 4·2000 N/m·0.6 m/s·1 ms = 4.8 N.
  EXPECT_NEAR(step(ladder, input).force_n.y(), 5.0, 1e-9);
}

// A held-up loop (a pause of the machine, a debugger, Ctrl-Z) finds a device that has timed out to zero.
TEST(SafetyLadder, StartsOverAfterAPauseLongerThanTheDeviceHoldsAForce) {
  SafetyLadder ladder = opened();
  SafetyInput input = healthy({0.0, 7.0, 0.0});
  for (int k = 0; k < 10; ++k) (void)step(ladder, input);
  input.position_m.y() = -0.05;
  const SafetyOutput first = step(ladder, input, 5000);
  EXPECT_LE(first.force_n.norm(), 7.9 * kDt_s / 0.1 + 1e-9);
  EXPECT_GE(ladder.passivity().observed_j(), -0.1) << "the deficit of a pause is bounded";
  double last = first.force_n.norm();
  for (int k = 0; k < 200; ++k) {
    const double force = step(ladder, input).force_n.norm();
    ASSERT_LE(force - last, 3.0 * 0.1 + 1e-9);
    last = force;
  }
}

TEST(SafetyLadder, NeverGrowsWhileItFades) {
  SafetyLadder ladder = opened();
  SafetyInput input = healthy({0.0, 1.0, 0.0});
  (void)step(ladder, input);
  input.link_alive = false;
  double last = 1.0;
  for (int k = 1; k <= 45; ++k) {
    // The proxy stands still and the hand moves away: the method pulls harder and harder.
    input.force_n.y() = 1.0 + 0.5 * k;
    input.position_m.y() -= 0.5 * kDt_s;
    input.velocity_m_s.y() = -0.5;
    const double force = step(ladder, input).force_n.norm();
    EXPECT_LE(force, last + 1e-9) << "tick " << k;
    last = force;
  }
  EXPECT_EQ(last, 0.0);
}

TEST(SafetyLadder, GoesOnAtTheSlewRateWhenAFadeIsCalledOff) {
  SafetyLadder ladder = opened();
  SafetyInput input = healthy({0.0, 0.5, 0.0});
  (void)step(ladder, input);
  input.link_alive = false;
  input.force_n.y() = 8.0;
  double last = 0.5;
  for (int k = 0; k < 20; ++k) last = step(ladder, input).force_n.norm();
  EXPECT_LE(last, 0.5);
  input.link_alive = true;
  for (int k = 0; k < 20; ++k) {
    const double force = step(ladder, input).force_n.norm();
    ASSERT_LE(force - last, 3.0 + 1e-9) << "tick " << k;
    last = force;
  }
}

TEST(SafetyLadder, FadesFromAHalfOpenRampWithoutADrop) {
  SafetyLadder ladder(desktop());
  SafetyInput input = healthy({0.0, 6.0, 0.0});
  double last = 0.0;
  for (int k = 0; k < 100; ++k) last = step(ladder, input).force_n.norm();
  input.link_alive = false;
  EXPECT_NEAR(step(ladder, input).force_n.norm(), last - 6.0 * kDt_s / 0.04, 1e-6);
}

TEST(SafetyLadder, CountsOnlyForcesThatLeft) {
  SafetyLadder ladder = opened();
  SafetyInput input = healthy({0.0, 2.0, 0.0});
  (void)step(ladder, input);
  ladder.not_sent();
  input.position_m.y() += 0.001;
  (void)step(ladder, input);
  EXPECT_EQ(ladder.passivity().absorbed_j(), 0.0);
}

TEST(SafetyLadder, TurnsNotANumberIntoZero) {
  for (const double poison : {std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity()}) {
    SafetyLadder ladder = opened();
    const SafetyOutput out = step(ladder, healthy({0.0, poison, 0.0}));
    EXPECT_EQ(out.force_n, Eigen::Vector3d::Zero());
    EXPECT_TRUE(out.acted & haptic::kNonfinite);
    // And it forgets it: the next good force is fine.
    EXPECT_EQ(step(ladder, healthy({0.0, 1.0, 0.0})).force_n, Eigen::Vector3d(0.0, 1.0, 0.0));
  }
}

TEST(SafetyLadder, TreatsAPoseThatIsNotANumberAsNoDevice) {
  SafetyLadder ladder = opened();
  SafetyInput input = healthy({0.0, 1.0, 0.0});
  input.position_m.x() = std::numeric_limits<double>::quiet_NaN();
  const SafetyOutput out = step(ladder, input);
  EXPECT_EQ(out.force_n.norm(), 0.0);
  EXPECT_TRUE(out.acted & haptic::kNonfinite);
  EXPECT_TRUE(std::isfinite(ladder.passivity().absorbed_j()));
}

TEST(SafetyLadder, FadesToZeroIn40MsOnceTheLinkIsLost) {
  SafetyLadder ladder = opened();
  SafetyInput input = healthy({0.0, 1.0, 0.0});
  (void)step(ladder, input);
  input.link_alive = false;
  double last = 1.0;
  for (int k = 1; k <= 40; ++k) {
    const SafetyOutput out = step(ladder, input);
    EXPECT_LE(out.force_n.y(), last + 1e-12);
    EXPECT_TRUE(out.acted & haptic::kStale);
    last = out.force_n.y();
  }
  EXPECT_NEAR(last, 0.0, 1e-9);
}

// Time counts, not ticks: a loop that gets a half or a fifth of its periods fades as fast.
TEST(SafetyLadder, FadesAsFastWhenTheLoopMissesPeriods) {
  for (const std::uint64_t ticks : {2u, 5u}) {
    SafetyLadder ladder = opened();
    SafetyInput input = healthy({0.0, 1.0, 0.0});
    (void)step(ladder, input);
    input.link_alive = false;
    for (std::uint64_t passed = ticks; passed <= 40; passed += ticks) {
      EXPECT_NEAR(step(ladder, input, ticks).force_n.y(), 1.0 - static_cast<double>(passed) / 40.0, 1e-9) << ticks;
    }
  }
}

TEST(SafetyLadder, ComesBackNoFasterThanTheResumeRamp) {
  SafetyLadder ladder = opened();
  SafetyInput input = healthy({0.0, 5.0, 0.0});
  input.link_alive = false;
  for (int k = 0; k < 100; ++k) (void)step(ladder, input);
  input.link_alive = true;
  double force = 0.0;
  for (int k = 1; k <= 100; ++k) {
    force = step(ladder, input).force_n.y();
    EXPECT_LE(force, 5.0 * k * kDt_s / 0.1 + 1e-9) << "tick " << k;
  }
  EXPECT_NEAR(force, 5.0, 1e-9);
}

TEST(SafetyLadder, CutsAtOnceWhenTheDeviceIsLost) {
  SafetyLadder ladder = opened();
  (void)step(ladder, healthy({0.0, 2.0, 0.0}));
  SafetyInput input = healthy({0.0, 2.0, 0.0});
  input.device_ok = false;
  const SafetyOutput out = step(ladder, input);
  EXPECT_EQ(out.force_n.norm(), 0.0);
  EXPECT_TRUE(out.acted & haptic::kDeviceLost);
}

TEST(SafetyLadder, CutsOverspeedUntilTheTipHasBeenSlowFor100Ms) {
  SafetyLadder ladder = opened();
  SafetyInput input = healthy({0.0, 2.0, 0.0});
  int ticks = 0;
  // The cut has its own eyes: it looks at positions, whatever the velocity filter of the session says.
  while (step(ladder, input).force_n.norm() > 0.0 && ticks < 1000) {
    input.position_m.y() += 3.0 * kDt_s;
    ++ticks;
  }
  EXPECT_LE(ticks, 5);
  ticks = 0;
  while (step(ladder, input).force_n.norm() == 0.0 && ticks < 1000) ++ticks;
  EXPECT_GE(ticks, 98);
  EXPECT_LE(ticks, 110);
}

TEST(SafetyLadder, HoldsTheMotorToItsContinuousForce) {
  SafetyConfig config = desktop();
  config.thermal_time_constant_s = 2.0;
  SafetyLadder ladder = opened(config);
  SafetyOutput out;
  for (int k = 0; k < 20'000; ++k) out = step(ladder, healthy({0.0, 6.0, 0.0}));
  // The load settles on the closing line between peak and continuous force, within the continuous heat.
  EXPECT_LE(std::sqrt(ladder.thermal_load_n2()), 1.75 + 1e-6);
  EXPECT_LE(out.force_n.y(), 1.76);
  EXPECT_TRUE(out.acted & haptic::kThermalLimited);
  // Short peaks are free: nothing is limited before the knee.
  SafetyLadder fresh = opened(config);
  for (int k = 0; k < 50; ++k) out = step(fresh, healthy({0.0, 6.0, 0.0}));
  EXPECT_NEAR(out.force_n.y(), 6.0, 1e-9);
}

TEST(SafetyLadder, NeedsTheUserToEnable) {
  SafetyLadder ladder(desktop());
  SafetyInput input = healthy({0.0, 2.0, 0.0});
  input.enabled = false;
  for (int k = 0; k < 500; ++k) EXPECT_EQ(step(ladder, input).force_n.norm(), 0.0);
}

TEST(SafetyLadder, DampsWhenTheEnergyIsInDeficitAndClampsOnceMore) {
  SafetyLadder ladder = opened();
  SafetyInput input = healthy({0.0, 7.9, 0.0});
  Eigen::Vector3d position = Eigen::Vector3d::Zero();
  std::uint32_t acted = 0;
  for (int k = 0; k < 50; ++k) {
    // We push the hand along: 7.9 N at 0.5 m/s out of nothing.
    input.velocity_m_s = {0.0, 0.5, 0.0};
    position.y() += 0.5 * kDt_s;
    input.position_m = position;
    const SafetyOutput out = step(ladder, input);
    acted |= out.acted;
    EXPECT_LE(out.force_n.norm(), 7.9 + 1e-12);
  }
  EXPECT_TRUE(acted & haptic::kPassivity);
  EXPECT_GT(ladder.passivity().dissipated_j(), 0.0);
}

// Whatever comes in, at every tick: finite, within the limit.
TEST(SafetyLadder, IsFiniteAndWithinTheLimitForHostileInput) {
  std::mt19937 random(7);
  std::uniform_real_distribution<double> uniform(-1.0, 1.0);
  SafetyLadder ladder(desktop());
  const double poisons[] = {std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity(), 1e308,
                            -1e308, 5e-324};
  for (int k = 0; k < 200'000; ++k) {
    SafetyInput input = healthy({uniform(random) * 20.0, uniform(random) * 20.0, uniform(random) * 20.0});
    input.velocity_m_s = {uniform(random), uniform(random), uniform(random)};
    input.position_m = {uniform(random) * 0.1, uniform(random) * 0.1, uniform(random) * 0.1};
    if (k % 7 == 0) input.force_n[k % 3] = poisons[static_cast<std::size_t>(k) % 5];
    if (k % 11 == 0) input.velocity_m_s[k % 3] = poisons[static_cast<std::size_t>(k) % 5];
    if (k % 13 == 0) input.position_m[k % 3] = poisons[static_cast<std::size_t>(k) % 5];
    input.link_alive = k % 500 < 400;
    input.device_ok = k % 900 < 850;
    input.enabled = k % 2000 < 1900;
    const SafetyOutput out = step(ladder, input);
    ASSERT_TRUE(out.force_n.allFinite()) << "tick " << k;
    ASSERT_LE(out.force_n.norm(), 7.9 + 1e-9) << "tick " << k;
  }
}

}  // namespace
