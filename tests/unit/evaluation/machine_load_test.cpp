// "This machine is too busy or too slow" is told from "failed", by figures that are not the program's own.
#include "tools/evaluation/shared/machine_load.hpp"

#include <gtest/gtest.h>
#include <sys/resource.h>

#include <algorithm>
#include <fstream>
#include <limits>
#include <nlohmann/json.hpp>
#include <string>
#include <thread>

#include "rtbus/clock.hpp"
#include "tests/support/temporary_file.hpp"
#include "tools/evaluation/shared/experiment.hpp"

namespace tools {
namespace {

constexpr const char* kStat =
    "cpu  900 60 90 3000 10 0 30 20 0 0\n"
    "cpu0 300 20 30 1000 10 0 10 5 0 0\n"
    "cpu1 300 20 30 1000 0 0 10 15 0 0\n"
    "cpu12 300 20 30 1000 0 0 10 0 0 0\n"
    "intr 12 0\n";

TEST(MachineLoad, CountsTheUsableCpusAlone) {
  const CpuTimes both = parse_cpu_times(kStat, {0, 1}, 100);
  EXPECT_DOUBLE_EQ(both.busy_s, 7.2);
  EXPECT_DOUBLE_EQ(both.stolen_s, 0.2);
  EXPECT_DOUBLE_EQ(parse_cpu_times(kStat, {1}, 100).stolen_s, 0.15);
  EXPECT_EQ(parse_cpu_times("", {0}, 100).busy_s, 0.0);
}

TEST(MachineLoad, ReadsHowLongTasksWaited) {
  const auto waited = parse_cpu_waiting(
      "some avg10=98.12 avg60=98.14 avg300=89.17 total=1574320090\nfull avg10=0.00 avg60=0.00 avg300=0.00 total=0\n");
  ASSERT_TRUE(waited);
  EXPECT_DOUBLE_EQ(*waited, 1574.320090);
  EXPECT_FALSE(parse_cpu_waiting(""));
  EXPECT_FALSE(parse_cpu_waiting("some avg10=1.0"));
}

TEST(MachineLoad, OfAnIdleMachineIsNoExcuse) {
  EXPECT_EQ(hindered_by({}).by, Hindrance::kNone);
  MachineLoad idle{.others_share = 0.03, .stolen_share = 0.001, .waited_share = 0.6, .pause_ms = 1.2};
  idle = idle.with_steps({4.0, 5.0, 6.0}, 10.0);
  EXPECT_EQ(hindered_by(idle).by, Hindrance::kNone) << "its own nodes may wait for each other";
  EXPECT_EQ(hindered_by(idle).evidence, "");
}

// Another program on a second CPU takes nothing from anybody.
TEST(MachineLoad, OfOthersMattersWhenSomethingWaits) {
  EXPECT_EQ(hindered_by({.others_share = 0.5, .waited_share = 0.01}).by, Hindrance::kNone);
  const Hindered busy = hindered_by({.others_share = 0.5, .waited_share = 0.9});
  EXPECT_EQ(busy.by, Hindrance::kMachineTooBusy);
  EXPECT_EQ(busy.evidence, "other programs took 50 % of the CPU time; tasks waited for a CPU during 90 % of the time");
  EXPECT_EQ(hindered_by({.others_share = 0.5}).by, Hindrance::kMachineTooBusy) << "a kernel that does not tell";
}

TEST(MachineLoad, TheftAndPausesAreTheMachines) {
  EXPECT_EQ(hindered_by({.stolen_share = 0.05}).evidence, "the hypervisor took 5.0 % of the CPU time");
  EXPECT_EQ(hindered_by({.bare_lost_share = 0.02}).evidence, "an empty loop lost 2.0 % of its periods");
  EXPECT_EQ(hindered_by({.pause_ms = 8.0}).evidence, "the machine paused for 8.0 ms");
}

// What our own loop does to its core, the empty loop beside it suffers too.
TEST(MachineLoad, AHapticLoopThatHogsItsCoreIsNotTheMachine) {
  EXPECT_EQ(hindered_by({.bare_lost_share = 0.5, .pause_ms = 20.0, .loop_hogs_core = true}).by, Hindrance::kNone);
}

TEST(MachineLoad, StepsBeyondTheirPeriodAreASlowMachine) {
  const MachineLoad slow = MachineLoad{}.with_steps({9.0, 11.0, 12.0, 13.0}, 10.0);
  EXPECT_DOUBLE_EQ(slow.late_steps_share, 0.75);
  const Hindered by = hindered_by(slow);
  EXPECT_EQ(by.by, Hindrance::kMachineTooSlow);
  EXPECT_EQ(by.evidence, "75 % of the physics steps took longer than their period of 10.0 ms, median 12.0 ms");
  // A busy machine makes steps long: that one is told first.
  MachineLoad both = slow;
  both.others_share = both.waited_share.emplace(0.8);
  EXPECT_EQ(hindered_by(both).by, Hindrance::kMachineTooBusy);
}

TEST(MachineLoad, OfManyRunsIsTheWorst) {
  MachineLoad all = MachineLoad{.others_share = 0.2, .pause_ms = 1.0}.with_steps({1.0}, 2.0);
  all.include(MachineLoad{.others_share = 0.1, .waited_share = 0.3, .pause_ms = 9.0}.with_steps({3.0, 1.0}, 2.0));
  EXPECT_DOUBLE_EQ(all.others_share, 0.2);
  EXPECT_DOUBLE_EQ(all.waited_share.value(), 0.3);
  EXPECT_DOUBLE_EQ(all.pause_ms, 9.0);
  EXPECT_DOUBLE_EQ(all.late_steps_share, 0.5);
}

TEST(LoadMeter, LeavesOutWhatThisProcessTook) {
  rusage before{};
  ASSERT_EQ(getrusage(RUSAGE_SELF, &before), 0);
  const LoadMeter meter;
  const std::uint64_t end_ns = rtbus::monotonic_ns() + 500 * rtbus::kNsPerMs;
  const auto burn = [end_ns] {
    while (rtbus::monotonic_ns() < end_ns) {
    }
  };
  std::thread other(burn);
  burn();
  other.join();
  const MachineLoad load = meter.read();
  rusage used{};
  ASSERT_EQ(getrusage(RUSAGE_SELF, &used), 0);
  const double ours_s = static_cast<double>(used.ru_utime.tv_sec - before.ru_utime.tv_sec) +
                        1e-6 * static_cast<double>(used.ru_utime.tv_usec - before.ru_utime.tv_usec);
  const double had_s = 0.5 * static_cast<double>(std::max(1U, std::thread::hardware_concurrency()));
  // The kernel counts all CPUs in ticks of 10 ms.
  EXPECT_LE(load.others_share, 1.0 - ours_s / had_s + 0.1);
}

/// An experiment of two checks, the second one as it comes out.
struct Written {
  int status;
  nlohmann::json summary;
  std::string printed;
};
Written experiment_with(double value, const MachineLoad& during) {
  const tests::TemporaryFolder folder;
  Experiment experiment("evaluate", "test", "rtbus evaluate test", folder.path());
  experiment.check_at_least("test.mean", "a mean", 2.0, "N", 1.0);
  experiment.check_at_least("test.rate", "a rate", value, "Hz", 97.0, during);
  testing::internal::CaptureStdout();
  const int status = experiment.finish(false);
  std::ifstream file(folder.path() / "summary.json");
  return {status, nlohmann::json::parse(file), testing::internal::GetCapturedStdout()};
}

TEST(Experiment, ThatPassesOnABusyMachinePasses) {
  const Written out = experiment_with(100.0, {.others_share = 0.9, .waited_share = 0.9});
  EXPECT_EQ(out.status, 0);
  EXPECT_EQ(out.summary["verdict"], "pass");
  EXPECT_EQ(out.summary["checks"][1]["evidence"], "");
  EXPECT_EQ(out.printed.find("busy"), std::string::npos) << out.printed;
}

TEST(Experiment, ThatMissesItsBarOnAnIdleMachineFails) {
  const Written out = experiment_with(90.0, {});
  EXPECT_EQ(out.status, 1);
  EXPECT_EQ(out.summary["verdict"], "fail");
  EXPECT_EQ(out.summary["checks"][1]["pass"], false);
  EXPECT_EQ(out.summary["checks"][1]["verdict"], "fail");
  EXPECT_NE(out.printed.find("FAIL"), std::string::npos) << out.printed;
}

TEST(Experiment, ThatMissesItsBarOnABusyMachineIsNotJudgedAndHasNotPassed) {
  const Written out = experiment_with(90.0, {.others_share = 0.6, .waited_share = 0.9});
  EXPECT_EQ(out.status, 1);
  EXPECT_EQ(out.summary["verdict"], "machine_too_busy");
  EXPECT_EQ(out.summary["checks"][0]["verdict"], "pass");
  EXPECT_EQ(out.summary["checks"][1]["pass"], false);
  EXPECT_EQ(out.summary["checks"][1]["verdict"], "machine_too_busy");
  EXPECT_NE(out.summary["checks"][1]["evidence"].get<std::string>().find("60 %"), std::string::npos);
  for (const char* word :
       {"machine too busy", "1 of 2 checks", "test.rate: other programs took 60 %", "End what else"}) {
    EXPECT_NE(out.printed.find(word), std::string::npos) << word << " in\n" << out.printed;
  }
  EXPECT_EQ(out.printed.find("FAIL"), std::string::npos) << out.printed;
}

// What nobody measured for lack of a run that counts is no number, and judged the same way.
TEST(Experiment, WithoutAFigureIsJudgedByWhatStoodInItsWay) {
  EXPECT_EQ(experiment_with(std::numeric_limits<double>::quiet_NaN(), {.pause_ms = 12.0}).summary["verdict"],
            "machine_too_busy");
  EXPECT_EQ(experiment_with(std::numeric_limits<double>::quiet_NaN(), {}).summary["verdict"], "fail");
}

TEST(Experiment, AFailureOutweighsWhatCouldNotBeJudged) {
  const tests::TemporaryFolder folder;
  Experiment experiment("evaluate", "test", "rtbus evaluate test", folder.path());
  EXPECT_EQ(experiment.verdict(), Verdict::kPass);
  EXPECT_FALSE(experiment.check_at_most("a", "a", 2.0, "1", 1.0, {.stolen_share = 0.2}));
  EXPECT_EQ(experiment.verdict(), Verdict::kMachineTooBusy);
  EXPECT_FALSE(experiment.check_at_most("b", "b", 2.0, "1", 1.0));
  EXPECT_EQ(experiment.verdict(), Verdict::kFail);
}

}  // namespace
}  // namespace tools
