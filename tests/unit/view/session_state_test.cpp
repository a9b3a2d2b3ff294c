// The state of a hand in a word.
#include "tools/view/session_state.hpp"

#include <gtest/gtest.h>

#include "haptic_node/safety.hpp"

namespace {

view::HandSigns healthy() {
  view::HandSigns signs;
  signs.name = "haptic0";
  signs.writer_alive = true;
  signs.tick_age_s = 0.001;
  signs.force_limit_n = 7.9;
  return signs;
}

TEST(HandState, IsNormalWhenNothingActs) {
  const view::HandState state = view::judge(healthy());
  EXPECT_EQ(state.word, "NORMAL");
  EXPECT_EQ(state.level, view::Level::kGood);
  EXPECT_EQ(state.reason, "");
}

TEST(HandState, SaysALossBeforeAnythingElse) {
  view::HandSigns signs = healthy();
  signs.safety = signs.recent_safety = haptic::kStale | haptic::kClamped | haptic::kRamping;
  signs.physics = "its process has ended";
  signs.gate = 0.3;
  EXPECT_EQ(view::judge(signs).word, "FADING");
  EXPECT_EQ(view::judge(signs).reason, "physics lost (its process has ended): the force fades to zero");
  signs.gate = 0.0;
  EXPECT_EQ(view::judge(signs).word, "LOST");
  EXPECT_EQ(view::judge(signs).level, view::Level::kBad);
}

TEST(HandState, AnEstopIsSaidWithItsReason) {
  view::HandSigns signs = healthy();
  signs.safety = haptic::kEstop | haptic::kStale;
  signs.gate = 0.5;
  signs.estop = "rtbus top";
  EXPECT_EQ(view::judge(signs).word, "E-STOP");
  EXPECT_EQ(view::judge(signs).reason, "the force fades to zero (rtbus top)");
  signs.gate = 0.0;
  EXPECT_EQ(view::judge(signs).reason, "no force until re-armed (rtbus top)");
  EXPECT_EQ(view::judge(signs).level, view::Level::kBad);
}

TEST(HandState, AClampOfOneTickStaysForAWhile) {
  view::HandSigns signs = healthy();
  signs.recent_safety = haptic::kClamped;
  EXPECT_EQ(view::judge(signs).word, "CLAMPED");
  EXPECT_EQ(view::judge(signs).reason, "the force reached the limit of 7.9 N");
}

TEST(HandState, ASilentLoopIsLostWhateverItSaidLast) {
  view::HandSigns signs = healthy();
  signs.tick_age_s = 0.2;
  EXPECT_EQ(view::judge(signs).word, "LOST");
  EXPECT_EQ(view::judge(signs).reason, "haptic0: no tick; its process is stopped or starved");
  signs.writer_alive = false;
  EXPECT_EQ(view::judge(signs).word, "LOST");
  signs.tick_age_s.reset();
  EXPECT_EQ(view::judge(signs).word, "STARTING");
}

TEST(HandState, EveryBitThatTakesTheForceAwayIsSaid) {
  for (const std::uint32_t bit :
       {haptic::kOverspeed, haptic::kStale, haptic::kNonfinite, haptic::kDeviceLost, haptic::kEstop, haptic::kDisabled,
        haptic::kRamping, haptic::kClamped, haptic::kThermalLimited}) {
    view::HandSigns signs = healthy();
    signs.safety = signs.recent_safety = bit;
    signs.gate = 0.0;
    EXPECT_NE(view::judge(signs).word, "NORMAL") << bit;
    EXPECT_NE(view::judge(signs).reason, "") << bit;
  }
}

}  // namespace
