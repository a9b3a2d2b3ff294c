// What the runs of a row of `rtbus evaluate faults` are held against, with runs that were made up.
#include "tools/evaluation/faults/fault_checks.hpp"

#include <gtest/gtest.h>

#include <limits>

#include "tests/support/temporary_file.hpp"

namespace tools {
namespace {

/// A run that keeps every promise of the row.
FaultOutcome good() {
  FaultOutcome out;
  out.before_n = out.peak_n = 2.0;
  out.limit_n = 7.9;
  out.zero_ms = 15.0;
  out.lowest_n = 1.9;
  out.back_ms = 50.0;
  out.growth_per_ms = 0.01;
  out.exit_status = out.restarts = 0;
  out.ticks = out.due = 5000;
  out.elapsed_s = 5.0;
  out.rate_hz = 1000.0;
  return out;
}

FaultRow row_of(Feels feels, Ends ends) {
  FaultRow row;
  row.name = "made_up";
  row.feels = feels;
  row.zero_ms = feels == Feels::kZero ? 21.0 : 0.0;
  row.ends = ends;
  return row;
}

Verdict verdict_of(const FaultRow& row, const std::vector<FaultOutcome>& runs, double paused_ms = 0.0) {
  const tests::TemporaryFolder folder;
  Experiment experiment("evaluate", "faults", "test", folder.path().string());
  check_row(row, runs, paused_ms, experiment);
  return experiment.verdict();
}

TEST(FaultChecks, PassARunThatKeepsItsPromises) {
  EXPECT_EQ(verdict_of(row_of(Feels::kZero, Ends::kComesBack), {good()}), Verdict::kPass);
  EXPECT_EQ(verdict_of(row_of(Feels::kNothing, Ends::kComesBack), {good()}), Verdict::kPass);
  EXPECT_EQ(verdict_of(row_of(Feels::kZero, Ends::kStaysAtZero), {good()}), Verdict::kPass);
}

TEST(FaultChecks, FailACountedRunHoweverTheRunsPausedThatWereNotCounted) {
  FaultOutcome late = good();
  late.zero_ms = 200.0;
  EXPECT_EQ(verdict_of(row_of(Feels::kZero, Ends::kComesBack), {late}, 80.0), Verdict::kFail);
  EXPECT_EQ(verdict_of(row_of(Feels::kZero, Ends::kComesBack), {}, 80.0), Verdict::kMachineTooBusy);
}

TEST(FaultChecks, HoldTheZeroAgainstThePromiseAndTheRunsOwnPauses) {
  FaultOutcome late = good();
  late.zero_ms = 22.0;
  EXPECT_EQ(verdict_of(row_of(Feels::kZero, Ends::kComesBack), {late}), Verdict::kFail);
  late.pause_ms = 0.6;
  EXPECT_EQ(verdict_of(row_of(Feels::kZero, Ends::kComesBack), {late}), Verdict::kPass);
  late.zero_ms = -1.0;
  EXPECT_EQ(verdict_of(row_of(Feels::kZero, Ends::kComesBack), {good(), late}), Verdict::kFail);
}

TEST(FaultChecks, FailAForceThatNeverWasZeroWhereItShouldStayThere) {
  FaultOutcome never = good();
  never.zero_ms = -1.0;
  for (const Ends ends : {Ends::kStaysAtZero, Ends::kWithSession}) {
    EXPECT_EQ(verdict_of(row_of(Feels::kAnything, ends), {never}), Verdict::kFail);
    EXPECT_EQ(verdict_of(row_of(Feels::kAnything, ends), {good()}), Verdict::kPass);
  }
}

TEST(FaultChecks, TakeASessionThatGoesOnWithItsForceOrEndsAtZero) {
  FaultRow row = row_of(Feels::kAnything, Ends::kMayGoOn);
  row.exit_status = FaultRow::kAnyFailure;
  FaultOutcome ends = good(), goes_on = good();
  ends.exit_status = 1;
  goes_on.went_on = true;
  goes_on.zero_ms = -1.0;
  goes_on.lowest_n = goes_on.before_n;
  EXPECT_EQ(verdict_of(row, {ends, goes_on}), Verdict::kPass);
  ends.after_zero_n = 0.1;
  EXPECT_EQ(verdict_of(row, {ends}), Verdict::kFail);
  goes_on.lowest_n = 0.0;
  EXPECT_EQ(verdict_of(row, {goes_on}), Verdict::kFail);
}

TEST(FaultChecks, FailAForceThatComesBackWhileTheFaultLasts) {
  FaultRow row = row_of(Feels::kZero, Ends::kComesBack);
  FaultOutcome back = good();
  back.felt_until_ms = 400.0;
  EXPECT_EQ(verdict_of(row, {back}), Verdict::kPass) << "a row that does not say so";
  row.held = true;
  EXPECT_EQ(verdict_of(row, {back}), Verdict::kFail);
  back.felt_until_ms = 15.0;
  EXPECT_EQ(verdict_of(row, {back}), Verdict::kPass);
}

TEST(FaultChecks, FailALoopThatIsLaterThanTheMachineMadeIt) {
  FaultRow row = row_of(Feels::kNothing, Ends::kComesBack);
  FaultOutcome late = good();
  late.wakeup_ms = 9.0;
  EXPECT_EQ(verdict_of(row, {late}), Verdict::kFail);
  late.pause_ms = 4.5;
  EXPECT_EQ(verdict_of(row, {late}), Verdict::kPass);
  late.pause_ms = 0.0;
  row.own_wakeups = true;
  EXPECT_EQ(verdict_of(row, {late}), Verdict::kPass);
}

TEST(FaultChecks, CountTheTicksAgainstTheClock) {
  FaultRow row = row_of(Feels::kAnything, Ends::kComesBack);
  row.counts_ticks = true;
  FaultOutcome out = good();
  EXPECT_EQ(verdict_of(row, {out}), Verdict::kPass);
  out.ticks = out.due = 4000;
  EXPECT_EQ(verdict_of(row, {out}), Verdict::kFail) << "a second is missing, in due too";
  out.due = 5000;
  out.overruns = 1000;
  EXPECT_EQ(verdict_of(row, {out}), Verdict::kPass);
  out.ticks = 1000;
  out.overruns = 4000;
  EXPECT_EQ(verdict_of(row, {out}), Verdict::kFail) << "counted, but it does not go on";
}

TEST(FaultChecks, FailAFigureThatIsNoneWhateverTheOtherRunsSay) {
  FaultOutcome none = good();
  none.before_n = none.lowest_n = 0.0;
  EXPECT_EQ(verdict_of(row_of(Feels::kNothing, Ends::kComesBack), {good(), none}), Verdict::kFail);
}

/// 1 N for 100 ms, zero, 1 N again for 50 ms at 300 ms, zero, and back at 600 ms; a state each millisecond.
FaultOutcome traced() {
  FaultOutcome out;
  for (std::uint64_t ms = 0; ms < 1000; ++ms) {
    const bool felt = ms < 100 || (ms >= 300 && ms < 350) || ms >= 600;
    out.trace.push_back({1'000'000'000 + ms * 1'000'000, felt ? 1.0 + (ms < 90 ? 0.5 : 0.0) : 0.0});
  }
  out.fault_ns = 1'095'000'000;
  return out;
}

TEST(JudgeTrace, TakesTheForceBeforeFromTheTimeOfTheFault) {
  FaultOutcome out = traced();
  judge_trace(1'500'000'000, out);
  EXPECT_EQ(out.before_n, 1.0) << "not 1.5, which was before";
}

TEST(JudgeTrace, TellsHowLongAForceWasFeltThatShouldNotBe) {
  FaultOutcome out = traced();
  judge_trace(1'500'000'000, out);
  EXPECT_EQ(out.felt_until_ms, 0.0) << "nobody asked";
  judge_trace(1'500'000'000, out, {{out.fault_ns, 1'250'000'000}});
  EXPECT_NEAR(out.felt_until_ms, 4.0, 1e-6);
  judge_trace(1'500'000'000, out, {{out.fault_ns, 1'250'000'000}, {1'260'000'000, 1'500'000'000}});
  EXPECT_NEAR(out.felt_until_ms, 89.0, 1e-6) << "from the beginning of the second";
}

}  // namespace
}  // namespace tools
