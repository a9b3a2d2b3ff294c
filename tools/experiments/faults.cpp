#include "tools/experiments/faults.hpp"

#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <fstream>
#include <limits>
#include <vector>

#include "rtbus/clock.hpp"
#include "tools/experiments/fault_cells.hpp"
#include "tools/interrupt.hpp"

namespace tools {

namespace {

/// A run in which the machine itself paused for longer says nothing about us; it is counted, not judged.
constexpr double kMachinePause_ms = 5.0;
constexpr int kTriesPerRun = 3;
/// The resume ramp takes 100 ms, so 1 %/ms; the damper on a moving hand adds some, and a cycle that comes late by such a
/// pause catches up what the ramp did meanwhile. A step would be near 100 %/ms.
constexpr double kFastestGrowth_percent_per_ms = 10.0;

bool ends_in_zero(Fault fault) { return fault != Fault::kTopicsDeleted; }

void write_trace(const std::filesystem::path& file, const FaultOutcome& outcome) {
  std::ofstream out(file);
  out << "time_ms\tforce_n\n";
  for (const Felt& felt : outcome.trace) {
    const double time_s = felt.time_ns >= outcome.fault_ns ? rtbus::seconds_between(outcome.fault_ns, felt.time_ns)
                                                           : -rtbus::seconds_between(felt.time_ns, outcome.fault_ns);
    out << time_s * 1e3 << '\t' << felt.force_n << '\n';
  }
}

Cell milliseconds(double value) { return value < 0.0 ? Cell(std::string("never")) : Cell(value); }

/// The worst of the counted runs; NaN, which passes no check, when there is none.
template <class Figure>
double worst(const std::vector<FaultOutcome>& runs, const Figure& figure) {
  double out = runs.empty() ? std::numeric_limits<double>::quiet_NaN() : figure(runs[0]);
  for (const FaultOutcome& run : runs) out = std::max(out, figure(run));
  return out;
}

void check(Fault fault, const std::vector<FaultOutcome>& runs, Experiment& experiment) {
  const std::string id = std::string("faults.") + to_string(fault);
  const auto never = [](double ms) { return ms < 0.0 ? std::numeric_limits<double>::infinity() : ms; };
  if (ends_in_zero(fault)) {
    experiment.check_at_most(id + ".zero", "zero force after the fault",
                             worst(runs, [&](const FaultOutcome& run) { return never(run.zero_ms); }), "ms",
                             promised_zero_ms(fault) + 2.0 * kMachinePause_ms);
  } else {
    experiment.check_between(id + ".back", "deleted topics that did not come back",
                             worst(runs, [](const FaultOutcome& run) { return run.topics - run.topics_back + 0.0; }),
                             "", 0.0, 0.0);
  }
  experiment.check_at_most(id + ".resumes", "force back after the end of the fault",
                           worst(runs, [&](const FaultOutcome& run) { return never(run.back_ms); }), "ms", 5000.0);
  experiment.check_at_most(id + ".growth", "fastest growth of the force, share of the peak",
                           worst(runs, [](const FaultOutcome& run) { return 100.0 * run.growth_per_ms; }), "%/ms",
                           kFastestGrowth_percent_per_ms);
  const bool restarts = fault == Fault::kPhysicsKilled || fault == Fault::kHapticKilled;
  experiment.check_between(id + ".restarts", "nodes restarted",
                           worst(runs, [](const FaultOutcome& run) { return run.restarts + 0.0; }), "", restarts,
                           restarts);
  experiment.check_between(
      id + ".end", "exit status and segments left behind",
      worst(runs, [](const FaultOutcome& run) { return run.exit_status + static_cast<double>(run.left_over.size()); }),
      "", 0.0, 0.0);
}

}  // namespace

void evaluate_faults(const FaultsOptions& options, Experiment& experiment) {
  Table table{
      "faults",
      {"fault", "counted", "force before [N]", "zero after [ms]", "promised [ms]", "lowest [N]", "back after [ms]",
       "growth [%/ms]", "longest pause [ms]", "ticks served", "due", "restarts", "topics back"},
      {}};
  int paused = 0;
  for (const Fault fault : kFaults) {
    std::vector<FaultOutcome> counted;
    for (int tries = 0; static_cast<int>(counted.size()) < options.runs && tries < kTriesPerRun * options.runs;
         ++tries) {
      if (interrupted()) break;
      std::fprintf(stderr, "faults: %s, run %zu of %d\n", to_string(fault), counted.size() + 1, options.runs);
      FaultSetup setup;
      setup.program = options.program;
      setup.session_file = options.session_file;
      setup.session = "faults-" + std::to_string(getpid());
      setup.report = (experiment.folder() / (std::string(to_string(fault)) + ".json")).string();
      FaultOutcome outcome = run_fault_cell(fault, setup);
      const bool counts = outcome.problem.empty() && outcome.pause_ms <= kMachinePause_ms;
      if (!outcome.problem.empty()) {
        experiment.note(std::string(to_string(fault)) + ": " + outcome.problem);
      } else if (!counts) {
        ++paused;
      }
      const bool loop_lives = fault != Fault::kHapticKilled;
      table.rows.push_back(
          {std::string(to_string(fault)), std::string(counts ? "yes" : "no"), outcome.before_n,
           milliseconds(outcome.zero_ms), ends_in_zero(fault) ? Cell(promised_zero_ms(fault)) : Cell(std::string("-")),
           outcome.lowest_n, milliseconds(outcome.back_ms), 100.0 * outcome.growth_per_ms, outcome.pause_ms,
           loop_lives ? Cell(static_cast<double>(outcome.ticks)) : Cell(std::string("-")),
           loop_lives ? Cell(static_cast<double>(outcome.due)) : Cell(std::string("-")),
           static_cast<double>(outcome.restarts),
           outcome.topics > 0 ? Cell(std::to_string(outcome.topics_back) + " of " + std::to_string(outcome.topics))
                              : Cell(std::string("-"))});
      if (!counts) continue;
      if (counted.empty()) {
        write_trace(experiment.folder() / (std::string(to_string(fault)) + "_trace.tsv"), outcome);
        experiment.add_run(setup.report);
      }
      outcome.trace.clear();
      counted.push_back(std::move(outcome));
    }
    check(fault, counted, experiment);
  }
  experiment.add_table(std::move(table));
  if (paused > 0) {
    experiment.note(std::to_string(paused) + " run(s) not counted: the machine paused for more than 5 ms");
  }
}

}  // namespace tools
