#include "haptic_node/rendering/impulse_history.hpp"
#include "rtbus/clock.hpp"

#include <gtest/gtest.h>

namespace {

using haptic::Impulse;
using haptic::ImpulseHistory;

Impulse along_x(double n_s) { return {{n_s, 0, 0}, {0, 0, 2 * n_s}}; }

/// Steps of 1 ms, each giving 1 mN s, from `first` ms to `last` ms.
double push(ImpulseHistory& history, double before_n_s, std::uint64_t first, std::uint64_t last,
            std::uint64_t apart_ns = 0) {
  for (std::uint64_t ms = first; ms < last; ++ms) {
    history.add(ms * rtbus::kNsPerMs, (ms + 1) * rtbus::kNsPerMs, apart_ns, along_x(before_n_s),
                along_x(before_n_s + 1e-3));
    before_n_s += 1e-3;
  }
  return before_n_s;
}

TEST(ImpulseHistory, IsTheSumWhereNothingWasGiven) {
  const ImpulseHistory history;
  EXPECT_EQ(history.at(5 * rtbus::kNsPerMs, along_x(0.0)).linear_n_s.x(), 0.0);
}

TEST(ImpulseHistory, GivesAStepsShareEvenlyAndStandsStillInBetween) {
  ImpulseHistory history;
  double sum = push(history, 0.0, 10, 20);
  sum = push(history, sum, 50, 60);
  const auto at = [&](double ms) { return history.at(static_cast<std::uint64_t>(ms * 1e6), along_x(sum)); };
  EXPECT_EQ(at(3).linear_n_s.x(), 0.0);
  EXPECT_EQ(at(10).linear_n_s.x(), 0.0);
  EXPECT_NEAR(at(12.5).linear_n_s.x(), 2.5e-3, 1e-15);
  EXPECT_NEAR(at(12.5).angular_n_m_s.z(), 5e-3, 1e-15);
  EXPECT_NEAR(at(20).linear_n_s.x(), 10e-3, 1e-15);
  EXPECT_NEAR(at(35).linear_n_s.x(), 10e-3, 1e-15) << "not a part of what came later";
  EXPECT_NEAR(at(50.25).linear_n_s.x(), 10.25e-3, 1e-15);
  EXPECT_NEAR(at(60).linear_n_s.x(), 20e-3, 1e-15);
  EXPECT_NEAR(at(90).linear_n_s.x(), 20e-3, 1e-15);
}

TEST(ImpulseHistory, PutsTheLastStepRight) {
  ImpulseHistory history;
  const double sum = push(history, 0.0, 0, 2);
  history.correct(2 * rtbus::kNsPerMs, along_x(-0.5e-3));
  history.correct(1 * rtbus::kNsPerMs, along_x(7.0));  // not the last step: it gave nothing
  EXPECT_NEAR(history.at(1'500'000, along_x(sum - 0.5e-3)).linear_n_s.x(), 1.25e-3, 1e-15);
}

TEST(ImpulseHistory, TakesTheContactsOfAStepTogether) {
  ImpulseHistory history;
  history.add(0, rtbus::kNsPerMs, 0, along_x(0.0), along_x(1e-3));
  history.add(0, rtbus::kNsPerMs, 0, along_x(1e-3), along_x(4e-3));
  EXPECT_NEAR(history.at(rtbus::kNsPerMs / 2, along_x(4e-3)).linear_n_s.x(), 2e-3, 1e-15);
}

TEST(ImpulseHistory, SharesARecordBetweenStepsThatAreNear) {
  ImpulseHistory history;
  // So many steps fit only because ten share a record.
  const double sum = push(history, 0.0, 0, 5000, 10 * rtbus::kNsPerMs);
  for (const std::uint64_t ms : {1ul, 155ul, 500ul, 4999ul}) {
    EXPECT_NEAR(history.at(ms * rtbus::kNsPerMs, along_x(sum)).linear_n_s.x(), 1e-3 * static_cast<double>(ms), 1e-12);
  }
}

TEST(ImpulseHistory, DoesNotShareARecordOverAGap) {
  ImpulseHistory history;
  double sum = push(history, 0.0, 0, 1, 100 * rtbus::kNsPerMs);
  sum = push(history, sum, 30, 31, 100 * rtbus::kNsPerMs);
  EXPECT_NEAR(history.at(20 * rtbus::kNsPerMs, along_x(sum)).linear_n_s.x(), 1e-3, 1e-15);
}

TEST(ImpulseHistory, SaysWhenSomethingWasGivenNext) {
  ImpulseHistory history;
  double sum = push(history, 0.0, 10, 20);
  sum = push(history, sum, 50, 60);
  const auto next_ms = [&](double ms) {
    return 1e-6 * static_cast<double>(history.first_after(static_cast<std::uint64_t>(ms * 1e6), 99 * rtbus::kNsPerMs));
  };
  EXPECT_EQ(next_ms(3), 10.0);
  EXPECT_EQ(next_ms(15.5), 15.5);
  EXPECT_EQ(next_ms(20), 50.0);
  EXPECT_EQ(next_ms(35), 50.0);
  EXPECT_EQ(next_ms(60), 99.0) << "nothing since";
}

// Three periods of physics at 5 Hz. A push that changes from step to step.
TEST(ImpulseHistory, KnowsEachTickOfSlowPhysics) {
  ImpulseHistory history;
  constexpr std::uint64_t kPeriod_ms = 200, kTicks = 3 * kPeriod_ms;
  constexpr std::uint64_t kApart_ns = kTicks * rtbus::kNsPerMs / ImpulseHistory::kSpan + 1;
  const auto sum_n_s = [](std::uint64_t ms) { return 1e-4 * static_cast<double>(ms * ms % 97); };
  for (std::uint64_t ms = 0; ms < 10 * kTicks; ++ms) {
    history.add(ms * rtbus::kNsPerMs, (ms + 1) * rtbus::kNsPerMs, kApart_ns, along_x(sum_n_s(ms)),
                along_x(sum_n_s(ms + 1)));
  }
  for (std::uint64_t ms = 9 * kTicks; ms < 10 * kTicks; ++ms) {
    ASSERT_NEAR(history.at(ms * rtbus::kNsPerMs, along_x(sum_n_s(10 * kTicks))).linear_n_s.x(), sum_n_s(ms), 1e-15);
  }
}

// Whatever the tick: of a loop at 10 kHz several share a record.
TEST(ImpulseHistory, ReachesBackAsFarAsItIsAskedTo) {
  constexpr std::uint64_t kTick_ns = 100 * rtbus::kNsPerUs;
  for (const std::uint64_t history_ms : {90u, 120u, 170u, 210u, 409u, 600u}) {
    for (const std::uint64_t phase : {0u, 1u, 2u, 3u}) {
      ImpulseHistory history;
      const std::uint64_t apart_ns = history_ms * rtbus::kNsPerMs / ImpulseHistory::kSpan + 1;
      const std::uint64_t ticks = 3 * history_ms * rtbus::kNsPerMs / kTick_ns + phase;
      const auto sum_n_s = [](std::uint64_t tick) { return 1e-6 * static_cast<double>(tick); };
      for (std::uint64_t i = 0; i < ticks; ++i) {
        history.add(i * kTick_ns, (i + 1) * kTick_ns, apart_ns, along_x(sum_n_s(i)), along_x(sum_n_s(i + 1)));
      }
      const std::uint64_t then = ticks - history_ms * rtbus::kNsPerMs / kTick_ns;
      EXPECT_NEAR(history.at(then * kTick_ns, along_x(sum_n_s(ticks))).linear_n_s.x(), sum_n_s(then), 1e-12)
          << history_ms << " ms, " << phase;
    }
  }
}

// Steps of a loop do not begin where the last one ended: clocks jitter, samples are repeated.
TEST(ImpulseHistory, TakesStepsThatDoNotQuiteFollow) {
  ImpulseHistory history;
  double sum = 0.0;
  for (std::uint64_t ms = 0; ms < 100; ++ms) {
    const std::uint64_t begin_ns = 1000 * rtbus::kNsPerMs + ms * rtbus::kNsPerMs;
    const std::uint64_t off_ns = 300 * rtbus::kNsPerUs;
    history.add(ms % 2 == 0 ? begin_ns - off_ns : begin_ns + off_ns, begin_ns + rtbus::kNsPerMs, 0, along_x(sum),
                along_x(sum + 1e-3));
    sum += 1e-3;
  }
  for (const std::uint64_t ms : {1u, 50u, 99u}) {
    EXPECT_NEAR(history.at((1000 + ms) * rtbus::kNsPerMs, along_x(sum)).linear_n_s.x(), 1e-3 * static_cast<double>(ms),
                1e-12);
  }
}

TEST(ImpulseHistory, PutsRightAStepThatSharesARecord) {
  ImpulseHistory history;
  double sum = push(history, 0.0, 0, 5, 10 * rtbus::kNsPerMs);
  history.correct(5 * rtbus::kNsPerMs, along_x(2e-3));
  sum = push(history, sum + 2e-3, 5, 8, 10 * rtbus::kNsPerMs);
  EXPECT_NEAR(history.at(8 * rtbus::kNsPerMs, along_x(sum)).linear_n_s.x(), 10e-3, 1e-15);
  EXPECT_NEAR(history.at(4 * rtbus::kNsPerMs, along_x(sum)).linear_n_s.x(), 5e-3, 1e-15) << "evenly";
}

TEST(ImpulseHistory, BeginsAnewWhenTimeGoesBack) {
  ImpulseHistory history;
  (void)push(history, 0.0, 100, 200);
  const double sum = push(history, 0.1, 10, 20);
  EXPECT_NEAR(history.at(15 * rtbus::kNsPerMs, along_x(sum)).linear_n_s.x(), 0.105, 1e-12);
}

TEST(ImpulseHistory, KeepsTheNewestAndTakesItsBeginningForWhatIsOlder) {
  ImpulseHistory history;
  constexpr std::uint64_t kSteps = 2000;
  const double sum = push(history, 0.0, 0, kSteps);
  EXPECT_NEAR(history.at(1500 * rtbus::kNsPerMs, along_x(sum)).linear_n_s.x(), 1.5, 1e-12);
  const double oldest_n_s = 1e-3 * static_cast<double>(kSteps - ImpulseHistory::kRecords + 1);
  EXPECT_NEAR(history.at(10 * rtbus::kNsPerMs, along_x(sum)).linear_n_s.x(), oldest_n_s, 1e-12);
  history.forget();
  EXPECT_EQ(history.at(10 * rtbus::kNsPerMs, along_x(0.0)).linear_n_s.x(), 0.0);
}

}  // namespace
