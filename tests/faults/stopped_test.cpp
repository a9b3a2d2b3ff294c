/// The nodes without a supervisor, and what the loop and the hand see when one of them is stopped. Times are the
/// machine's own: where it paused (a late wake-up of the haptic loop), the bound grows by that pause and by nothing
/// else.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdio>

#include "tests/support/nodes.hpp"

namespace {

using namespace tests;

constexpr std::uint32_t kStaleBit = 1u << 5;  // haptic::kStale, as docs/safety.md lists the bits

/// What a loss looked like in the telemetry.
struct Loss {
  double declared_ms = -1.0;  ///< After the fault.
  double zero_ms = -1.0;      ///< Force at zero, after the declaration.
  double worst_wakeup_ms = 0.0;
};

Loss watch_loss(Reader<Telemetry>& ticks, std::uint64_t fault_ns, double watch_s) {
  Loss out;
  std::uint64_t declared_ns = 0;
  const std::uint64_t end_ns = rtbus::monotonic_ns() + static_cast<std::uint64_t>(watch_s * 1e9);
  while (rtbus::monotonic_ns() < end_ns) {
    Stamped<Telemetry> tick;
    while (ticks.read_next(tick) == ReadStatus::kFresh) {
      if (tick.stamp_ns < fault_ns) continue;
      if (out.zero_ms < 0.0) out.worst_wakeup_ms = std::max(out.worst_wakeup_ms, tick.value.wakeup_us * 1e-3);
      if (declared_ns == 0 && (tick.value.safety & kStaleBit) != 0) {
        declared_ns = tick.stamp_ns;
        out.declared_ms = static_cast<double>(tick.stamp_ns - fault_ns) * 1e-6;
      }
      if (declared_ns != 0 && out.zero_ms < 0.0 && norm(tick.value.force_n) == 0.0) {
        out.zero_ms = static_cast<double>(tick.stamp_ns - declared_ns) * 1e-6;
      }
    }
    usleep(5000);
  }
  return out;
}

TEST_F(Nodes, FadeToZeroWhilePhysicsIsStoppedAndResumeSlewLimited) {
  start_physics();
  start_haptic();
  auto ticks = reader<Telemetry>("haptic0.telemetry");
  ASSERT_TRUE(ticks);
  ASSERT_TRUE(follow(*ticks, 8.0, [](const auto& t) { return t.value.gate >= 1.0 && norm(t.value.force_n) > 0.2; }))
      << "the tip should rest on the wall";

  physics_->signal(SIGSTOP);
  const std::uint64_t stopped_ns = rtbus::monotonic_ns();
  Stamped<rtbus::LoopStats> before;
  Stamped<rtbus::LoopStats> after;
  auto stats = reader<rtbus::LoopStats>("haptic0.loop_stats");
  ASSERT_TRUE(stats);
  (void)stats->read_latest(before);
  const Loss loss = watch_loss(*ticks, stopped_ns, 5.0);
  (void)stats->read_latest(after);
  const double seconds = static_cast<double>(after.stamp_ns - before.stamp_ns) * 1e-9;
  const double served = static_cast<double>(after.value.ticks - before.value.ticks) / seconds;
  const double due = static_cast<double>(after.value.ticks_due - before.value.ticks_due) / seconds;
  std::printf(
      "stopped 5 s: lost after %.1f ms, zero %.1f ms later, worst wake-up %.2f ms, %.1f ticks/s served of %.1f due\n",
      loss.declared_ms, loss.zero_ms, loss.worst_wakeup_ms, served, due);
  EXPECT_GT(loss.declared_ms, 0.0);
  EXPECT_LE(loss.declared_ms, 60.0 + loss.worst_wakeup_ms);
  EXPECT_GE(loss.zero_ms, 0.0);
  EXPECT_LE(loss.zero_ms, 41.0 + loss.worst_wakeup_ms);
  EXPECT_NEAR(due, 1000.0, 5.0) << "the loop keeps its rate whether physics lives or not";

  // Resumption: never faster than the slew limit of the device, 3 N/ms.
  physics_->signal(SIGCONT);
  Stamped<Telemetry> last;
  double steepest_n_per_ms = 0.0;
  ASSERT_TRUE(follow(*ticks, 5.0, [&](const Stamped<Telemetry>& tick) {
    if (last.sequence + 1 == tick.sequence) {
      const double elapsed_ms = std::max(1.0, static_cast<double>(tick.value.due_ns - last.value.due_ns) * 1e-6);
      steepest_n_per_ms =
          std::max(steepest_n_per_ms, (norm(tick.value.force_n) - norm(last.value.force_n)) / elapsed_ms);
    }
    last = tick;
    return tick.value.gate >= 1.0;
  }));
  std::printf("resumed: steepest growth %.3f N/ms\n", steepest_n_per_ms);
  EXPECT_LE(steepest_n_per_ms, 3.0 + 1e-9);
}

TEST_F(Nodes, LeaveTheHandWithoutForceWhileTheHapticNodeIsStarved) {
  session_file_ = "wall_own_plant.yaml";
  start_plant();
  start_physics();
  start_haptic();
  auto plant = reader<rtbus::PlantState>("haptic0.plant_state");
  ASSERT_TRUE(plant);
  Stamped<rtbus::PlantState> felt;
  ASSERT_TRUE(eventually(
      8.0, [&] { return plant->read_latest(felt) == ReadStatus::kFresh && norm(felt.value.applied_force_n) > 0.3; }));
  haptic_->signal(SIGSTOP);
  usleep(200'000);
  (void)plant->read_latest(felt);
  EXPECT_EQ(norm(felt.value.applied_force_n), 0.0) << "the plant's own time-out";
  EXPECT_NE(felt.value.timed_out, 0u);
  haptic_->signal(SIGCONT);
  EXPECT_TRUE(eventually(5.0, [&] {
    return plant->read_latest(felt) == ReadStatus::kFresh && norm(felt.value.applied_force_n) > 0.3;
  })) << "and the force comes back";
}

}  // namespace
