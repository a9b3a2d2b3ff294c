#include "tools/evaluation/faults/faults.hpp"

#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <fstream>
#include <limits>
#include <vector>

#include "rtbus/clock.hpp"
#include "tools/cli/common/interrupt.hpp"
#include "tools/evaluation/faults/fault_cells.hpp"

namespace tools {

namespace {

constexpr int kTriesPerRun = 3;
/// The resume ramp takes 100 ms, so 1 %/ms; the damper on a moving hand adds some, and a cycle that comes late by such
/// a pause catches up what the ramp did meanwhile. A step would be near 100 %/ms.
constexpr double kFastestGrowth_percent_per_ms = 10.0;

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

/// @param paused Of the runs that were not counted, when none was: the promises to the hand are judged in every run
/// that was counted, however busy the machine is.
void check(const FaultSetup& setup, const std::vector<FaultOutcome>& runs, const MachineLoad& paused,
           Experiment& experiment) {
  const std::string id = std::string("faults.") + name_of(setup);
  const auto never = [](double ms) { return ms < 0.0 ? std::numeric_limits<double>::infinity() : ms; };
  if (ends_in_zero(setup)) {
    experiment.check_at_most(id + ".zero", "zero force after the fault",
                             worst(runs, [&](const FaultOutcome& run) { return never(run.zero_ms); }), "ms",
                             promised_zero_ms(setup) + 2.0 * kMachinePause_ms, paused);
  } else if (setup.fault == Fault::kTopicsDeleted) {
    experiment.check_between(id + ".back", "deleted topics that did not come back",
                             worst(runs, [](const FaultOutcome& run) { return run.topics - run.topics_back + 0.0; }),
                             "", 0.0, 0.0, paused);
  }
  if (comes_back(setup)) {
    experiment.check_at_most(id + ".resumes", "force back after the end of the fault",
                             worst(runs, [&](const FaultOutcome& run) { return never(run.back_ms); }), "ms", 5000.0,
                             paused);
    experiment.check_at_most(id + ".growth", "fastest growth of the force, share of the peak",
                             worst(runs, [](const FaultOutcome& run) { return 100.0 * run.growth_per_ms; }), "%/ms",
                             kFastestGrowth_percent_per_ms, paused);
  } else {
    experiment.check_at_most(id + ".stays_zero", "largest force after the zero",
                             worst(runs, [](const FaultOutcome& run) { return run.after_zero_n; }), "N", 0.0, paused);
  }
  const bool restarts = restarts_a_node(setup);
  experiment.check_between(id + ".restarts", "nodes restarted",
                           worst(runs, [](const FaultOutcome& run) { return run.restarts + 0.0; }), "", restarts,
                           restarts, paused);
  experiment.check_between(
      id + ".end", "exit status and segments left behind",
      worst(runs, [](const FaultOutcome& run) { return run.exit_status + static_cast<double>(run.left_over.size()); }),
      "", 0.0, 0.0, paused);
}

std::vector<Cell> row_of(const FaultSetup& setup, const FaultOutcome& outcome, bool counts) {
  const bool loop_lives = setup.fault != Fault::kHapticKilled;
  return {std::string(name_of(setup)),
          std::string(counts ? "yes" : "no"),
          outcome.before_n,
          milliseconds(outcome.zero_ms),
          ends_in_zero(setup) ? Cell(promised_zero_ms(setup)) : Cell(std::string("-")),
          outcome.lowest_n,
          comes_back(setup) ? milliseconds(outcome.back_ms) : Cell(std::string("-")),
          100.0 * outcome.growth_per_ms,
          outcome.pause_ms,
          loop_lives ? Cell(static_cast<double>(outcome.ticks)) : Cell(std::string("-")),
          loop_lives ? Cell(static_cast<double>(outcome.due)) : Cell(std::string("-")),
          static_cast<double>(outcome.restarts),
          outcome.topics > 0 ? Cell(std::to_string(outcome.topics_back) + " of " + std::to_string(outcome.topics))
                             : Cell(std::string("-"))};
}

/// All runs of one cell. @returns how many did not count because the machine paused.
int run_cell(const FaultSetup& setup, int runs, Table& table, Experiment& experiment) {
  std::vector<FaultOutcome> counted;
  MachineLoad uncounted;
  int paused = 0;
  for (int tries = 0; static_cast<int>(counted.size()) < runs && tries < kTriesPerRun * runs; ++tries) {
    if (interrupted()) break;
    std::fprintf(stderr, "faults: %s, run %zu of %d\n", name_of(setup), counted.size() + 1, runs);
    FaultOutcome outcome = run_fault_cell(setup);
    const bool counts = outcome.problem.empty() && outcome.pause_ms <= kMachinePause_ms;
    if (!outcome.problem.empty()) {
      experiment.note(std::string(name_of(setup)) + ": " + outcome.problem);
    } else if (!counts) {
      ++paused;
      uncounted.pause_ms = std::max(uncounted.pause_ms, outcome.pause_ms);
    }
    table.rows.push_back(row_of(setup, outcome, counts));
    if (!counts) continue;
    if (counted.empty()) {
      write_trace(experiment.folder() / (std::string(name_of(setup)) + "_trace.tsv"), outcome);
      experiment.add_run(setup.report);
    }
    outcome.trace.clear();
    counted.push_back(std::move(outcome));
  }
  check(setup, counted, counted.empty() ? uncounted : MachineLoad{}, experiment);
  return paused;
}

}  // namespace

void evaluate_faults(const FaultsOptions& options, Experiment& experiment) {
  Table table{
      "faults",
      {"fault", "counted", "force before [N]", "zero after [ms]", "promised [ms]", "lowest [N]", "back after [ms]",
       "growth [%/ms]", "longest pause [ms]", "ticks served", "due", "restarts", "topics back"},
      {}};
  std::vector<FaultSetup> cells;
  for (const Fault fault : kFaults) {
    cells.push_back({fault, nullptr, nullptr, options.program, options.session_file, "", ""});
  }
  for (const DeviceFault* const device : device_faults(options.quick)) {
    const std::string session_file = (std::filesystem::path(options.stand_ins) / device->session).string();
    cells.push_back({Fault::kDevice, device, nullptr, options.program, session_file, "", ""});
  }
  const std::string no_python = why_no_python_engine();
  if (!no_python.empty()) experiment.note(no_python);
  for (const PythonFault& python : python_faults()) {
    if (!no_python.empty()) break;
    cells.push_back({Fault::kPython, nullptr, &python, options.program, options.session_file, "", ""});
  }
  int paused = 0;
  for (FaultSetup& cell : cells) {
    cell.session = "faults-" + std::to_string(getpid());
    cell.report = (experiment.folder() / (std::string(name_of(cell)) + ".json")).string();
    paused += run_cell(cell, options.runs, table, experiment);
  }
  experiment.add_table(std::move(table));
  if (paused > 0) {
    experiment.note(std::to_string(paused) + " run(s) not counted: the machine paused for more than 5 ms");
  }
}

}  // namespace tools
