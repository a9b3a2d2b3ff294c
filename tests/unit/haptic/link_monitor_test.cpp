#include "haptic_node/link_monitor.hpp"
#include "rtbus/clock.hpp"

#include <gtest/gtest.h>

namespace {

using haptic::LinkMonitor;
rtbus::Heartbeat running(double period_s, double compute_s = 0.0) {
  rtbus::Heartbeat beat;
  beat.state = static_cast<std::uint32_t>(rtbus::NodeState::kRunning);
  beat.work_period_ns = static_cast<std::uint64_t>(period_s * 1e9);
  beat.work_compute_ns = static_cast<std::uint64_t>(compute_s * 1e9);
  return beat;
}

TEST(LinkMonitor, IsNotAliveBeforeBothSignsWereSeen) {
  LinkMonitor monitor({});
  EXPECT_FALSE(monitor.update(1000 * rtbus::kNsPerMs));
  monitor.heartbeat(running(1e-3), 1000 * rtbus::kNsPerMs);
  EXPECT_FALSE(monitor.update(1000 * rtbus::kNsPerMs));
  monitor.proxy(1000 * rtbus::kNsPerMs);
  EXPECT_TRUE(monitor.update(1000 * rtbus::kNsPerMs));
  EXPECT_EQ(monitor.losses(), 0u);
}

TEST(LinkMonitor, DeclaresAStoppedProcessLostWithin60Ms) {
  LinkMonitor monitor({});
  monitor.heartbeat(running(1e-3), 1000 * rtbus::kNsPerMs);
  monitor.proxy(1000 * rtbus::kNsPerMs);
  std::uint64_t now = 1000 * rtbus::kNsPerMs;
  while (monitor.update(now)) now += rtbus::kNsPerMs;
  EXPECT_LE(now - 1000 * rtbus::kNsPerMs, 60 * rtbus::kNsPerMs);
  EXPECT_GE(now - 1000 * rtbus::kNsPerMs, 41 * rtbus::kNsPerMs) << "two missed beats are not a loss";
  EXPECT_EQ(monitor.losses(), 1u);
  EXPECT_EQ(monitor.last_loss_ns(), now);
}

TEST(LinkMonitor, DeclaresAHungEngineLostThoughItsHeartBeats) {
  LinkMonitor monitor({});
  monitor.proxy(1000 * rtbus::kNsPerMs);
  std::uint64_t now = 1000 * rtbus::kNsPerMs;
  do {
    now += rtbus::kNsPerMs;
    monitor.heartbeat(running(1e-3), now);
  } while (monitor.update(now));
  EXPECT_NEAR(static_cast<double>(now - 1000 * rtbus::kNsPerMs) * 1e-6, 99.0, 1.0);
}

TEST(LinkMonitor, WaitsForASlowEngine) {
  LinkMonitor monitor({});
  monitor.proxy(1000 * rtbus::kNsPerMs);
  monitor.heartbeat(running(0.2, 0.15), 1640 * rtbus::kNsPerMs);
  EXPECT_TRUE(monitor.update(1640 * rtbus::kNsPerMs)) << "5 Hz and 150 ms of work: 650 ms are normal";
  monitor.heartbeat(running(0.2, 0.15), 1660 * rtbus::kNsPerMs);
  EXPECT_FALSE(monitor.update(1660 * rtbus::kNsPerMs));
}

TEST(LinkMonitor, GivesAStepThatTookTooLongNoMoreTimeForTheNext) {
  LinkMonitor monitor({});
  // Declared 1 kHz; the last step took 2 s, and so does the one under way.
  monitor.proxy(1000 * rtbus::kNsPerMs);
  std::uint64_t now = 1000 * rtbus::kNsPerMs;
  do {
    now += rtbus::kNsPerMs;
    monitor.heartbeat(running(1e-3, 2.0), now);
  } while (monitor.update(now) && now < 3000 * rtbus::kNsPerMs);
  EXPECT_NEAR(static_cast<double>(now - 1000 * rtbus::kNsPerMs) * 1e-6, 99.0, 1.0);
  EXPECT_TRUE(monitor.too_far_behind(501 * rtbus::kNsPerMs)) << "nor may its answers be older";
}

// 500 ms there and back, 30 % lost: gaps of 150 ms are normal, and so are answers to a hand of 0.6 s ago. A process
// that is gone is lost all the same.
TEST(LinkMonitor, BearsANetworkThatItKnows) {
  const haptic::LinkMonitorConfig config = haptic::across_network({}, 0.5);
  LinkMonitor near({}), far(config);
  const std::uint64_t began = 1000 * rtbus::kNsPerMs, later = 1150 * rtbus::kNsPerMs;
  for (LinkMonitor* each : {&near, &far}) {
    each->heartbeat(running(0.01), began);
    each->proxy(began);
  }
  EXPECT_FALSE(near.update(later));
  EXPECT_TRUE(far.update(later));
  far.behind(600 * rtbus::kNsPerMs);
  EXPECT_TRUE(far.update(later));
  std::uint64_t now = began;
  while (far.update(now)) now += rtbus::kNsPerMs;
  EXPECT_LE(now - began, 451 * rtbus::kNsPerMs);
  // Slow physics has the time of ten steps, as some of them never arrive.
  far.heartbeat(running(0.1), began);
  EXPECT_NEAR(far.step_age_limit_s(), 1.0, 1e-9);
  EXPECT_GE(config.min_answer_age_s, 1.5);
}

TEST(LinkMonitor, TakesAFarewellAtOnce) {
  LinkMonitor monitor({});
  monitor.heartbeat(running(1e-3), 1000 * rtbus::kNsPerMs);
  monitor.proxy(1000 * rtbus::kNsPerMs);
  ASSERT_TRUE(monitor.update(1001 * rtbus::kNsPerMs));
  rtbus::Heartbeat farewell = running(1e-3);
  farewell.state = static_cast<std::uint32_t>(rtbus::NodeState::kStopping);
  monitor.heartbeat(farewell, 1002 * rtbus::kNsPerMs);
  EXPECT_FALSE(monitor.update(1002 * rtbus::kNsPerMs));
}

TEST(LinkMonitor, BelievesNobodyForAWhileAfterASampleThatWasRefused) {
  LinkMonitor monitor({});
  const auto alive_at = [&](std::uint64_t now_ms) {
    monitor.heartbeat(running(1e-3), now_ms * rtbus::kNsPerMs);
    monitor.proxy(now_ms * rtbus::kNsPerMs);
    return monitor.update(now_ms * rtbus::kNsPerMs);
  };
  ASSERT_TRUE(alive_at(1000));
  monitor.refused(1001 * rtbus::kNsPerMs);
  EXPECT_FALSE(alive_at(1001));
  EXPECT_EQ(monitor.losses(), 1u);
  EXPECT_FALSE(alive_at(1050));
  EXPECT_TRUE(alive_at(1052));
}

/// Alive or not, with an answer of now to a hand of so long ago.
bool alive_behind(LinkMonitor& monitor, double behind_s, double period_s, double compute_s = 0.0) {
  constexpr std::uint64_t kNow_ns = 100'000 * rtbus::kNsPerMs;
  monitor.heartbeat(running(period_s, compute_s), kNow_ns);
  monitor.proxy(kNow_ns);
  monitor.behind(static_cast<std::uint64_t>(behind_s * 1e9));
  return monitor.update(kNow_ns);
}

TEST(LinkMonitor, DeclaresAPhysicsLostThatAnswersAHandOfLongAgo) {
  LinkMonitor monitor({});
  EXPECT_TRUE(alive_behind(monitor, 0.49, 1e-3)) << "a link may delay";
  EXPECT_FALSE(alive_behind(monitor, 0.51, 1e-3));
  EXPECT_TRUE(monitor.lags());
  EXPECT_FALSE(alive_behind(monitor, 2.0, 1e-3));
  EXPECT_EQ(monitor.losses(), 1u);
  EXPECT_TRUE(alive_behind(monitor, 0.002, 1e-3)) << "it has caught up";
  EXPECT_FALSE(monitor.lags());
}

TEST(LinkMonitor, GivesSlowPhysicsTheTimeOfItsSteps) {
  for (const double period_s : {1.0 / 9.0, 0.2, 1.0}) {
    LinkMonitor monitor({});
    // Waited for a period, computed for one, held for one.
    EXPECT_TRUE(alive_behind(monitor, 3.0 * period_s, period_s, period_s)) << period_s;
    EXPECT_FALSE(alive_behind(monitor, 8.0 * period_s, period_s, period_s)) << period_s;
  }
}

TEST(LinkMonitor, ComesBackAndCountsEachLossOnce) {
  LinkMonitor monitor({});
  for (int round = 0; round < 3; ++round) {
    const std::uint64_t now = (1000 + 500 * static_cast<std::uint64_t>(round)) * rtbus::kNsPerMs;
    monitor.heartbeat(running(1e-3), now);
    monitor.proxy(now);
    EXPECT_TRUE(monitor.update(now));
    EXPECT_FALSE(monitor.update(now + 200 * rtbus::kNsPerMs));
    EXPECT_FALSE(monitor.update(now + 201 * rtbus::kNsPerMs));
  }
  EXPECT_EQ(monitor.losses(), 3u);
}

}  // namespace
