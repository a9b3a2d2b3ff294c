// The clock of a recording.
#include "tools/view/playback.hpp"

#include <gtest/gtest.h>

#include "rtbus/clock.hpp"

namespace {

using nlohmann::json;
using view::Playback;

constexpr std::uint64_t kBegin_ns = 1000 * rtbus::kNsPerS, kFrame_ns = rtbus::kNsPerS / 50;

/// Plays for `frames` frames of 20 ms.
void play(Playback& playback, int frames) {
  static std::uint64_t now_ns = kBegin_ns;
  playback.advance(now_ns);
  for (int i = 0; i < frames; ++i) playback.advance(now_ns += kFrame_ns);
}

TEST(Playback, PlaysAtItsSpeedUpToTheEnd) {
  Playback playback(10.0);
  play(playback, 50);
  EXPECT_NEAR(playback.at_s(), 1.0, 1e-9);
  playback.take({{"speed", 0.01}}, kBegin_ns);
  play(playback, 50);
  EXPECT_NEAR(playback.at_s(), 1.01, 1e-3);
  playback.take({{"speed", 1000}}, kBegin_ns);
  EXPECT_EQ(playback.speed(), Playback::kFastest);
  play(playback, 500);
  EXPECT_EQ(playback.at_s(), 10.0);
  EXPECT_FALSE(playback.playing());
}

TEST(Playback, StandsAndJumps) {
  Playback playback(10.0);
  const std::uint32_t jumps = playback.jumps();
  playback.take({{"at", 4.5}, {"playing", false}}, kBegin_ns);
  play(playback, 100);
  EXPECT_EQ(playback.at_s(), 4.5);
  EXPECT_NE(playback.jumps(), jumps);
  playback.take({{"at", 99}}, kBegin_ns);
  EXPECT_EQ(playback.at_s(), 10.0);
  playback.take({{"playing", true}}, kBegin_ns);  // from the end: again from the beginning
  EXPECT_EQ(playback.at_s(), 0.0);
}

TEST(Playback, StepsOnce) {
  Playback playback(10.0);
  playback.take({{"step", 3}}, kBegin_ns);
  EXPECT_FALSE(playback.playing());
  EXPECT_EQ(playback.take_steps(), 3);
  EXPECT_EQ(playback.take_steps(), 0);
}

TEST(Playback, NonsenseChangesNothing) {
  Playback playback(10.0);
  for (const nlohmann::json& each : {json(5), json::array(), json{{"speed", "fast"}}, json{{"at", nullptr}},
                                     json{{"playing", 1}}, json{{"step", json::array()}}}) {
    playback.take(each, kBegin_ns);
    EXPECT_EQ(playback.speed(), 1.0) << each;
    EXPECT_EQ(playback.at_s(), 0.0) << each;
    EXPECT_EQ(playback.take_steps(), 0) << each;
  }
}

}  // namespace
