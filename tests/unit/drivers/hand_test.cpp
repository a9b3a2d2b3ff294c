// Every script against what its description promises.
#include "drivers/simulated/hand.hpp"
#include "rtbus/clock.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <numbers>

#include "drivers/simulated/mechanics.hpp"

namespace drivers::simulated {
namespace {

using Eigen::Vector3d;

// The velocity of a script has to be the derivative of its position, everywhere.
void expect_velocity_is_the_slope(const Hand& hand, std::uint64_t end_ns, double tolerance_m_s) {
  constexpr std::uint64_t kDt = 10'000;
  for (std::uint64_t t = rtbus::kNsPerMs; t < end_ns; t += 1'370'000) {
    const Vector3d slope = (hand.at(t + kDt).position_m - hand.at(t - kDt).position_m) / (2e-9 * kDt);
    ASSERT_LT((slope - hand.at(t).velocity_m_s).norm(), tolerance_m_s) << "at " << t << " ns";
  }
}

TEST(Hand, NoneNeverTouches) {
  const Hand hand;
  EXPECT_EQ(hand.at(0).grip, Grip::kNone);
  EXPECT_EQ(hand.at(rtbus::kNsPerS).grip, Grip::kNone);
}

TEST(Hand, HoldStaysAtItsPoint) {
  const Hand hand(HoldMotion{{0.01, 0.02, -0.03}}, {});
  for (const std::uint64_t t : {std::uint64_t{0}, rtbus::kNsPerMs, 100 * rtbus::kNsPerS}) {
    EXPECT_EQ(hand.at(t).grip, Grip::kSpring);
    EXPECT_EQ(hand.at(t).position_m, Vector3d(0.01, 0.02, -0.03));
    EXPECT_EQ(hand.at(t).velocity_m_s, Vector3d::Zero());
  }
}

TEST(Hand, PushWaitsMovesAtItsSpeedAndRests) {
  const Hand hand(PushMotion{{0, 0.02, 0}, {0, -1, 0}, 0.03, 0.05, 0.5, 0.1}, {});
  EXPECT_EQ(hand.at(500 * rtbus::kNsPerMs).position_m, Vector3d(0, 0.02, 0));
  EXPECT_EQ(hand.at(500 * rtbus::kNsPerMs).velocity_m_s, Vector3d::Zero());
  EXPECT_NEAR(hand.at(800 * rtbus::kNsPerMs).velocity_m_s.y(), -0.05, 1e-12);
  EXPECT_NEAR(hand.at(800 * rtbus::kNsPerMs).position_m.y(), 0.02 - 0.05 * (0.3 - 0.05), 1e-12);
  // 0.6 s at full speed plus one ramp's worth of time.
  EXPECT_NEAR(hand.at(1200 * rtbus::kNsPerMs).position_m.y(), -0.01, 1e-12);
  EXPECT_NEAR(hand.at(90 * rtbus::kNsPerS).position_m.y(), -0.01, 1e-12);
  EXPECT_EQ(hand.at(90 * rtbus::kNsPerS).velocity_m_s.norm(), 0.0);
  expect_velocity_is_the_slope(hand, 2 * rtbus::kNsPerS, 1e-5);
}

TEST(Hand, ShortPushStillArrives) {
  const Hand hand(PushMotion{Vector3d::Zero(), {1, 0, 0}, 0.001, 0.5, 0.0, 0.1}, {});
  EXPECT_NEAR(hand.at(rtbus::kNsPerS).position_m.x(), 0.001, 1e-15);
  EXPECT_LE(hand.at(2 * rtbus::kNsPerMs).velocity_m_s.x(), 0.5);
}

TEST(Hand, PushWithoutRampsArrivesAtRest) {
  const Hand hand(PushMotion{Vector3d::Zero(), {1, 0, 0}, 0.01, 0.1, 0.0, 0.0}, {});
  EXPECT_NEAR(hand.at(50 * rtbus::kNsPerMs).position_m.x(), 0.005, 1e-15);
  EXPECT_NEAR(hand.at(50 * rtbus::kNsPerMs).velocity_m_s.x(), 0.1, 1e-15);
  EXPECT_NEAR(hand.at(200 * rtbus::kNsPerMs).position_m.x(), 0.01, 1e-15);
  EXPECT_EQ(hand.at(200 * rtbus::kNsPerMs).velocity_m_s.x(), 0.0);
}

TEST(Hand, SinusoidSwingsAboutItsCentre) {
  const Hand hand(SinusoidMotion{{0, 0.01, 0}, {0, 0.02, 0.01}, 2.0, 0.5}, {});
  EXPECT_EQ(hand.at(0).position_m, Vector3d(0, 0.01, 0));
  EXPECT_LT(hand.at(0).velocity_m_s.norm(), 1e-12);          // begins gently
  const HandTarget crest = hand.at(1125 * rtbus::kNsPerMs);  // a quarter period after 1.0 s
  EXPECT_NEAR(crest.position_m.y(), 0.03, 1e-12);
  EXPECT_NEAR(crest.position_m.z(), 0.01, 1e-12);
  EXPECT_NEAR(hand.at(rtbus::kNsPerS).velocity_m_s.y(), 2.0 * std::numbers::pi * 2.0 * 0.02, 1e-9);
  expect_velocity_is_the_slope(hand, 2 * rtbus::kNsPerS, 1e-5);
}

TEST(Hand, DropHoldsRigidlyThenLetsFall) {
  const Hand hand(DropMotion{{0, 0.02, 0}, 0.3}, {});
  MechanicsParameters p;
  p.viscous_n_s_per_m = p.coulomb_n = 0.0;
  p.end_stops = false;
  Mechanics tip(p, hand);
  tip.begin_script(0);
  ASSERT_TRUE(tip.set_force({5.0, -5.0, 0.0}, 250 * rtbus::kNsPerMs));
  tip.advance_to(200 * rtbus::kNsPerMs);
  EXPECT_EQ(tip.position_m(), Vector3d(0, 0.02, 0));  // no force moves a rigid grip
  EXPECT_NEAR(tip.hand_force_n().y(), 5.0 + 0.041 * 9.81, 1e-12);
  tip.advance_to(300 * rtbus::kNsPerMs);
  EXPECT_EQ(tip.position_m(), Vector3d(0, 0.02, 0));
  tip.advance_to(400 * rtbus::kNsPerMs);
  EXPECT_EQ(tip.hand_force_n(), Vector3d::Zero());
  EXPECT_NEAR(tip.velocity_m_s().y(), -9.81 * 0.1, 1e-9);  // free for exactly 100 ms
  EXPECT_EQ(tip.position_m().x(), 0.0);
}

TEST(Hand, ScriptWaitsUntilItIsBegun) {
  Mechanics tip(MechanicsParameters{}, Hand(DropMotion{Vector3d::Zero(), 0.1}, {}));
  tip.advance_to(rtbus::kNsPerS);
  EXPECT_EQ(tip.position_m(), Vector3d::Zero());
  tip.begin_script(rtbus::kNsPerS);
  tip.advance_to(rtbus::kNsPerS + 110 * rtbus::kNsPerMs);
  EXPECT_LT(tip.position_m().y(), 0.0);
}

TEST(Hand, ButtonsFollowTheirScriptInOrderOfTime) {
  const Hand hand(NoHand{}, {}, {{0.5, 1, false}, {0.2, 1, true}, {0.3, 0, true}});
  EXPECT_EQ(hand.buttons(0), 0u);
  EXPECT_EQ(hand.buttons(199 * rtbus::kNsPerMs), 0u);
  EXPECT_EQ(hand.buttons(200 * rtbus::kNsPerMs), 2u);
  EXPECT_EQ(hand.buttons(400 * rtbus::kNsPerMs), 3u);
  EXPECT_EQ(hand.buttons(500 * rtbus::kNsPerMs), 1u);
  EXPECT_EQ(hand.buttons(5 * rtbus::kNsPerS), 1u);
}

}  // namespace
}  // namespace drivers::simulated
