#include "tools/evaluation/faults/fault_checks.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>

namespace tools {

namespace {

constexpr double kStillFelt_percent = 50.0;
/// Of the force, share of its peak. A ramp makes 1 to 2 %/ms. Damper and energy limit make 0.05 N of an encoder step
/// each, while the ramp does not act: 10 % of a peak of 1 N. A step would be near 100 %/ms. docs/safety.md, "Growth".
constexpr double kGrowth_percent_per_ms = 10.0;
constexpr double kReturn_ms = 5000.0;
/// Of the haptic loop, later than the witness's: what the machine itself did to both is in the witness.
constexpr double kOwnWakeup_ms = 5.0;
/// The statistics are told five times a second, and a loop without realtime priority may just then wait for its CPU.
constexpr double kTicksTold_ms = 100.0;
/// Also without realtime priority, on a machine that others use.
constexpr double kServed_percent = 50.0;
/// A pause may delay the haptic node that acts, and the plant in which the force is felt.
constexpr double kPausesInTheWay = 2.0;

/// The worst of the counted runs. NaN, which passes no check, when there is none, or when it is that of any run.
template <class Figure>
double worst(const std::vector<FaultOutcome>& runs, const Figure& figure) {
  double out = runs.empty() ? std::numeric_limits<double>::quiet_NaN() : figure(runs[0]);
  for (const FaultOutcome& run : runs) {
    const double each = figure(run);
    out = std::isnan(each) ? each : std::max(out, each);
    if (std::isnan(out)) break;
  }
  return out;
}

/// The loop's own count against the clock.
double ticks_not_told(const FaultOutcome& run) {
  const double told = static_cast<double>(run.ticks + run.overruns);
  return std::abs(run.elapsed_s * run.rate_hz - told);
}

}  // namespace

void check_row(const FaultRow& row, const std::vector<FaultOutcome>& runs, double paused_ms, Experiment& experiment) {
  const MachineLoad paused{.pause_ms = runs.empty() ? paused_ms : 0.0};
  const std::string id = "faults." + row.name;
  const auto says = [&row](const char* what) { return row.name + ": " + what; };
  const auto never = [](double ms) { return ms < 0.0 ? std::numeric_limits<double>::infinity() : ms; };
  if (row.ends != Ends::kNeverStarts) {
    experiment.check_at_most(id + ".limit", says("largest force, share of the device's limit"),
                             worst(runs, [](const FaultOutcome& run) { return 100.0 * run.peak_n / run.limit_n; }), "%",
                             100.0 + 1e-6, paused);
  }
  if (row.feels == Feels::kZero) {
    experiment.check_at_most(
        id + ".zero", says("zero force after the fault"),
        worst(runs, [&](const FaultOutcome& run) { return never(run.zero_ms) - kPausesInTheWay * run.pause_ms; }), "ms",
        row.zero_ms, paused);
  }
  if (row.held) {
    experiment.check_at_most(
        id + ".held", says("last force that was felt while the fault lasted"),
        worst(runs, [](const FaultOutcome& run) { return run.felt_until_ms - kPausesInTheWay * run.pause_ms; }), "ms",
        row.zero_ms, paused);
  }
  if (row.feels == Feels::kNothing) {
    const double most_lost = worst(runs, [](const FaultOutcome& run) { return -100.0 * run.lowest_n / run.before_n; });
    experiment.check_at_least(id + ".felt", says("least force meanwhile, share of the one before"), -most_lost, "%",
                              kStillFelt_percent, paused);
  }
  switch (row.ends) {
    case Ends::kComesBack:
      experiment.check_at_most(id + ".resumes", says("force back after the end of the fault"),
                               worst(runs, [&](const FaultOutcome& run) { return never(run.back_ms); }), "ms",
                               kReturn_ms, paused);
      experiment.check_at_most(id + ".growth", says("fastest growth of the force, share of the peak"),
                               worst(runs, [](const FaultOutcome& run) { return 100.0 * run.growth_per_ms; }), "%/ms",
                               kGrowth_percent_per_ms, paused);
      break;
    case Ends::kMayGoOn:
      experiment.check_at_least(
          id + ".goes_on", says("least force where the session goes on, share of the one before"),
          -worst(runs,
                 [](const FaultOutcome& run) { return run.went_on ? -100.0 * run.lowest_n / run.before_n : -100.0; }),
          "%", kStillFelt_percent, paused);
      [[fallthrough]];
    case Ends::kStaysAtZero:
    case Ends::kWithSession:
      experiment.check_at_most(id + ".stays_zero", says("largest force after the zero"),
                               worst(runs,
                                     [](const FaultOutcome& run) {
                                       return run.went_on ? 0.0 : run.zero_ms < 0.0 ? run.peak_n : run.after_zero_n;
                                     }),
                               "N", 0.0, paused);
      break;
    case Ends::kNeverStarts:
      experiment.check_at_most(id + ".no_force", says("largest force"),
                               worst(runs, [](const FaultOutcome& run) { return run.peak_n; }), "N", 0.0, paused);
      break;
  }
  if (row.ends != Ends::kNeverStarts && !row.own_wakeups && !row.own_pauses) {
    experiment.check_at_most(id + ".wakeup", says("haptic loop awake later than the witness beside it"),
                             worst(runs, [](const FaultOutcome& run) { return run.wakeup_ms - run.pause_ms; }), "ms",
                             kOwnWakeup_ms, paused);
  }
  if (row.counts_ticks) {
    experiment.check_at_most(id + ".ticks", says("ticks that passed and were neither served nor counted as missed"),
                             worst(runs, [](const FaultOutcome& run) { return ticks_not_told(run); }), "",
                             worst(runs, [](const FaultOutcome& run) { return kTicksTold_ms * 1e-3 * run.rate_hz; }),
                             paused);
    experiment.check_at_least(id + ".goes_on", says("ticks served, share of those that passed"),
                              -worst(runs,
                                     [](const FaultOutcome& run) {
                                       return -100.0 * static_cast<double>(run.ticks) / (run.elapsed_s * run.rate_hz);
                                     }),
                              "%", kServed_percent, paused);
  }
  if (row.ends != Ends::kNeverStarts && row.exit_status <= 1) {
    const double most = worst(runs, [](const FaultOutcome& run) { return run.restarts + 0.0; });
    const double least = -worst(runs, [](const FaultOutcome& run) { return -run.restarts + 0.0; });
    experiment.check_between(id + ".restarts", says("nodes restarted"), least < row.restarts_least ? least : most, "",
                             row.restarts_least, row.restarts_most, paused);
  }
  const auto wrong_end = [&](const FaultOutcome& run) {
    const bool as_told = row.exit_status == FaultRow::kAnyFailure ? run.exit_status > 0 && run.exit_status < 128
                                                                  : run.exit_status == row.exit_status;
    return (as_told || (run.went_on && run.exit_status == 0) ? 0.0 : 1.0) + run.processes_left;
  };
  experiment.check_between(id + ".end", says("wrong exit status, and processes left behind"), worst(runs, wrong_end),
                           "", 0.0, 0.0, paused);
  // A supervisor that was killed cannot tidy: `rtbus clean` does, and the next session of the name.
  if (row.exit_status <= 1) {
    experiment.check_between(
        id + ".left", says("segments left behind"),
        worst(runs, [](const FaultOutcome& run) { return static_cast<double>(run.left_over.size()); }), "", 0.0, 0.0,
        paused);
  }
}

}  // namespace tools
