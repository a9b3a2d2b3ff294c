#include "haptic_node/link_monitor.hpp"

#include <gtest/gtest.h>

namespace {

using haptic::LinkMonitor;
constexpr std::uint64_t kMs = rtbus::kNsPerMs;

rtbus::Heartbeat running(double period_s, double compute_s = 0.0) {
  rtbus::Heartbeat beat;
  beat.state = static_cast<std::uint32_t>(rtbus::NodeState::kRunning);
  beat.work_period_ns = static_cast<std::uint64_t>(period_s * 1e9);
  beat.work_compute_ns = static_cast<std::uint64_t>(compute_s * 1e9);
  return beat;
}

TEST(LinkMonitor, IsNotAliveBeforeBothSignsWereSeen) {
  LinkMonitor monitor({});
  EXPECT_FALSE(monitor.update(1000 * kMs));
  monitor.heartbeat(running(1e-3), 1000 * kMs);
  EXPECT_FALSE(monitor.update(1000 * kMs));
  monitor.proxy(1000 * kMs);
  EXPECT_TRUE(monitor.update(1000 * kMs));
  EXPECT_EQ(monitor.losses(), 0u);
}

TEST(LinkMonitor, DeclaresAStoppedProcessLostWithin60Ms) {
  LinkMonitor monitor({});
  monitor.heartbeat(running(1e-3), 1000 * kMs);
  monitor.proxy(1000 * kMs);
  std::uint64_t now = 1000 * kMs;
  while (monitor.update(now)) now += kMs;
  EXPECT_LE(now - 1000 * kMs, 60 * kMs);
  EXPECT_GE(now - 1000 * kMs, 41 * kMs) << "two missed beats are not a loss";
  EXPECT_EQ(monitor.losses(), 1u);
  EXPECT_EQ(monitor.last_loss_ns(), now);
}

TEST(LinkMonitor, DeclaresAHungEngineLostThoughItsHeartBeats) {
  LinkMonitor monitor({});
  monitor.proxy(1000 * kMs);
  std::uint64_t now = 1000 * kMs;
  do {
    now += kMs;
    monitor.heartbeat(running(1e-3), now);
  } while (monitor.update(now));
  EXPECT_NEAR(static_cast<double>(now - 1000 * kMs) * 1e-6, 101.0, 1.0);
}

TEST(LinkMonitor, WaitsForASlowEngine) {
  LinkMonitor monitor({});
  monitor.proxy(1000 * kMs);
  monitor.heartbeat(running(0.2, 0.15), 1640 * kMs);
  EXPECT_TRUE(monitor.update(1640 * kMs)) << "5 Hz and 150 ms of work: 650 ms are normal";
  monitor.heartbeat(running(0.2, 0.15), 1660 * kMs);
  EXPECT_FALSE(monitor.update(1660 * kMs));
}

TEST(LinkMonitor, TakesAFarewellAtOnce) {
  LinkMonitor monitor({});
  monitor.heartbeat(running(1e-3), 1000 * kMs);
  monitor.proxy(1000 * kMs);
  ASSERT_TRUE(monitor.update(1001 * kMs));
  rtbus::Heartbeat farewell = running(1e-3);
  farewell.state = static_cast<std::uint32_t>(rtbus::NodeState::kStopping);
  monitor.heartbeat(farewell, 1002 * kMs);
  EXPECT_FALSE(monitor.update(1002 * kMs));
}

TEST(LinkMonitor, ComesBackAndCountsEachLossOnce) {
  LinkMonitor monitor({});
  for (int round = 0; round < 3; ++round) {
    const std::uint64_t now = (1000 + 500 * static_cast<std::uint64_t>(round)) * kMs;
    monitor.heartbeat(running(1e-3), now);
    monitor.proxy(now);
    EXPECT_TRUE(monitor.update(now));
    EXPECT_FALSE(monitor.update(now + 200 * kMs));
    EXPECT_FALSE(monitor.update(now + 201 * kMs));
  }
  EXPECT_EQ(monitor.losses(), 3u);
}

}  // namespace
