/// Rows of `rtbus evaluate faults`, each once, with what the machine's own pauses add to every bar.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <ostream>
#include <set>
#include <string>
#include <utility>

#include "rtbus/clock.hpp"
#include "tests/support/process.hpp"
#include "tools/evaluation/faults/fault_cell.hpp"

namespace tools {
void PrintTo(const FaultRow& row, std::ostream* out) { *out << row.name; }

namespace {

FaultOutcome run(const FaultRow& row) {
  FaultSetup setup;
  setup.row = &row;
  setup.program = std::string(RTBUS_BINARY_DIR) + "/rtbus";
  setup.session_file =
      std::string(RTBUS_SOURCE_DIR) + "/config/" + (row.session.empty() ? "wall_own_plant.yaml" : row.session);
  setup.session = "fc" + std::to_string(getpid()) + "-" + row.name;
  setup.session.resize(std::min<std::size_t>(setup.session.size(), 32));
  setup.report = testing::TempDir() + setup.session + ".json";
  const std::string report = setup.report;
  FaultOutcome out = FaultCell(std::move(setup), "").wait();
  std::filesystem::remove(report);
  std::printf(
      "%s: %.2f N before, zero after %.1f ms (promised %.0f), lowest %.3f N, back after %.0f ms, growth %.2f %%/ms, "
      "longest pause %.1f ms, %llu ticks of %llu due, %d restarts\n",
      row.name.c_str(), out.before_n, out.zero_ms, row.zero_ms, out.lowest_n, out.back_ms, 100.0 * out.growth_per_ms,
      out.pause_ms, static_cast<unsigned long long>(out.ticks), static_cast<unsigned long long>(out.due), out.restarts);
  EXPECT_EQ(out.problem, "");
  return out;
}

/// The simulated device lets go 20 ms after its last command (force_timeout_ms), which a loop of 1 kHz sends 1 ms
/// before a pause begins and 1 ms after it has ended.
constexpr double kDeviceHolds_ms = 18.0;

/// The promises of a row.
void expect_promises(const FaultRow& row, const FaultOutcome& out) {
  if (row.feels == Feels::kZero) {
    ASSERT_GE(out.zero_ms, 0.0);
    EXPECT_LE(out.zero_ms, row.zero_ms + 2.0 * out.pause_ms + 5.0);
  }
  if (row.held) {
    EXPECT_LE(out.felt_until_ms, row.zero_ms + 2.0 * out.pause_ms + 5.0) << "while the fault lasts";
  }
  const bool lets_go = row.feels == Feels::kNothing && out.pause_ms >= kDeviceHolds_ms;
  if (row.feels == Feels::kNothing && !lets_go) {
    EXPECT_GE(out.lowest_n, 0.5 * out.before_n);
  }
  EXPECT_LE(out.peak_n, out.limit_n);
  if (row.ends == Ends::kComesBack) {
    EXPECT_GE(out.back_ms, 0.0) << "the session resumes by itself";
    // A ramp of 100 ms grows by 1 %/ms, the damper on a moving hand adds some; a cycle that is late by a pause catches
    // up what the ramp did meanwhile. A step would be near 100 %/ms.
    EXPECT_LE(out.growth_per_ms, 0.10 + 0.02 * out.pause_ms) << "share of the peak per ms";
  } else {
    EXPECT_GE(out.zero_ms, 0.0);
    EXPECT_EQ(out.after_zero_n, 0.0);
  }
  if (row.exit_status == FaultRow::kAnyFailure) {
    EXPECT_GT(out.exit_status, 0);
    EXPECT_LT(out.exit_status, 128);
  } else {
    EXPECT_EQ(out.exit_status, row.exit_status);
  }
  EXPECT_EQ(out.processes_left, 0);
  if (row.exit_status > 1) return;  // a supervisor that was killed cannot tidy
  EXPECT_GE(out.restarts, row.restarts_least);
  EXPECT_LE(out.restarts, row.restarts_most);
  EXPECT_THAT(out.left_over, testing::IsEmpty());
  if (lets_go) GTEST_SKIP() << "the machine paused for " << out.pause_ms << " ms, and the device let go by itself";
}

FaultOutcome run_and_expect(const char* name) {
  const FaultRow* const row = find_fault_row(name);
  if (row == nullptr) {
    ADD_FAILURE() << "no row " << name;
    return {};
  }
  FaultOutcome out = run(*row);
  expect_promises(*row, out);
  return out;
}

/// Every tick that was due was served or counted as overrun.
void expect_ticks(const FaultOutcome& out) {
  EXPECT_GT(out.due, 500u);
  EXPECT_EQ(out.due, out.ticks + out.overruns);
}

TEST(Faults, PhysicsKilledInMidPushFadesAndIsRestarted) {
  const FaultOutcome out = run_and_expect("physics_killed");
  expect_ticks(out);
  EXPECT_EQ(out.restarted, "physics");
}

TEST(Faults, PhysicsStoppedFadesAndComesBackWhenItGoesOn) { expect_ticks(run_and_expect("physics_stopped")); }

TEST(Faults, AHungEngineWithALiveHeartbeatFadesToo) { expect_ticks(run_and_expect("engine_hung")); }

TEST(Faults, AnswersThatAreNoNumbersAreALoss) { expect_ticks(run_and_expect("physics_nan")); }

TEST(Faults, AKilledHapticNodeLeavesTheHandFreeAndItsSuccessorBeginsSoftly) {
  const FaultOutcome out = run_and_expect("haptic_killed");
  EXPECT_TRUE(out.device_timed_out) << "it was the device that let go";
  EXPECT_EQ(out.restarted, "haptic0");
}

TEST(Faults, AKilledSupervisorLeavesTheHandFreeAndNoProcess) { (void)run_and_expect("supervisor_killed"); }

TEST(Faults, DeletedTopicsAreMadeAnewWithoutAStepOfForce) {
  const FaultOutcome out = run_and_expect("topics_deleted");
  expect_ticks(out);
  EXPECT_EQ(out.topics, 13) << "all of the session";
  EXPECT_EQ(out.topics_back, out.topics);
}

std::vector<FaultRow> quick_device_faults() {
  std::vector<FaultRow> out = device_faults();
  std::erase_if(out, [](const FaultRow& row) { return !row.quick; });
  return out;
}

class DeviceFaults : public testing::TestWithParam<FaultRow> {};

TEST_P(DeviceFaults, EndInZeroInTimeAndComeBackSoftlyOrNotAtAll) { expect_promises(GetParam(), run(GetParam())); }

INSTANTIATE_TEST_SUITE_P(StandIns, DeviceFaults, testing::ValuesIn(quick_device_faults()),
                         [](const auto& row) { return row.param.name; });

TEST(FaultRows, HaveNamesOfTheirOwnAndSayWhatTheyDo) {
  std::set<std::string> names;
  for (const FaultRow& row : fault_rows()) {
    EXPECT_TRUE(names.insert(row.name).second) << row.name;
    EXPECT_FALSE(row.what.empty()) << row.name;
    EXPECT_EQ(row.feels == Feels::kZero, row.zero_ms > 0.0) << row.name;
    EXPECT_TRUE(!row.held || row.feels == Feels::kZero) << row.name;
    EXPECT_EQ(static_cast<bool>(row.happen), row.ends != Ends::kNeverStarts) << row.name;
  }
}

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
