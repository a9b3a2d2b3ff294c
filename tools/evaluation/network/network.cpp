#include "tools/evaluation/network/network.hpp"

#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <stdexcept>
#include <thread>
#include <utility>

#include "haptic_node/across_network.hpp"
#include "tools/cli/common/run_progress.hpp"
#include "tools/evaluation/network/network_grid.hpp"
#include "tools/evaluation/stability/parallel_cases.hpp"

namespace tools {

namespace {

constexpr double kLastThird = 2.0 / 3.0;
constexpr double kFreeRise = 0.3 / 1.157583690279;  // of the direction [1, 0.3, 0.5] of a move in free air

StabilityCase case_of(const NetworkGridCell& cell) {
  const NetworkMethod& method = network_methods()[cell.method];
  StabilityCase out = network_scenes()[cell.scene].task == StabilityTask::kFree
                          ? network_move(method, cell.network)
                          : network_cell(method, network_scenes()[cell.scene].task, cell.network);
  out.seed = 1;
  return out;
}

/// Mean force against the move over the last third of the way.
double drag_n_s_per_m(const std::vector<StabilityTick>& run, const StabilityCase& each) {
  const double way_s = each.height_m / each.speed_m_s, from_s = each.start_s() + kLastThird * way_s;
  double sum_n = 0.0;
  std::size_t count = 0;
  for (const StabilityTick& tick : run) {
    if (tick.time_s < from_s || tick.time_s > each.start_s() + 0.95 * way_s) continue;
    sum_n += tick.force_n;
    ++count;
  }
  return count == 0 ? 0.0 : -sum_n / static_cast<double>(count) / (each.speed_m_s * kFreeRise);
}

std::vector<NetworkGridCell> grid(bool quick) {
  const std::vector<double> trips =
      quick ? std::vector<double>{0.0, 0.05, 0.2, 0.5} : std::vector<double>{0.0, 0.01, 0.05, 0.1, 0.2, 0.5};
  const std::vector<double> losses = quick ? std::vector<double>{0.0, 0.1} : std::vector<double>{0.0, 0.01, 0.1, 0.3};
  std::vector<NetworkGridCell> out;
  for (std::size_t scene = 0; scene < network_scenes().size(); ++scene) {
    for (std::size_t method = 0; method < network_methods().size(); ++method) {
      for (const double trip_s : trips) {
        for (const double jitter : {0.0, 0.3}) {
          if (trip_s == 0.0 && jitter > 0.0) continue;
          for (const double lost : losses) {
            out.push_back({scene, method, {.round_trip_s = trip_s, .jitter_share = jitter, .lost_share = lost}});
          }
        }
      }
    }
  }
  return out;
}

using Trace = std::vector<StabilityTick>;

std::vector<StabilityResult> run_grid(const std::vector<NetworkGridCell>& cells, const NetworkExperiment& options,
                                      RunProgress& progress) {
  // The same hand without a network, once for each method and scene; the workers inherit it.
  std::map<std::pair<std::size_t, std::size_t>, Trace> truths;
  for (std::size_t scene = 0; scene < network_scenes().size(); ++scene) {
    for (std::size_t method = 0; method < network_methods().size(); ++method) {
      progress.show_share(0.0, std::string("without a network: ") + network_scenes()[scene].name);
      const StabilityResult result = run_case(case_of({scene, method, {}}), options.session_file, options.assignments,
                                              false, &truths[{scene, method}]);
      if (result.error[0] != 0) throw std::runtime_error(result.error);
    }
  }
  const auto work = [&](std::size_t i) {
    const NetworkGridCell& cell = cells[i];
    if (cell.refused()) return StabilityResult{};
    const StabilityCase each = case_of(cell);
    Trace trace;
    StabilityResult out = run_case(each, options.session_file, options.assignments, false, &trace);
    out.truth = compare_runs(trace, truths.at({cell.scene, cell.method}), each.start_s());
    if (each.task == StabilityTask::kFree) out.truth.drag_n_s_per_m = drag_n_s_per_m(trace, each);
    return out;
  };
  std::vector<StabilityResult> results(cells.size());
  const std::size_t tell_every = std::max<std::size_t>(cells.size() / 10, 1);  // where no bar is drawn
  std::size_t done = 0;
  const bool whole = run_cases(cells.size(), jobs_of(options), work, [&](const StabilityResult& result) {
    results[result.index] = result;
    ++done;
    const std::string told = std::to_string(done) + " of " + std::to_string(cells.size()) + " cells";
    progress.show_share(static_cast<double>(done) / static_cast<double>(cells.size()), told);
    if (done % tell_every == 0) progress.log(told);
  });
  progress.clear();
  if (!whole) throw std::runtime_error("interrupted after " + std::to_string(done) + " cells");
  return results;
}

constexpr double kStiffest = 1480.0;  // of the device

std::vector<StiffnessRow> stiffest(const NetworkExperiment& options, RunProgress& progress) {
  const std::vector<double> trips =
      options.quick ? std::vector<double>{0.05, 0.2} : std::vector<double>{0.01, 0.05, 0.1, 0.2, 0.5};
  std::vector<double> gains;
  for (double stiffness = 1.0; stiffness < kStiffest; stiffness *= 2.0) gains.push_back(stiffness);
  gains.push_back(kStiffest);
  const std::vector<StabilityTask> tasks{StabilityTask::kFree, StabilityTask::kPress};
  struct Run {
    std::size_t method;
    double round_trip_s, stiffness_n_per_m;
    StabilityTask task;
  };
  std::vector<Run> runs;
  for (std::size_t method = 0; method < network_methods().size(); ++method) {
    for (const double trip_s : trips) {
      for (const double stiffness : gains) {
        for (const StabilityTask task : tasks) runs.push_back({method, trip_s, stiffness, task});
      }
    }
  }
  std::vector<bool> swings(runs.size());
  std::size_t done = 0;
  const bool whole = run_cases(
      runs.size(), jobs_of(options),
      [&](std::size_t i) {
        const Run& run = runs[i];
        StabilityCase each = network_cell(network_methods()[run.method], run.task, {.round_trip_s = run.round_trip_s});
        each.hand = StabilityHand::kSoft;
        each.stiffness_n_per_m = run.stiffness_n_per_m;
        each.damping_n_s_per_m = 0.0;
        if (run.task == StabilityTask::kFree) each.height_m = 0.03;
        return run_case(each, options.session_file, options.assignments, false);
      },
      [&](const StabilityResult& result) {
        swings[result.index] =
            result.outcome == StabilityOutcome::kDiverged || result.outcome == StabilityOutcome::kFailed;
        ++done;
        progress.show_share(static_cast<double>(done) / static_cast<double>(runs.size()),
                            std::to_string(done) + " of " + std::to_string(runs.size()) + " gains");
      });
  progress.clear();
  if (!whole) throw std::runtime_error("interrupted");
  std::vector<StiffnessRow> out;
  for (std::size_t i = 0; i < runs.size(); i += gains.size() * tasks.size()) {
    StiffnessRow row{runs[i].method, runs[i].round_trip_s, 0.0};
    for (std::size_t k = 0; k < gains.size(); ++k) {
      if (swings[i + 2 * k] || swings[i + 2 * k + 1]) break;
      row.stable_n_per_m = gains[k];
    }
    out.push_back(row);
  }
  return out;
}

Table table_of(const std::vector<NetworkGridCell>& cells, const std::vector<StabilityResult>& results) {
  Table table{"network_cells",
              {"scene", "method", "round trip [ms]", "jitter [%]", "loss [%]", "age, p50 [ms]", "age, max [ms]",
               "force RMS [N]", "force peak [N]", "position RMS [mm]", "drift [mm]", "given [mJ]",
               "lowest observed [mJ]", "drag [N s/m]", "without answer [s]", "outcome"},
              {}};
  for (std::size_t i = 0; i < cells.size(); ++i) {
    const NetworkGridCell& cell = cells[i];
    const StabilityResult& r = results[i];
    if (cell.refused()) {
      std::vector<Cell> row{std::string(network_scenes()[cell.scene].name),
                            std::string(network_methods()[cell.method].name), 1e3 * cell.network.round_trip_s,
                            100.0 * cell.network.jitter_share, 100.0 * cell.network.lost_share};
      row.resize(table.columns.size() - 1, std::string("-"));
      row.push_back(std::string("refused"));
      table.rows.push_back(std::move(row));
      continue;
    }
    table.rows.push_back({std::string(network_scenes()[cell.scene].name),
                          std::string(network_methods()[cell.method].name), 1e3 * cell.network.round_trip_s,
                          100.0 * cell.network.jitter_share, 100.0 * cell.network.lost_share, 1e3 * r.age_p50_s,
                          1e3 * r.age_max_s, r.truth.force_rms_n, r.truth.force_peak_n, 1e3 * r.truth.position_rms_m,
                          1e3 * r.truth.drift_m, 1e3 * r.truth.given_j, 1e3 * r.lowest_observed_j,
                          r.truth.drag_n_s_per_m, r.stale_s, std::string(to_string(r.outcome))});
  }
  return table;
}

std::size_t hands_of(const NetworkGridCell& cell) {
  return network_scenes()[cell.scene].task == StabilityTask::kSecondHand ? 2 : 1;
}

}  // namespace

bool NetworkGridCell::refused() const {
  return network.exists() &&
         haptic::refused_across_network(*haptic::find_method(network_methods()[method].method), hands_of(*this));
}

bool NetworkGridCell::usual() const {
  const NetworkMethod& each = network_methods()[method];
  const bool local_is_refused =
      haptic::refused_across_network(*haptic::find_method(StabilityEnvelope::kLocal), hands_of(*this));
  const std::string name = local_is_refused ? StabilityEnvelope::kRemote : StabilityEnvelope::kLocal;
  return each.both() && each.method == name;
}

const std::vector<NetworkScene>& network_scenes() {
  static const std::vector<NetworkScene> scenes{{"wall", StabilityTask::kPress, false, 0.05},
                                                {"free block", StabilityTask::kBlock, false, 0.05},
                                                {"moving plate", StabilityTask::kPlate, true, 0.0075},
                                                {"second hand", StabilityTask::kSecondHand, true, 0.05},
                                                {"free air", StabilityTask::kFree, false, 0.02}};
  return scenes;
}

int jobs_of(const NetworkExperiment& options) {
  return options.jobs > 0 ? options.jobs : static_cast<int>(std::max(1U, std::thread::hardware_concurrency()));
}

void evaluate_network(const NetworkExperiment& options, Experiment& experiment) {
  if (options.sweep > 0) return sweep_networks(options, experiment);
  const bool terminal = ::isatty(STDERR_FILENO) == 1;
  RunProgress progress(terminal, !terminal);
  const std::vector<NetworkGridCell> cells = grid(options.quick);
  const std::vector<StabilityResult> results = run_grid(cells, options, progress);
  experiment.add_table(table_of(cells, results));
  check_grid(cells, results, experiment);
  draw_forces(options, experiment);
  report_stiffness(stiffest(options, progress), experiment);
  experiment.note(
      "simulated Desktop, K = 300 N/m, physics 100 Hz, throttled; the link as it was is the age of the answers in use");
}

}  // namespace tools
