// When the counters are believed, and when they are no longer.
#include "drivers/phantom/homing.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/unit/phantom/rig.hpp"

namespace drivers::phantom {
namespace {

using testing::kMs;
using testing::model;
using Verdict = Homing::Verdict;

class HomingTest : public ::testing::Test {
 protected:
  Homing make(HomingMode mode) { return Homing(Kinematics(model(ModelId::kVintage)), mode, 0.05); }
  // Stays at `counts` for that long, at 1 kHz. @returns the last verdict.
  Verdict stay(Homing& homing, const Counts& counts, int ms, bool possible = true) {
    Verdict last = Verdict::kNotHomed;
    for (int i = 0; i < ms; ++i) last = homing.update(now_ns_ += kMs, counts, possible);
    return last;
  }
  // Moves there at about 3 rad/s.
  void go(Homing& homing, Counts from, const Counts& to) {
    for (bool there = false; !there;) {
      there = true;
      for (std::size_t i = 0; i < 3; ++i) {
        const int step = std::clamp(to[i] - from[i], -15, 15);
        from[i] += step;
        there = there && step == 0;
      }
      homing.update(now_ns_ += kMs, from, true);
    }
  }
  std::uint64_t now_ns_ = 0;
};

TEST_F(HomingTest, AtStartTakesAnArmHeldAtZero) {
  Homing homing = make(HomingMode::kAtStart);
  homing.begin(now_ns_, {10, -5, 3});
  EXPECT_EQ(stay(homing, {10, -5, 3}, 290), Verdict::kNotHomed);
  EXPECT_EQ(stay(homing, {10, -5, 3}, 20), Verdict::kHomed);
}

TEST_F(HomingTest, AtStartWaitsForAnArmThatIsElsewhereAndSaysSo) {
  Homing homing = make(HomingMode::kAtStart);
  homing.begin(now_ns_, {2000, 0, 0});
  EXPECT_EQ(stay(homing, {2000, 0, 0}, 1000), Verdict::kNotHomed);
  EXPECT_THAT(homing.remedy(), ::testing::HasSubstr("bring the arm home, with the upper arm horizontal"));
  go(homing, {2000, 0, 0}, {0, 0, 0});
  EXPECT_EQ(stay(homing, {0, 0, 0}, 310), Verdict::kHomed);
}

TEST_F(HomingTest, EveryWordAboutTheButtonSaysWhereTheArmHasToBe) {
  for (const Model& each : models()) {
    const Homing homing(Kinematics(each), HomingMode::kButton, 0.05);
    EXPECT_THAT(homing.remedy(), ::testing::HasSubstr("at home, " + std::string(each.home)));
    EXPECT_THAT(homing.remedy(), ::testing::HasSubstr("in any other pose"));
    EXPECT_FALSE(each.home.empty());
  }
}

TEST_F(HomingTest, PassingThroughHomeIsNotHoldingThere) {
  Homing homing = make(HomingMode::kAtStart);
  homing.begin(now_ns_, {2000, 0, 0});
  for (int i = 0; i < 20; ++i) {
    go(homing, {2000, 0, 0}, {0, 0, 0});
    EXPECT_EQ(stay(homing, {0, 0, 0}, 100), Verdict::kNotHomed);
    go(homing, {0, 0, 0}, {2000, 0, 0});
  }
  EXPECT_FALSE(homing.homed());
}

TEST_F(HomingTest, ButtonIsAJumpOntoZero) {
  Homing homing = make(HomingMode::kButton);
  homing.begin(now_ns_, {0, 0, 0});
  EXPECT_EQ(stay(homing, {0, 0, 0}, 1000), Verdict::kNotHomed);  // where it was plugged in: means nothing
  go(homing, {0, 0, 0}, {1500, -800, 300});
  EXPECT_EQ(stay(homing, {0, 0, 0}, 1), Verdict::kGlitch);  // one answer could be damaged
  EXPECT_EQ(stay(homing, {0, 0, 0}, 290), Verdict::kNotHomed);
  EXPECT_EQ(stay(homing, {2, 0, -1}, 20), Verdict::kHomed);
}

TEST_F(HomingTest, ComingBackToZeroByHandIsNotTheButton) {
  Homing homing = make(HomingMode::kButton);
  homing.begin(now_ns_, {0, 0, 0});
  go(homing, {0, 0, 0}, {1500, -800, 300});
  go(homing, {1500, -800, 300}, {0, 0, 0});
  EXPECT_EQ(stay(homing, {0, 0, 0}, 2000), Verdict::kNotHomed);
  EXPECT_THAT(homing.remedy(), ::testing::HasSubstr("press the calibration button"));
}

TEST_F(HomingTest, CountersAreTakenAsTheyAre) {
  Homing homing = make(HomingMode::kCounters);
  homing.begin(now_ns_, {1500, -800, 300});
  EXPECT_EQ(stay(homing, {1500, -800, 300}, 1), Verdict::kHomed);
}

TEST_F(HomingTest, AfterALossCountersThatGoOnAreBelieved) {
  Homing homing = make(HomingMode::kAtStart);
  homing.begin(now_ns_, {0, 0, 0});
  stay(homing, {0, 0, 0}, 400);
  go(homing, {0, 0, 0}, {1500, -800, 300});
  ASSERT_TRUE(homing.homed());
  homing.lost();
  homing.begin(now_ns_ += 500 * kMs, {1480, -790, 310});
  EXPECT_TRUE(homing.homed());
}

TEST_F(HomingTest, AfterALossCountersNearZeroNeedTheButtonInEveryMode) {
  for (const HomingMode mode : {HomingMode::kAtStart, HomingMode::kButton, HomingMode::kCounters}) {
    Homing homing = make(mode);
    homing.begin(now_ns_, {1500, -800, 300});
    if (mode != HomingMode::kCounters) {
      stay(homing, {1500, -800, 300}, 2);
      stay(homing, {0, 0, 0}, 400);  // the button (where it was plugged in, zero was somewhere else)
    }
    ASSERT_TRUE(homing.homed());
    homing.lost();
    homing.begin(now_ns_ += 500 * kMs, {0, 0, 0});
    EXPECT_EQ(stay(homing, {0, 0, 0}, 2000), Verdict::kNotHomed);
    EXPECT_THAT(homing.remedy(), ::testing::HasSubstr("without power"));
    // A second gap does not launder it.
    homing.begin(now_ns_ += 500 * kMs, {0, 0, 0});
    EXPECT_EQ(stay(homing, {0, 0, 0}, 2000), Verdict::kNotHomed);
    go(homing, {0, 0, 0}, {1500, -800, 300});
    EXPECT_FALSE(homing.homed());
    EXPECT_EQ(stay(homing, {0, 0, 0}, 310), Verdict::kHomed);  // the button
  }
}

TEST_F(HomingTest, OneDamagedAnswerIsAGlitchTwoAreAJump) {
  Homing homing = make(HomingMode::kCounters);
  homing.begin(now_ns_, {1500, -800, 300});
  ASSERT_EQ(stay(homing, {1500, -800, 300}, 10), Verdict::kHomed);
  EXPECT_EQ(stay(homing, {1500, -80000, 300}, 1), Verdict::kGlitch);
  EXPECT_EQ(stay(homing, {1500, -800, 300}, 1), Verdict::kHomed);
  EXPECT_EQ(stay(homing, {1500, -80000, 300}, 1), Verdict::kGlitch);
  EXPECT_EQ(stay(homing, {1500, -80000, 300}, 1), Verdict::kNotHomed);
  EXPECT_THAT(homing.remedy(), ::testing::HasSubstr("jumped"));
}

TEST_F(HomingTest, ImpossiblePosesEndTheBelief) {
  Homing homing = make(HomingMode::kCounters);
  homing.begin(now_ns_, {1500, -800, 300});
  ASSERT_EQ(stay(homing, {1500, -800, 300}, 10), Verdict::kHomed);
  EXPECT_EQ(stay(homing, {1500, -800, 300}, Homing::kImpossiblePoses - 1, false), Verdict::kHomed);
  EXPECT_EQ(stay(homing, {1500, -800, 300}, 1, false), Verdict::kNotHomed);
  EXPECT_THAT(homing.remedy(), ::testing::HasSubstr("cannot have"));
  // Held at zero in an impossible pose is not home.
  Homing at_start = make(HomingMode::kAtStart);
  at_start.begin(now_ns_, {0, 0, 0});
  EXPECT_EQ(stay(at_start, {0, 0, 0}, 1000, false), Verdict::kNotHomed);
}

TEST_F(HomingTest, WrapAroundCountersAreAJumpNotACrash) {
  Homing homing = make(HomingMode::kCounters);
  homing.begin(now_ns_, {2147483647, 0, 0});
  EXPECT_EQ(homing.update(now_ns_ += kMs, {-2147483647 - 1, 0, 0}, true), Verdict::kGlitch);
}

}  // namespace
}  // namespace drivers::phantom
