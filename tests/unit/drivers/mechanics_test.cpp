// The plant against closed forms and against what friction, saturation and time must never do.
#include "drivers/simulated/mechanics.hpp"
#include "rtbus/clock.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>
#include <vector>

namespace drivers::simulated {
namespace {

using Eigen::Vector3d;

// A point mass in empty space: no friction, weight, encoder, stop or hand.
MechanicsParameters bare() {
  MechanicsParameters p;
  p.viscous_n_s_per_m = 0.0;
  p.coulomb_n = 0.0;
  p.gravity_m_s2.setZero();
  p.end_stops = false;
  return p;
}

MechanicsParameters desktop_friction() {
  MechanicsParameters p = bare();
  p.viscous_n_s_per_m = 0.05;
  p.coulomb_n = 0.06;
  return p;
}

TEST(Mechanics, FallsAsGalileoSays) {
  MechanicsParameters p = bare();
  p.gravity_m_s2 = {0.0, -9.81, 0.0};
  Mechanics tip(p, Hand{});
  tip.advance_to(rtbus::kNsPerS / 2);
  // Semi-implicit Euler is ahead by g·h·t/2, and exactly by that.
  EXPECT_NEAR(tip.position_m().y(), -0.5 * 9.81 * 0.25 - 0.5 * 9.81 * 1e-4 * 0.5, 1e-9);
  EXPECT_NEAR(tip.velocity_m_s().y(), -9.81 * 0.5, 1e-9);
}

TEST(Mechanics, FallsAtTheTerminalSpeedOfItsFriction) {
  MechanicsParameters p = desktop_friction();
  p.gravity_m_s2 = {0.0, -9.81, 0.0};
  Mechanics tip(p, Hand{});
  for (int s = 1; s <= 20; ++s) tip.advance_to(s * rtbus::kNsPerS);
  EXPECT_NEAR(tip.velocity_m_s().y(), -(0.041 * 9.81 - 0.06) / 0.05, 1e-6);
}

// Position error against m x'' + b x' + k x = 0, x(0) = 1 cm, after 0.1 s.
double oscillator_error_m(std::uint64_t step_ns) {
  MechanicsParameters p = bare();
  p.viscous_n_s_per_m = 0.2;
  p.step_ns = step_ns;
  const HandImpedance z{300.0, 0.8, 0.02, 1e3};
  Mechanics tip(p, Hand(HoldMotion{}, z));
  tip.place({0.01, 0.0, 0.0}, Vector3d::Zero());
  tip.begin_script(0);
  tip.advance_to(100 * rtbus::kNsPerMs);
  const double m = p.mass_kg + z.mass_kg;
  const double decay = (0.2 + 0.8) / (2.0 * m);
  const double omega = std::sqrt(300.0 / m - decay * decay);
  const double exact = 0.01 * std::exp(-decay * 0.1) * (std::cos(omega * 0.1) + decay / omega * std::sin(omega * 0.1));
  return std::abs(tip.position_m().x() - exact);
}

TEST(Mechanics, DampedOscillatorConvergesWithFirstOrder) {
  const double coarse = oscillator_error_m(100'000);
  const double fine = oscillator_error_m(50'000);
  const double finest = oscillator_error_m(25'000);
  EXPECT_LT(coarse, 1e-4);  // of an amplitude of 1 cm
  EXPECT_NEAR(coarse / fine, 2.0, 0.15);
  EXPECT_NEAR(fine / finest, 2.0, 0.1);
}

TEST(Mechanics, FrictionHoldsExactlyForAMinute) {
  MechanicsParameters p = desktop_friction();
  Mechanics tip(p, Hand{});
  tip.place({0.001, -0.002, 0.003}, Vector3d::Zero());
  const Vector3d push = 0.99 * p.coulomb_n * Vector3d(1.0, -2.0, 2.0) / 3.0;
  ASSERT_TRUE(tip.set_force(push, Mechanics::kNever));
  for (std::uint64_t s = 1; s <= 60; ++s) tip.advance_to(s * rtbus::kNsPerS);
  EXPECT_EQ(tip.skipped_ns(), 0u);
  EXPECT_EQ(tip.position_m(), Vector3d(0.001, -0.002, 0.003));  // not a bit of creep
  EXPECT_EQ(tip.velocity_m_s(), Vector3d::Zero());
}

TEST(Mechanics, FrictionYieldsAboveItsForceAlongTheForce) {
  MechanicsParameters p = desktop_friction();
  Mechanics tip(p, Hand{});
  const Vector3d direction = Vector3d(1.0, -2.0, 2.0) / 3.0;
  ASSERT_TRUE(tip.set_force(1.01 * p.coulomb_n * direction, Mechanics::kNever));
  tip.advance_to(rtbus::kNsPerS);
  EXPECT_GT(tip.velocity_m_s().norm(), 0.0);
  EXPECT_NEAR(tip.velocity_m_s().normalized().dot(direction), 1.0, 1e-12);
}

TEST(Mechanics, FrictionStopsASlidingTipWhereTheWorkEnds) {
  MechanicsParameters p = bare();
  p.coulomb_n = 0.06;
  p.step_ns = 10'000;
  Mechanics tip(p, Hand{});
  tip.place(Vector3d::Zero(), {0.1, 0.0, 0.0});
  tip.advance_to(rtbus::kNsPerS);
  EXPECT_EQ(tip.velocity_m_s(), Vector3d::Zero());
  // m v²/2 = f_c s, less half a step's way.
  EXPECT_NEAR(tip.position_m().x(), 0.5 * 0.041 * 0.01 / 0.06, 0.1 * 1e-5);
}

TEST(Mechanics, PassivePlantNeverGainsEnergy) {
  std::mt19937_64 random(7);
  std::uniform_real_distribution<double> unit(-1.0, 1.0);
  for (int run = 0; run < 20; ++run) {
    MechanicsParameters p = desktop_friction();
    if (run % 2 == 0) p.coulomb_n = p.viscous_n_s_per_m = 0.0;  // only the hand's damper
    p.end_stops = run % 3 == 0;
    const HandImpedance z{2000.0 * (1.0 + unit(random)), 2.0 * (1.0 + unit(random)), 0.05, 1e4};
    Mechanics tip(p, Hand(HoldMotion{}, z));
    tip.begin_script(0);
    tip.place(0.05 * Vector3d(unit(random), unit(random), unit(random)),
              Vector3d(unit(random), unit(random), unit(random)));
    const auto energy_j = [&] {
      return 0.5 * (p.mass_kg + z.mass_kg) * tip.velocity_m_s().squaredNorm() +
             0.5 * z.stiffness_n_per_m * tip.position_m().squaredNorm();
    };
    double last_j = energy_j();
    for (std::uint64_t t = p.step_ns; t < 300 * rtbus::kNsPerMs; t += p.step_ns) {
      tip.advance_to(t);
      ASSERT_LE(energy_j(), last_j * (1.0 + 1e-12)) << "run " << run << " at " << t << " ns";
      last_j = energy_j();
    }
  }
}

TEST(Mechanics, StiffestHandIsStableAtTheCoarsestStep) {
  MechanicsParameters p = bare();
  p.mass_kg = 0.005;
  p.step_ns = 500'000;
  Mechanics tip(p, Hand(HoldMotion{}, {20000.0, 200.0, 0.0, 200.0}));
  tip.begin_script(0);
  tip.place({0.05, -0.05, 0.02}, {2.0, 1.0, -3.0});
  tip.advance_to(rtbus::kNsPerS);
  EXPECT_LT(tip.position_m().norm(), 1e-9);
  EXPECT_LT(tip.velocity_m_s().norm(), 1e-9);
}

TEST(Mechanics, HandSlipsAboveItsLargestForce) {
  MechanicsParameters p = bare();
  Mechanics tip(p, Hand(HoldMotion{}, {300.0, 3.0, 0.0, 2.0}));
  tip.begin_script(0);
  ASSERT_TRUE(tip.set_force({3.0, 0.0, 0.0}, Mechanics::kNever));
  tip.advance_to(200 * rtbus::kNsPerMs);
  EXPECT_NEAR(tip.hand_force_n().x(), -2.0, 1e-9);
  EXPECT_NEAR(tip.velocity_m_s().x(), (3.0 - 2.0) / 0.041 * 0.2, 0.5);  // carried away by the rest
}

TEST(Mechanics, ReportsTheForceThatTheHandFeels) {
  Mechanics tip(desktop_friction(), Hand(HoldMotion{}, {300.0, 3.0, 0.08, 10.0}));
  tip.begin_script(0);
  ASSERT_TRUE(tip.set_force({0.0, 1.5, 0.0}, Mechanics::kNever));
  tip.advance_to(rtbus::kNsPerS);
  EXPECT_NEAR(tip.hand_force_n().y(), -1.5, 0.06 + 1e-9);  // what friction does not carry
  EXPECT_NEAR(tip.position_m().y(), 1.5 / 300.0, 0.06 / 300.0 + 1e-9);
}

TEST(Mechanics, SaturatesTheForceAndKeepsItsDirection) {
  Mechanics tip(bare(), Hand{});
  EXPECT_FALSE(tip.set_force({30.0, -40.0, 0.0}, Mechanics::kNever));
  EXPECT_NEAR(tip.applied_force_n().x(), 7.9 * 0.6, 1e-12);
  EXPECT_NEAR(tip.applied_force_n().y(), -7.9 * 0.8, 1e-12);
  EXPECT_FALSE(tip.set_force({1e300, 1e300, 0.0}, Mechanics::kNever));
  EXPECT_NEAR(tip.applied_force_n().norm(), 7.9, 1e-9);
  EXPECT_TRUE(tip.set_force({0.0, 7.9, 0.0}, Mechanics::kNever));
}

TEST(Mechanics, TakesANonFiniteForceAsZero) {
  Mechanics tip(bare(), Hand{});
  ASSERT_TRUE(tip.set_force({1.0, 1.0, 1.0}, Mechanics::kNever));
  EXPECT_FALSE(tip.set_force({1.0, std::numeric_limits<double>::quiet_NaN(), 0.0}, Mechanics::kNever));
  EXPECT_EQ(tip.applied_force_n(), Vector3d::Zero());
  EXPECT_FALSE(tip.set_force({std::numeric_limits<double>::infinity(), 0.0, 0.0}, Mechanics::kNever));
  EXPECT_EQ(tip.applied_force_n(), Vector3d::Zero());
}

TEST(Mechanics, RoundsTheForceToItsResolutionWithoutLeavingTheLimit) {
  MechanicsParameters p = bare();
  p.force_step_n = 0.25;
  Mechanics tip(p, Hand{});
  ASSERT_TRUE(tip.set_force({0.3, -0.4, 0.1}, Mechanics::kNever));
  EXPECT_EQ(tip.applied_force_n(), Vector3d(0.25, -0.5, 0.0));
  EXPECT_FALSE(tip.set_force({50.0, 50.0, 50.0}, Mechanics::kNever));
  EXPECT_LE(tip.applied_force_n().norm(), 7.9);
  EXPECT_GT(tip.applied_force_n().norm(), 7.9 - 3 * 0.25);
}

TEST(Mechanics, RoundsThePositionToEncoderQuantaOnEachAxis) {
  MechanicsParameters p = bare();
  p.position_quantum_m = 23e-6;
  Mechanics tip(p, Hand{});
  tip.place({34.4e-6, -34.6e-6, 1e-6}, Vector3d::Zero());
  const Vector3d shown = tip.measure(0);
  EXPECT_DOUBLE_EQ(shown.x(), 23e-6);
  EXPECT_DOUBLE_EQ(shown.y(), -46e-6);
  EXPECT_DOUBLE_EQ(shown.z(), 0.0);
}

TEST(Mechanics, MeasuresBetweenStepsWithoutAStaircase) {
  Mechanics tip(bare(), Hand{});
  tip.place(Vector3d::Zero(), {1.0, 0.0, 0.0});
  tip.advance_to(1'050'000);
  EXPECT_EQ(tip.time_ns(), 1'000'000u);
  EXPECT_NEAR(tip.measure(1'050'000).x(), 1.05e-3, 1e-12);
}

std::vector<double> jittered(std::uint64_t seed) {
  MechanicsParameters p = bare();
  p.sample_jitter_ns = 125'000;
  p.jitter_seed = seed;
  Mechanics tip(p, Hand{});
  tip.place(Vector3d::Zero(), {1.0, 0.0, 0.0});
  std::vector<double> lateness_s;
  for (std::uint64_t t = rtbus::kNsPerMs; t <= 1000 * rtbus::kNsPerMs; t += rtbus::kNsPerMs) {
    tip.advance_to(t);
    lateness_s.push_back(static_cast<double>(t) * 1e-9 - tip.measure(t).x());  // at 1 m/s, metres are seconds
  }
  return lateness_s;
}

TEST(Mechanics, JitterIsUniformInItsRangeAndRepeats) {
  const std::vector<double> first = jittered(1);
  double sum_s = 0.0;
  double largest_s = 0.0;
  for (const double lateness_s : first) {
    ASSERT_GE(lateness_s, -1e-9);
    ASSERT_LE(lateness_s, 125e-6 + 1e-9);
    sum_s += lateness_s;
    largest_s = std::max(largest_s, lateness_s);
  }
  EXPECT_NEAR(sum_s / static_cast<double>(first.size()), 62.5e-6, 5e-6);  // 4 sigma of the mean of 1000
  EXPECT_GT(largest_s, 115e-6);
  EXPECT_EQ(first, jittered(1));
  EXPECT_NE(first, jittered(2));
}

TEST(Mechanics, TimeInPiecesGivesTheSameStateBitByBit) {
  const auto make = [] {
    MechanicsParameters p = desktop_friction();
    p.gravity_m_s2 = {0.3, -9.81, 0.1};
    Mechanics tip(p, Hand(SinusoidMotion{{0, 0, 0}, {0.02, 0.01, -0.01}, 7.0, 0.05}, {300.0, 3.0, 0.08, 4.0}));
    tip.reset(123'456);
    tip.begin_script(123'456);
    return tip;
  };
  Mechanics whole = make();
  whole.advance_to(123'456 + 900 * rtbus::kNsPerMs);

  std::mt19937_64 random(3);
  Mechanics pieces = make();
  for (std::uint64_t t = 123'456; t < 123'456 + 900 * rtbus::kNsPerMs;) {
    pieces.advance_to(t);
    pieces.advance_to(t - 50'000);  // a clock that steps back moves nothing
    t += random() % 700'000;
  }
  pieces.advance_to(123'456 + 900 * rtbus::kNsPerMs);
  EXPECT_EQ(whole.time_ns(), pieces.time_ns());
  EXPECT_EQ(whole.position_m(), pieces.position_m());
  EXPECT_EQ(whole.velocity_m_s(), pieces.velocity_m_s());
  EXPECT_EQ(whole.hand_force_n(), pieces.hand_force_n());
}

TEST(Mechanics, ForceHoldsUntilItExpiresAndNoLonger) {
  MechanicsParameters p = bare();
  Mechanics tip(p, Hand{});
  EXPECT_TRUE(tip.timed_out());
  ASSERT_TRUE(tip.set_force({0.41, 0.0, 0.0}, 20 * rtbus::kNsPerMs));
  tip.advance_to(20 * rtbus::kNsPerMs);
  EXPECT_FALSE(tip.timed_out());
  EXPECT_NEAR(tip.velocity_m_s().x(), 10.0 * 0.020, 1e-12);
  tip.advance_to(500 * rtbus::kNsPerMs);  // in one go: the end still lies where it belongs
  EXPECT_TRUE(tip.timed_out());
  EXPECT_EQ(tip.applied_force_n(), Vector3d::Zero());
  EXPECT_NEAR(tip.velocity_m_s().x(), 10.0 * 0.020, 1e-12);
}

TEST(Mechanics, SkipsWhatIsLongerThanTheBoundAndCountsIt) {
  Mechanics tip(bare(), Hand{});
  tip.place(Vector3d::Zero(), {1.0, 0.0, 0.0});
  tip.advance_to(10 * rtbus::kNsPerS + 50'000);
  EXPECT_EQ(tip.skipped_ns(), 9 * rtbus::kNsPerS);
  EXPECT_EQ(tip.time_ns(), 10 * rtbus::kNsPerS);
  EXPECT_NEAR(tip.position_m().x(), 1.0, 1e-9);
}

TEST(Mechanics, WorkspaceEndsStopTheTip) {
  MechanicsParameters p = desktop_friction();
  p.end_stops = true;
  p.gravity_m_s2 = {0.0, -9.81, 0.0};
  Mechanics tip(p, Hand{});
  tip.advance_to(rtbus::kNsPerS);
  EXPECT_EQ(tip.position_m().y(), -0.06);
  EXPECT_EQ(tip.velocity_m_s().y(), 0.0);
}

}  // namespace
}  // namespace drivers::simulated
