#include "tools/evaluation/stack/push.hpp"

#include <gtest/gtest.h>

namespace tools {
namespace {

/// Moves 1 mm per 10 ms; from 10 mm on the force is 2 N, before it drags with 0.3 N.
PushTrace trace_of(int samples) {
  PushTrace trace;
  trace.rate_hz = 1000.0;
  rtbus::Telemetry tick;
  for (int i = 0; i < samples; ++i) {
    tick.due_ns = 1'000'000'000ULL + static_cast<std::uint64_t>(i) * 1'000'000ULL;
    tick.position_m = {0.0, 0.0, 0.015 - 1e-4 * i};
    tick.force_n = {0.0, 0.0, i < 100 ? 0.3 : 2.0};
    trace.append(tick);
  }
  return trace;
}

TEST(JudgePush, BeginsWhereTheSceneBegins) {
  const PushFigures figures = judge_push(trace_of(300), 10.0);
  EXPECT_NEAR(figures.touched_s, 0.100, 2e-3);  // 0.1 mm a sample: rounding may take one more
  EXPECT_NEAR(figures.roughness.mean_n, 2.0, 1e-12);
  EXPECT_EQ(figures.roughness.increment_rms_n, 0.0);
  EXPECT_EQ(figures.peak_n, 2.0);
}

TEST(JudgePush, SaysNothingOfAHandThatNeverCame) {
  const PushFigures figures = judge_push(trace_of(50), 10.0);
  EXPECT_EQ(figures.touched_s, 0.0);
  EXPECT_EQ(figures.peak_n, 0.0);
  EXPECT_EQ(figures.roughness.mean_n, 0.0);
}

TEST(PushTrace, TakesStepsOnlyOnceTheLoopIsSeen) {
  PushTrace trace;
  rtbus::Stamped<rtbus::ProxyState> step;
  step.stamp_ns = 1'500'000'000ULL;
  step.value.step_compute_s = 0.002;
  trace.append(step);
  EXPECT_TRUE(trace.step_ms.empty());
  rtbus::Telemetry tick;
  tick.due_ns = 1'000'000'000ULL;
  trace.append(tick);
  trace.append(step);
  ASSERT_EQ(trace.step_ms.size(), 1U);
  EXPECT_NEAR(trace.step_ms[0], 2.0, 1e-12);
  EXPECT_NEAR(trace.step_time_s[0], 0.5, 1e-12);
}

}  // namespace
}  // namespace tools
