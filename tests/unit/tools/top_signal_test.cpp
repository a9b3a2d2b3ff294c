#include "tools/cli/top/top_signal.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <numeric>

#include "haptic_node/safety.hpp"
#include "rtbus/clock.hpp"

namespace {

using rtbus::kNsPerMs;
using rtbus::kNsPerS;
using tools::RecentSignals;

rtbus::Telemetry tick(std::uint64_t number, double force_n = 0.0, std::uint32_t safety = 0) {
  rtbus::Telemetry out;
  out.tick = number;
  out.force_n = {0.0, force_n, 0.0};
  out.wakeup_us = 14.0;
  out.safety = safety;
  return out;
}

TEST(RecentSignals, KnowNothingBeforeTheFirstTick) { EXPECT_FALSE(RecentSignals().view(kNsPerS, 0).has_value()); }

TEST(RecentSignals, PutEachWakeUpIntoTheBinOfItsLateness) {
  RecentSignals signals;
  const double lateness_us[] = {0.0, 4.9, 5.0, 1999.0, 2000.0, 1e9, std::nan("")};
  std::uint64_t number = 0;
  for (const double us : lateness_us) {
    rtbus::Telemetry one = tick(++number);
    one.wakeup_us = us;
    signals.take(one, kNsPerS + number * kNsPerMs);
  }
  const auto view = signals.view(kNsPerS + 100 * kNsPerMs, 0).value();
  EXPECT_EQ(view.jitter, (tools::JitterBins{2, 1, 0, 0, 0, 0, 0, 0, 1, 3}));
  EXPECT_EQ(view.ticks, 7u);
}

TEST(RecentSignals, ForgetWakeUpsAfterTheWindowAlsoWhenNoTicksCome) {
  RecentSignals signals;
  signals.take(tick(1), 100 * kNsPerS);
  EXPECT_EQ(signals.view(109 * kNsPerS, 0)->ticks, 1u);
  EXPECT_EQ(signals.view(110 * kNsPerS, 0)->ticks, 0u);
}

TEST(RecentSignals, KeepTheLargestForceOfEachSlot) {
  RecentSignals signals;
  for (std::uint64_t i = 0; i < 300; ++i) signals.take(tick(i, i == 150 ? 3.0 : 1.0), kNsPerS + i * kNsPerMs);
  const auto view = signals.view(kNsPerS + 300 * kNsPerMs, 0).value();
  EXPECT_EQ(view.force_n, (std::vector<double>{1.0, 3.0, 1.0}));
}

TEST(RecentSignals, ShowSilenceAsAGap) {
  RecentSignals signals;
  signals.take(tick(1, 1.0), kNsPerS);
  signals.take(tick(2, 2.0), kNsPerS + 200 * kNsPerMs);
  const auto view = signals.view(kNsPerS + 400 * kNsPerMs, 0).value();
  ASSERT_EQ(view.force_n.size(), 4u);
  EXPECT_EQ(view.force_n[0], 1.0);
  EXPECT_TRUE(std::isnan(view.force_n[1]));
  EXPECT_EQ(view.force_n[2], 2.0);
  EXPECT_TRUE(std::isnan(view.force_n[3]));
  EXPECT_TRUE(std::isnan(view.position_m[3][0]));
}

TEST(RecentSignals, StayBoundedHoweverLongTheyRunOrPause) {
  RecentSignals signals;
  for (std::uint64_t i = 0; i < 2000; ++i) signals.take(tick(i), i * 100 * kNsPerMs);
  EXPECT_EQ(signals.view(200 * kNsPerS, 0)->force_n.size(), RecentSignals::kSlots);
  const auto later = signals.view(1'000'000 * kNsPerS, 0).value();
  EXPECT_LE(later.force_n.size(), RecentSignals::kSlots);
}

TEST(RecentSignals, LetAForceThatIsNoNumberStandOut) {
  RecentSignals signals;
  signals.take(tick(1, std::nan("")), kNsPerS);
  signals.take(tick(2, 1.0), kNsPerS + kNsPerMs);
  EXPECT_TRUE(std::isinf(signals.view(kNsPerS + 100 * kNsPerMs, 0)->force_n[0]));
}

TEST(RecentSignals, TimeACutAndNameItsReasons) {
  RecentSignals signals;
  signals.take(tick(1, 1.0, haptic::kSlewLimited), kNsPerS);
  EXPECT_FALSE(signals.view(kNsPerS, 0)->cut.has_value());  // a limit is not a cut
  for (std::uint64_t i = 0; i <= 50; ++i) {
    signals.take(tick(2 + i, 0.0, i < 20 ? haptic::kStale : haptic::kStale | haptic::kOverspeed),
                 2 * kNsPerS + i * kNsPerMs);
  }
  const auto during = signals.view(2 * kNsPerS + 50 * kNsPerMs, 0)->cut.value();
  EXPECT_TRUE(during.ongoing);
  signals.take(tick(60, 1.0), 2 * kNsPerS + 51 * kNsPerMs);
  const auto after = signals.view(3 * kNsPerS, 0)->cut.value();
  EXPECT_FALSE(after.ongoing);
  EXPECT_EQ(after.bits, haptic::kStale | haptic::kOverspeed);
  EXPECT_NEAR(after.began_ago_s, 1.0, 1e-9);
  EXPECT_NEAR(after.lasted_s, 0.05, 1e-9);
}

TEST(RecentSignals, BeginANewCutAfterARestart) {
  RecentSignals signals;
  signals.take(tick(1000, 0.0, haptic::kStale), kNsPerS);
  signals.take(tick(1, 0.0, haptic::kDisabled), 5 * kNsPerS);
  const auto cut = signals.view(6 * kNsPerS, 0)->cut.value();
  EXPECT_EQ(cut.bits, haptic::kDisabled);
  EXPECT_NEAR(cut.began_ago_s, 1.0, 1e-9);
}

}  // namespace
