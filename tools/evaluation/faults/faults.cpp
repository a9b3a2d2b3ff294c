#include "tools/evaluation/faults/faults.hpp"

#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <deque>
#include <filesystem>
#include <list>
#include <map>
#include <thread>
#include <utility>

#include "rtbus/config/document.hpp"
#include "tools/cli/common/interrupt.hpp"
#include "tools/evaluation/faults/fault_cell.hpp"
#include "tools/evaluation/faults/fault_checks.hpp"

namespace tools {

namespace {

constexpr const char* kMethods[] = {"remote_virtual_coupling", "local_contact"};
constexpr int kTriesPerRun = 3;
constexpr int kMostBeside = 3;  ///< Cells at a time; each has a loop of 1 kHz and a plant of 4 kHz.
constexpr std::uint64_t kPollAll_ns = 50 * rtbus::kNsPerMs;

/// A row with one method, and its runs.
struct Case {
  const FaultRow* row;
  std::string method = {};  ///< Empty: the session's own.
  int tries = 0, paused = 0;
  double longest_pause_ms = 0.0;
  std::vector<FaultOutcome> counted = {}, failed = {};
};

std::string label(const Case& each) { return each.row->name + (each.method.empty() ? "" : "." + each.method); }

Cell milliseconds(double value) { return value < 0.0 ? Cell(std::string("never")) : Cell(value); }

std::vector<Cell> cells_of(const Case& each, const FaultOutcome& outcome, const char* counts) {
  const auto only_if = [](bool is, Cell cell) { return is ? std::move(cell) : Cell(std::string("-")); };
  const FaultRow& row = *each.row;
  return {row.name,
          each.method.empty() ? std::string("(own)") : each.method,
          std::string(counts),
          outcome.before_n,
          only_if(row.feels == Feels::kZero, milliseconds(outcome.zero_ms)),
          only_if(row.feels == Feels::kZero, row.zero_ms),
          outcome.lowest_n,
          outcome.peak_n,
          only_if(row.ends == Ends::kComesBack, milliseconds(outcome.back_ms)),
          100.0 * outcome.growth_per_ms,
          outcome.pause_ms,
          static_cast<double>(outcome.ticks),
          static_cast<double>(outcome.due),
          static_cast<double>(outcome.restarts),
          static_cast<double>(outcome.exit_status),
          static_cast<double>(outcome.left_over.size()),
          static_cast<double>(outcome.processes_left)};
}

/// Runs all cases, side by side where they do not disturb each other.
class Matrix {
 public:
  Matrix(const FaultsOptions& options, Experiment& experiment, std::vector<Case> cases)
      : options_(options), experiment_(experiment), cases_(std::move(cases)) {
    for (Case& each : cases_) {
      for (int run = 0; run < options.runs; ++run) (each.row->alone ? alone_ : beside_).push_back(&each);
    }
    all_ = alone_.size() + beside_.size();
  }

  void run() {
    const int cpus = static_cast<int>(std::thread::hardware_concurrency());
    drain(beside_, std::clamp(cpus, 1, kMostBeside));
    drain(alone_, 1);
  }

  void judge() {
    std::map<const FaultRow*, std::pair<std::vector<FaultOutcome>, double>> rows;
    int paused = 0;
    for (Case& each : cases_) {
      auto& [outcomes, paused_ms] = rows[each.row];
      paused += each.paused;
      for (const FaultOutcome& failed : each.failed) experiment_.note(label(each) + ": " + failed.problem);
      // A cell that never ran as meant has not kept its promise, whatever the others did.
      experiment_.check_between(
          "faults." + label(each) + ".ran", "runs that counted", static_cast<double>(each.counted.size()), "",
          options_.runs, options_.runs,
          each.paused > 0 && each.failed.empty() ? MachineLoad{.pause_ms = each.longest_pause_ms} : MachineLoad{});
      paused_ms = std::max(paused_ms, each.longest_pause_ms);
      std::move(each.counted.begin(), each.counted.end(), std::back_inserter(outcomes));
    }
    for (const Case& each : cases_) {
      const auto found = rows.find(each.row);
      if (found == rows.end()) continue;
      check_row(*each.row, found->second.first, found->second.second, experiment_);
      rows.erase(found);
    }
    experiment_.add_table(std::move(table_));
    if (paused > 0) {
      experiment_.note(std::to_string(paused) + " run(s) not counted: the machine paused for more than 5 ms");
    }
  }

 private:
  using Running = std::pair<Case*, FaultCell>;

  [[nodiscard]] FaultCell begin(Case& each) {
    const std::string file = (experiment_.folder() / (label(each) + "." + std::to_string(each.tries))).string();
    FaultSetup setup;
    setup.row = each.row;
    setup.method = each.method;
    setup.program = options_.program;
    setup.session_file = each.row->session.empty()
                             ? options_.session_file
                             : (std::filesystem::path(options_.stand_ins) / each.row->session).string();
    setup.session = "faults-" + std::to_string(getpid()) + "-" + std::to_string(++sessions_);
    setup.report = file + ".json";
    ++each.tries;
    return {std::move(setup), file + "_trace.tsv"};
  }

  void take(Case& each, FaultOutcome outcome, const std::string& report, std::deque<Case*>& queue) {
    const bool ran = outcome.problem.empty();
    const bool counts = ran && outcome.pause_ms <= kMachinePause_ms;
    std::string said = !ran ? outcome.problem : counts ? "" : "the machine paused: not counted";
    if (counts && each.row->feels == Feels::kZero) {
      char text[48];
      std::snprintf(text, sizeof text, "zero after %.1f ms of %.0f", outcome.zero_ms, each.row->zero_ms);
      said = text;
    }
    std::fprintf(stderr, "faults: %3zu of %zu  %s%s%s\n", done_ + (counts ? 1U : 0U), all_, label(each).c_str(),
                 said.empty() ? "" : ": ", said.c_str());
    table_.rows.push_back(cells_of(each, outcome, !ran ? "failed" : counts ? "yes" : "paused"));
    if (counts) {
      ++done_;
      if (each.counted.empty() && outcome.restarts >= 0) experiment_.add_run(report);
      each.counted.push_back(std::move(outcome));
      return;
    }
    if (ran) {
      ++each.paused;
      each.longest_pause_ms = std::max(each.longest_pause_ms, outcome.pause_ms);
    } else {
      each.failed.push_back(std::move(outcome));
    }
    // A pause says nothing about us; what went wrong otherwise stays a finding.
    if (ran && each.tries < kTriesPerRun * options_.runs) queue.push_back(&each);
  }

  void drain(std::deque<Case*>& queue, int most) {
    std::list<Running> running;
    while (!interrupted() && (!queue.empty() || !running.empty())) {
      while (!queue.empty() && static_cast<int>(running.size()) < most) {
        Case* const next = queue.front();
        queue.pop_front();
        running.emplace_back(next, begin(*next));
      }
      for (auto each = running.begin(); each != running.end();) {
        auto outcome = each->second.poll();
        if (!outcome) {
          ++each;
          continue;
        }
        Case& ended = *each->first;
        const std::string report = each->second.setup().report;
        each = running.erase(each);
        take(ended, std::move(*outcome), report, queue);
      }
      rtbus::sleep_until(rtbus::monotonic_ns() + kPollAll_ns);
    }
    queue.clear();
  }

  const FaultsOptions& options_;
  Experiment& experiment_;
  std::vector<Case> cases_;
  std::deque<Case*> beside_, alone_;
  Table table_{"faults",
               {"fault", "method", "counted", "force before [N]", "zero after [ms]", "promised [ms]", "lowest [N]",
                "peak [N]", "back after [ms]", "growth [%/ms]", "longest pause [ms]", "ticks served", "due", "restarts",
                "exit status", "segments left", "processes left"},
               {}};
  std::size_t all_ = 0, done_ = 0;
  int sessions_ = 0;
};

/// The rows that are wanted and can be run; what cannot is said loudly.
std::vector<Case> choose(const FaultsOptions& options, Experiment& experiment) {
  for (const std::string& name : options.only) {
    if (find_fault_row(name) == nullptr) {
      throw rtbus::config::Error("evaluate faults: there is no row '" + name + "'; --list prints those that there are");
    }
  }
  std::vector<Case> out;
  std::size_t turn = 0;
  for (const FaultRow& row : fault_rows()) {
    const bool named = std::find(options.only.begin(), options.only.end(), row.name) != options.only.end();
    if (!options.only.empty() ? !named : options.quick && !row.quick) continue;
    if (const std::string why = row.why_not != nullptr ? row.why_not() : ""; !why.empty()) {
      std::fprintf(stderr, "faults: SKIPPED %s: %s\n", row.name.c_str(), why.c_str());
      experiment.note("skipped: " + row.name + ": " + why);
      continue;
    }
    if (!row.session.empty() || !row.both_methods) {
      out.push_back({&row, ""});
    } else if (options.quick) {
      out.push_back({&row, kMethods[turn++ % std::size(kMethods)]});
    } else {
      for (const char* const method : kMethods) out.push_back({&row, method});
    }
  }
  return out;
}

}  // namespace

void evaluate_faults(const FaultsOptions& options, Experiment& experiment) {
  Matrix matrix(options, experiment, choose(options, experiment));
  matrix.run();
  matrix.judge();
}

void list_faults() {
  for (const FaultRow& row : fault_rows()) {
    const std::string why = row.why_not != nullptr ? row.why_not() : "";
    std::printf("%-26s %s%s%s\n", row.name.c_str(), row.what.c_str(), why.empty() ? "" : "; not here: ", why.c_str());
  }
}

}  // namespace tools
