/// The cells of `rtbus evaluate faults`, each once, with what the machine's own pauses add to every bar.
#include "tools/evaluation/faults/fault_cells.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <string>

#include "rtbus/clock.hpp"
#include "tests/support/process.hpp"

namespace tools {
namespace {

FaultOutcome run(FaultSetup setup) {
  setup.program = std::string(RTBUS_BINARY_DIR) + "/rtbus";
  setup.session_file = std::string(RTBUS_SOURCE_DIR) + "/config/" +
                       (setup.device != nullptr ? setup.device->session : "wall_own_plant.yaml");
  setup.session = "fc" + std::to_string(getpid()) + "-" + name_of(setup);
  setup.session.resize(std::min<std::size_t>(setup.session.size(), 32));
  setup.report = testing::TempDir() + setup.session + ".json";
  FaultOutcome out = run_fault_cell(setup);
  std::filesystem::remove(setup.report);
  std::printf(
      "%s: %.2f N before, zero after %.1f ms (promised %.0f), lowest %.3f N, back after %.0f ms, growth %.2f %%/ms, "
      "longest pause %.1f ms, %llu ticks of %llu due, %d restarts\n",
      name_of(setup), out.before_n, out.zero_ms, promised_zero_ms(setup), out.lowest_n, out.back_ms,
      100.0 * out.growth_per_ms, out.pause_ms, static_cast<unsigned long long>(out.ticks),
      static_cast<unsigned long long>(out.due), out.restarts);
  EXPECT_EQ(out.problem, "");
  return out;
}

/// Whatever happened: the session ended well and left nothing, and no step of force was put on the hand.
void expect_well_behaved(const FaultOutcome& out) {
  EXPECT_EQ(out.exit_status, 0);
  EXPECT_THAT(out.left_over, testing::IsEmpty());
  // A ramp of 100 ms grows by 1 %/ms, the damper on a moving hand adds some; a cycle that is late by a pause catches up
  // what the ramp did meanwhile. A step would be near 100 %/ms.
  EXPECT_LE(out.growth_per_ms, 0.10 + 0.02 * out.pause_ms) << "share of the peak per ms";
  EXPECT_GE(out.back_ms, 0.0) << "the session resumes by itself";
}

void expect_zero_in_time(const FaultSetup& setup, const FaultOutcome& out) {
  ASSERT_GE(out.zero_ms, 0.0);
  EXPECT_LE(out.zero_ms, promised_zero_ms(setup) + 2.0 * out.pause_ms + 5.0);
}

/// Every tick that was due was served or counted as overrun.
void expect_ticks(const FaultOutcome& out) {
  EXPECT_GT(out.due, 500u);
  EXPECT_EQ(out.due, out.ticks + out.overruns);
}

TEST(Faults, PhysicsKilledInMidPushFadesAndIsRestarted) {
  const FaultOutcome out = run({.fault = Fault::kPhysicsKilled});
  expect_zero_in_time({.fault = Fault::kPhysicsKilled}, out);
  expect_well_behaved(out);
  expect_ticks(out);
  EXPECT_EQ(out.restarts, 1);
  EXPECT_EQ(out.restarted, "physics");
}

TEST(Faults, PhysicsStoppedFadesAndComesBackWhenItGoesOn) {
  const FaultOutcome out = run({.fault = Fault::kPhysicsStopped});
  expect_zero_in_time({.fault = Fault::kPhysicsStopped}, out);
  expect_well_behaved(out);
  expect_ticks(out);
  EXPECT_EQ(out.restarts, 0) << "a stopped process is not a dead one";
}

TEST(Faults, AHungEngineWithALiveHeartbeatFadesToo) {
  const FaultOutcome out = run({.fault = Fault::kEngineHung});
  if (out.problem.find("may not be traced") != std::string::npos) GTEST_SKIP() << out.problem;
  EXPECT_GT(out.beats, 10u) << "the heartbeat must have gone on, else this was another fault";
  expect_zero_in_time({.fault = Fault::kEngineHung}, out);
  expect_well_behaved(out);
  expect_ticks(out);
  EXPECT_EQ(out.restarts, 0);
}

TEST(Faults, AKilledHapticNodeLeavesTheHandFreeAndItsSuccessorBeginsSoftly) {
  const FaultOutcome out = run({.fault = Fault::kHapticKilled});
  expect_zero_in_time({.fault = Fault::kHapticKilled}, out);
  expect_well_behaved(out);
  EXPECT_TRUE(out.device_timed_out) << "it was the device that let go";
  EXPECT_EQ(out.restarts, 1);
  EXPECT_EQ(out.restarted, "haptic0");
}

TEST(Faults, DeletedTopicsAreMadeAnewWithoutAStepOfForce) {
  const FaultOutcome out = run({.fault = Fault::kTopicsDeleted});
  expect_well_behaved(out);
  expect_ticks(out);
  EXPECT_EQ(out.topics, 13) << "all of the session";
  EXPECT_EQ(out.topics_back, out.topics);
  EXPECT_EQ(out.restarts, 0);
}

class DeviceFaults : public testing::TestWithParam<const DeviceFault*> {};

TEST_P(DeviceFaults, EndInZeroInTimeAndComeBackSoftlyOrNotAtAll) {
  const FaultSetup setup{.fault = Fault::kDevice, .device = GetParam()};
  const FaultOutcome out = run(setup);
  expect_zero_in_time(setup, out);
  EXPECT_EQ(out.restarts, 0);
  if (comes_back(setup)) {
    expect_well_behaved(out);
  } else {
    EXPECT_EQ(out.exit_status, 0);
    EXPECT_THAT(out.left_over, testing::IsEmpty());
    EXPECT_EQ(out.after_zero_n, 0.0) << "until the user has acted";
  }
}

INSTANTIATE_TEST_SUITE_P(StandIns, DeviceFaults, testing::ValuesIn(device_faults(true)),
                         [](const auto& row) { return std::string(row.param->name); });

// What the cells conclude from a trace, by traces that were made up.

std::vector<Felt> trace_of(double (*force_n)(double time_ms), double until_ms) {
  std::vector<Felt> out;
  for (int i = 0; i * 0.25 <= until_ms; ++i) {
    out.push_back({1'000'000'000 + static_cast<std::uint64_t>(i) * 250'000, force_n(i * 0.25)});
  }
  return out;
}

TEST(JudgeTrace, FindsZeroReturnAndTheGentleRamp) {
  FaultOutcome out;
  out.fault_ns = 1'100'000'000;
  out.trace = trace_of(
      [](double t) {
        return t < 160 ? 2.0 : t < 200 ? 2.0 * (200 - t) / 40 : t < 400 ? 0.0 : std::min(2.0, (t - 400) / 50);
      },
      600);
  judge_trace(1'400'000'000, out);
  EXPECT_NEAR(out.zero_ms, 100.0, 0.3);
  EXPECT_NEAR(out.back_ms, 50.0, 0.3);
  EXPECT_NEAR(out.growth_per_ms, 0.01, 0.001);
  EXPECT_EQ(out.peak_n, 2.0);
  EXPECT_EQ(out.lowest_n, 0.0);
  EXPECT_NEAR(out.pause_ms, 0.25, 1e-9);
}

TEST(JudgeTrace, DoesNotTakeTheForceBeforeTheZeroForTheReturn) {
  FaultOutcome out;
  out.fault_ns = 1'050'000'000;
  out.trace = trace_of([](double t) { return t < 150 || t > 400 ? 2.0 : 0.0; }, 500);
  judge_trace(out.fault_ns, out);
  EXPECT_NEAR(out.zero_ms, 100.0, 0.3);
  EXPECT_NEAR(out.back_ms, 350.0, 0.5) << "from the end of the fault, here its beginning";
}

TEST(JudgeTrace, SeesAStepThatAHandWouldFeel) {
  FaultOutcome out;
  out.fault_ns = 1'050'000'000;
  out.trace = trace_of([](double t) { return t < 100 ? 2.0 : t < 200 ? 0.0 : 2.0; }, 300);
  judge_trace(out.fault_ns, out);
  EXPECT_GT(out.growth_per_ms, 0.9);
}

TEST(JudgeTrace, SaysThatItNeverWasZero) {
  FaultOutcome out;
  out.fault_ns = 1'050'000'000;
  out.trace = trace_of([](double) { return 1.5; }, 300);
  judge_trace(out.fault_ns, out);
  EXPECT_EQ(out.zero_ms, -1.0);
  EXPECT_EQ(out.lowest_n, 1.5);
  EXPECT_EQ(out.growth_per_ms, 0.0);
}

}  // namespace
}  // namespace tools
