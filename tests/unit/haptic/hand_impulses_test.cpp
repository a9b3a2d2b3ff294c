/// What the hand has given to each body: one book for the re-simulation and for physics.
#include "haptic_node/rendering/hand_impulses.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <memory>

#include "rtbus/clock.hpp"
#include "rtbus/eigen.hpp"

namespace {

using Eigen::Vector3d;
using haptic::HandImpulses;

struct HandImpulsesTest : testing::Test {
  std::unique_ptr<HandImpulses> impulses = std::make_unique<HandImpulses>();
  std::uint64_t now_ns = 1000 * rtbus::kNsPerMs;

  /// A step in which the body got `given` and the ladder let `felt` through.
  void step(std::uint32_t body, const Vector3d& given, const Vector3d& felt, const Vector3d& arm = Vector3d::Zero()) {
    impulses->begin(now_ns, now_ns + rtbus::kNsPerMs);
    now_ns += rtbus::kNsPerMs;
    if (!given.isZero(0.0)) impulses->give(impulses->hold(body), 0, given, arm, true);
    impulses->settle(felt);
  }
  [[nodiscard]] rtbus::DeviceState told() const {
    rtbus::DeviceState out;
    impulses->tell(out);
    return out;
  }
  /// Row of the body in what is told; −1: none.
  [[nodiscard]] int row_of(std::uint32_t body) const {
    const rtbus::DeviceState state = told();
    for (std::size_t i = 0; i < rtbus::kHandImpulseRows; ++i) {
      if (state.hand_impulse_generation[i] != 0 && state.hand_impulse_body[i] == body) return static_cast<int>(i);
    }
    return -1;
  }
  [[nodiscard]] Vector3d told_n_s(std::uint32_t body) const {
    const int row = row_of(body);
    return row < 0 ? Vector3d(Vector3d::Zero())
                   : rtbus::vector_of(told().hand_impulse_n_s[static_cast<std::size_t>(row)]);
  }
};

TEST_F(HandImpulsesTest, TellsWhatTheLadderLetThroughAndWhen) {
  for (int i = 0; i < 10; ++i) step(7, {1e-3, 0, 0}, {5e-4, 0, 0}, {0, 0.1, 0});
  EXPECT_NEAR(told_n_s(7).x(), 5e-3, 1e-15);
  const auto row = static_cast<std::size_t>(row_of(7));
  EXPECT_NEAR(told().hand_angular_impulse_n_m_s[row][2], -5e-4, 1e-15) << "arm × impulse";
  // Sum of 0.5, 1.0, … 5.0 mN·s over 1 ms each.
  EXPECT_NEAR(told().hand_impulse_integral_n_s2[row][0], 27.5e-6, 1e-15);
}

TEST_F(HandImpulsesTest, TheReplayReadsWhatIsTold) {
  const std::size_t place = impulses->hold(7);
  for (int i = 0; i < 10; ++i) step(7, {1e-3, 0, 0}, {5e-4, 0, 0});
  const auto at = [&](double ms) {
    const auto back_ns = static_cast<std::uint64_t>(ms * static_cast<double>(rtbus::kNsPerMs));
    return impulses->history(place).at(now_ns - back_ns, impulses->sum(place)).linear_n_s.x();
  };
  EXPECT_NEAR(at(0.0), told_n_s(7).x(), 1e-15);
  EXPECT_NEAR(at(4.5), 5.5 * 5e-4, 1e-15);
}

// Found in a session whose topics were written over: one such step, and physics refused every state of the hand after
// it.
TEST_F(HandImpulsesTest, AStepThatMakesNoSenseLeavesNothingInTheSums) {
  constexpr double kNan = std::numeric_limits<double>::quiet_NaN(), kInfinity = std::numeric_limits<double>::infinity();
  step(7, {1e-3, 0, 0}, {1e-3, 0, 0});
  for (const double wrong : {kNan, kInfinity, 1e14}) {
    step(7, {wrong, 0, 0}, Vector3d::Zero());
    step(7, {1e-3, 0, 0}, Vector3d::Zero(), {0, wrong, 0});
  }
  EXPECT_NEAR(told_n_s(7).x(), 1e-3, 1e-15);
  EXPECT_TRUE(rtbus::SampleTraits<rtbus::DeviceState>::sane(told(), now_ns));
  step(7, {1e-3, 0, 0}, {1e-3, 0, 0});
  EXPECT_NEAR(told_n_s(7).x(), 2e-3, 1e-15);
}

TEST_F(HandImpulsesTest, BodiesShareWhatTheLadderTakesAsTheyShareTheForce) {
  impulses->begin(now_ns, now_ns + rtbus::kNsPerMs);
  impulses->give(impulses->hold(1), 0, {3e-3, 0, 0}, Vector3d::Zero(), true);
  impulses->give(impulses->hold(2), 1, {0, 1e-3, 0}, Vector3d::Zero(), true);
  impulses->settle({2e-3, 1e-3, 0});
  EXPECT_NEAR((told_n_s(1) - Vector3d(2.25e-3, 0, 0)).norm(), 0.0, 1e-15);
  EXPECT_NEAR((told_n_s(2) - Vector3d(-0.25e-3, 1e-3, 0)).norm(), 0.0, 1e-15);
  EXPECT_NEAR((told_n_s(1) + told_n_s(2) - Vector3d(2e-3, 1e-3, 0)).norm(), 0.0, 1e-15) << "the third law";
}

TEST_F(HandImpulsesTest, WhatComesAfterTheContactBelongsToTheBodyTouchedLast) {
  step(1, {1e-3, 0, 0}, {1e-3, 0, 0});
  step(2, {1e-3, 0, 0}, {1e-3, 0, 0});
  step(2, Vector3d::Zero(), {4e-4, 0, 0});
  EXPECT_NEAR(told_n_s(1).x(), 1e-3, 1e-15);
  EXPECT_NEAR(told_n_s(2).x(), 1.4e-3, 1e-15);
  ASSERT_EQ(impulses->entries().size(), 1U) << "the local world gives it as well";
  EXPECT_EQ(impulses->entries()[0].body, 2U);
  EXPECT_TRUE(impulses->entries()[0].impulse_n_s.isZero(0.0)) << "it was not touched";
  EXPECT_NEAR(impulses->entries()[0].more.linear_n_s.x(), 4e-4, 1e-15);
  const std::size_t place = impulses->hold(2);
  EXPECT_NEAR(impulses->history(place).at(now_ns - rtbus::kNsPerMs, impulses->sum(place)).linear_n_s.x(), 1e-3, 1e-15);
}

TEST_F(HandImpulsesTest, ARowThatAnotherBodyTakesBeginsAtZeroInANewGeneration) {
  for (std::uint32_t body = 0; body < rtbus::kHandImpulseRows; ++body) step(body, {1e-3, 0, 0}, {1e-3, 0, 0});
  const int row = row_of(0);
  ASSERT_GE(row, 0);
  const std::uint32_t generation = told().hand_impulse_generation[static_cast<std::size_t>(row)];
  step(50, {2e-3, 0, 0}, {2e-3, 0, 0});
  EXPECT_EQ(row_of(0), -1) << "it was given nothing for the longest time";
  EXPECT_EQ(row_of(50), row);
  EXPECT_GT(told().hand_impulse_generation[static_cast<std::size_t>(row)], generation);
  EXPECT_NEAR(told_n_s(50).x(), 2e-3, 1e-15);
  step(0, {1e-3, 0, 0}, {1e-3, 0, 0});
  EXPECT_NEAR(told_n_s(0).x(), 1e-3, 1e-15) << "what was told before is not told again";
}

// A tool in a corner of a tray, at two blocks.
TEST_F(HandImpulsesTest, BodiesThatAreTouchedTogetherDoNotTakeRowsFromEachOther) {
  constexpr std::uint32_t kBodies = rtbus::kHandImpulseRows + 1, kSteps = 10;
  const auto moves = [](std::uint32_t body) { return body == 0 || body == kBodies - 1; };
  for (std::uint32_t i = 0; i < kSteps; ++i) {
    impulses->begin(now_ns, now_ns + rtbus::kNsPerMs);
    now_ns += rtbus::kNsPerMs;
    for (std::uint32_t body = 0; body < kBodies; ++body) {
      impulses->give(impulses->hold(body), body, {1e-3, 0, 0}, Vector3d::Zero(), moves(body));
    }
    impulses->settle({1e-3 * kBodies, 0, 0});
  }
  for (std::uint32_t body = 0; body < kBodies; ++body) {
    EXPECT_TRUE(!moves(body) || std::abs(told_n_s(body).x() - 1e-3 * kSteps) < 1e-12) << body;
  }
}

// More than device_state has rows for: those that came first are told whole.
TEST_F(HandImpulsesTest, OfTooManyTheFirstAreTold) {
  constexpr std::uint32_t kSteps = 10;
  for (std::uint32_t i = 0; i < kSteps; ++i) {
    impulses->begin(now_ns, now_ns + rtbus::kNsPerMs);
    now_ns += rtbus::kNsPerMs;
    for (std::uint32_t body = 0; body <= rtbus::kHandImpulseRows; ++body) {
      impulses->give(impulses->hold(body), body, {1e-3, 0, 0}, Vector3d::Zero(), true);
    }
    impulses->settle({1e-3 * (rtbus::kHandImpulseRows + 1), 0, 0});
  }
  for (std::uint32_t body = 0; body < rtbus::kHandImpulseRows; ++body) {
    EXPECT_NEAR(told_n_s(body).x(), 1e-3 * kSteps, 1e-12) << body;
  }
  EXPECT_EQ(row_of(rtbus::kHandImpulseRows), -1);
}

TEST_F(HandImpulsesTest, WhatIsNotFiniteIsNothing) {
  step(7, {1e-3, 0, 0}, {1e-3, 0, 0});
  step(7, {1e-3, 0, 0}, {std::numeric_limits<double>::quiet_NaN(), 0, 0});
  step(7, {1e-3, 0, 0}, {1e-3, 0, 0});
  EXPECT_NEAR(told_n_s(7).x(), 2e-3, 1e-12);
}

TEST_F(HandImpulsesTest, APlaceIsKeptWhileItIsHeldOrTold) {
  const std::size_t held = impulses->hold(1000);
  step(1001, {1e-3, 0, 0}, {1e-3, 0, 0});
  const std::size_t told = impulses->hold(1001);
  impulses->release(told);
  for (std::uint32_t body = 0; body < 200; ++body) {
    const std::size_t place = impulses->hold(body);
    ASSERT_LT(place, HandImpulses::kPlaces);
    ASSERT_NE(place, held);
    ASSERT_NE(place, told);
    impulses->release(place);
  }
  EXPECT_NEAR(told_n_s(1001).x(), 1e-3, 1e-15);
}

// Of too many bodies at a time the last has no row. Its place may be another body's by the time that the force fades.
TEST_F(HandImpulsesTest, WhatFadesIsNotGivenToABodyThatHasTheOnesPlace) {
  constexpr std::uint32_t kLast = rtbus::kHandImpulseRows;
  impulses->begin(now_ns, now_ns + rtbus::kNsPerMs);
  now_ns += rtbus::kNsPerMs;
  for (std::uint32_t body = 0; body <= kLast; ++body) {
    impulses->give(impulses->hold(body), body, {1e-3, 0, 0}, Vector3d::Zero(), true);
  }
  impulses->settle({1e-3 * (kLast + 1), 0, 0});
  const std::size_t place = impulses->hold(kLast);
  impulses->release(place);
  std::uint32_t next = 1000;
  while (impulses->hold(next) != place) ASSERT_LT(++next, 1000 + HandImpulses::kPlaces);
  step(kLast, Vector3d::Zero(), {4e-4, 0, 0});
  EXPECT_TRUE(impulses->sum(place).is_zero());
  EXPECT_TRUE(impulses->entries().empty());
}

}  // namespace
