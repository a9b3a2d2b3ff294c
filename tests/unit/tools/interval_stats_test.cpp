#include "tools/cli/topics/interval_stats.hpp"
#include "rtbus/clock.hpp"

#include <gtest/gtest.h>

#include "tools/cli/topics/topic_rate.hpp"

namespace {

TEST(IntervalStats, HasNoRateBeforeTwoSamples) {
  tools::IntervalStats stats;
  EXPECT_EQ(stats.rate_hz(), 0.0);
  stats.add(1, 5 * rtbus::kNsPerMs);
  EXPECT_EQ(stats.rate_hz(), 0.0);
  EXPECT_EQ(stats.intervals(), 0u);
}

TEST(IntervalStats, KnowsMeanExtremesAndDeviation) {
  tools::IntervalStats stats;
  for (const std::uint64_t stamp_ms : {0u, 1u, 3u, 6u})
    stats.add(stamp_ms == 0 ? 1 : stats.samples() + 1, stamp_ms * rtbus::kNsPerMs);
  EXPECT_DOUBLE_EQ(stats.rate_hz(), 500.0);  // three periods in 6 ms
  EXPECT_DOUBLE_EQ(stats.min_s(), 0.001);
  EXPECT_DOUBLE_EQ(stats.max_s(), 0.003);
  EXPECT_DOUBLE_EQ(stats.mean_s(), 0.002);
  EXPECT_DOUBLE_EQ(stats.jitter_s(), 0.001);
}

TEST(IntervalStats, DoesNotTakeAGapForASlowPeriod) {
  tools::IntervalStats stats;
  stats.add(1, 0);
  stats.add(2, 1 * rtbus::kNsPerMs);
  stats.add(6, 5 * rtbus::kNsPerMs);  // 3, 4 and 5 were overwritten before they were read
  EXPECT_EQ(stats.missed(), 3u);
  EXPECT_EQ(stats.intervals(), 1u);
  EXPECT_DOUBLE_EQ(stats.max_s(), 0.001);
  EXPECT_DOUBLE_EQ(stats.rate_hz(), 1000.0);  // what was published, not what was read
}

TEST(IntervalStats, BeginsAnewWhenTheTopicDoes) {
  tools::IntervalStats stats;
  stats.add(100, 100 * rtbus::kNsPerMs);
  stats.add(101, 101 * rtbus::kNsPerMs);
  stats.add(1, 500 * rtbus::kNsPerMs);
  stats.add(2, 501 * rtbus::kNsPerMs);
  EXPECT_EQ(stats.missed(), 0u);
  EXPECT_EQ(stats.intervals(), 2u);
  EXPECT_DOUBLE_EQ(stats.rate_hz(), 1000.0);
}

TEST(IntervalStats, ANewWindowStillKnowsTheSampleBefore) {
  tools::IntervalStats stats;
  stats.add(1, 0);
  stats.add(2, 10 * rtbus::kNsPerMs);
  stats.begin_window();
  EXPECT_EQ(stats.rate_hz(), 0.0);
  stats.add(3, 12 * rtbus::kNsPerMs);
  EXPECT_EQ(stats.intervals(), 1u);
  EXPECT_DOUBLE_EQ(stats.rate_hz(), 500.0);
}

TEST(IntervalStats, KeepsItsPrecisionOverAnHourAtOneKilohertz) {
  tools::IntervalStats stats;
  std::uint64_t stamp_ns = 0;
  for (std::uint64_t i = 0; i < 3'600'000; ++i) {
    stamp_ns += i % 2 == 0 ? 999'000 : 1'001'000;
    stats.add(i + 1, stamp_ns);
  }
  EXPECT_NEAR(stats.jitter_s(), 1e-6, 1e-11);
}

tools::IntervalStats at_1_khz() {
  tools::IntervalStats stats;
  for (std::uint64_t i = 1; i <= 100; ++i) stats.add(i, i * rtbus::kNsPerMs);
  return stats;
}

TEST(JudgeRate, IsTheRateOfWhatIsHeldWhileSamplesCome) {
  const auto rate = tools::judge_rate(at_1_khz(), 100 * rtbus::kNsPerMs, 101 * rtbus::kNsPerMs);
  EXPECT_NEAR(rate.rate_hz.value(), 1000.0, 1e-6);
  EXPECT_DOUBLE_EQ(rate.age_s.value(), 0.001);
}

TEST(JudgeRate, IsZeroWhenTheWriterHasFallenSilent) {
  EXPECT_EQ(tools::judge_rate(at_1_khz(), 100 * rtbus::kNsPerMs, 400 * rtbus::kNsPerMs).rate_hz.value(), 0.0);
}

TEST(JudgeRate, GivesASlowTopicItsTime) {
  tools::IntervalStats once_a_second;
  for (std::uint64_t i = 1; i <= 4; ++i) once_a_second.add(i, i * 1000 * rtbus::kNsPerMs);
  EXPECT_DOUBLE_EQ(tools::judge_rate(once_a_second, 4000 * rtbus::kNsPerMs, 4900 * rtbus::kNsPerMs).rate_hz.value(),
                   1.0);
}

TEST(JudgeRate, KnowsNothingOfAnEmptyTopic) {
  const auto rate = tools::judge_rate({}, 0, 100 * rtbus::kNsPerMs);
  EXPECT_FALSE(rate.rate_hz.has_value());
  EXPECT_FALSE(rate.age_s.has_value());
}

}  // namespace
