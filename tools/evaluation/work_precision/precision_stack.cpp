#include "tools/evaluation/work_precision/precision_stack.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <limits>

#include "tools/cli/common/interrupt.hpp"
#include "tools/evaluation/shared/force_profile.hpp"
#include "tools/evaluation/work_precision/precision_run.hpp"
#include "tools/evaluation/work_precision/precision_shown.hpp"
#include "tools/evaluation/work_precision/work_precision.hpp"

namespace tools {

namespace {

constexpr double kStiffness = 300.0, kDamping = 0.5;

PrecisionScene stack_scene(const PrecisionStackOptions& options, const std::string& file, int start) {
  PrecisionScene scene;
  scene.name = "stack";
  scene.session_file = file;
  scene.axis = 2;
  scene.from_s = kPileContact_s;
  scene.until_s = kPileEnd_s;
  char text[160];
  // Each start a little aside and a little later: tenths of a millimetre, fractions of a period.
  std::snprintf(text, sizeof text, "haptic.0.device.hand.start_m=[%.6g, 0, 0.015]", 1e-4 * (start - kPileStarts / 2));
  scene.assignments.emplace_back(text);
  std::snprintf(text, sizeof text, "haptic.0.device.hand.start_s=%.9g", kPileBegin_s + 0.0037 * start);
  scene.assignments.emplace_back(text);
  std::snprintf(text, sizeof text, "haptic.0.device.hand.speed_m_s=%.9g", kPilePush_m_s);
  scene.assignments.emplace_back(text);
  std::snprintf(text, sizeof text, "haptic.0.coupling={stiffness_n_per_m: %g, damping_n_s_per_m: %g}", kStiffness,
                kDamping);
  scene.assignments.emplace_back(text);
  scene.assignments.insert(scene.assignments.end(), options.assignments.begin(), options.assignments.end());
  return scene;
}

/// @param costs Gets a row per cell: its cost; what it is off by is known of the world that was shown.
Table closed_table(const PrecisionStackOptions& options, RunProgress& progress, std::vector<PrecisionRow>& costs) {
  Table table{"work_precision_stack_closed",
              {"method", "physics [Hz]", "mean force [N]", "impulse [N s per s]", "increments RMS [mN]",
               "above 30 Hz, RMS [mN]", "energy to the hand [mJ]", "haptics [ns/tick]", "physics [ms/step]",
               "CPU [ms/s]", "heap [KiB]", "diverged"},
              {}};
  const std::vector<double> rates =
      options.quick ? std::vector<double>{18, 100} : std::vector<double>{18, 43, 100, 1000};
  std::vector<PrecisionCell> cells;
  for (const haptic::MethodEntry& method : haptic::registered_methods()) {
    if (!method.needs_physics) continue;
    if (options.quick && method.server_force == haptic::ServerForce::kPredicted) continue;
    for (const double rate : rates) cells.push_back({std::string(method.name), rate, kPileRate_hz});
  }
  const int starts = options.quick ? 3 : kPileStarts;
  int done = 0;
  for (const PrecisionCell& cell : cells) {
    std::vector<double> mean, impulse, increments, vibration, given, cycle, step, cpu, heap;
    int diverged = 0;
    for (int start = 0; start < starts; ++start) {
      if (interrupted()) return table;
      progress.show_share(static_cast<double>(done++) / static_cast<double>(cells.size()) / starts,
                          "stack, " + cell.method);
      const PrecisionScene scene = stack_scene(options, options.session_file, start);
      const PrecisionTrace trace = run_precisely(scene, cell);
      std::vector<double> force_n;
      for (std::size_t i = 0; i < trace.time_s.size(); ++i) {
        if (trace.time_s[i] >= kPileContact_s) force_n.push_back(trace.force_n[i]);
      }
      const Roughness rough = roughness(force_n, kPileRate_hz);
      mean.push_back(rough.mean_n);
      // Per second of contact, without regard to the sign: what the hand has to bear.
      double sum = 0.0;
      for (const double each : force_n) sum += std::abs(each);
      impulse.push_back(force_n.empty() ? 0.0 : sum / static_cast<double>(force_n.size()));
      increments.push_back(rough.increment_rms_n);
      vibration.push_back(std::sqrt(rough.power_above_30hz_n2));
      given.push_back(-trace.absorbed_j);
      cycle.push_back(trace.cycle_ns);
      step.push_back(trace.step_ms);
      cpu.push_back(trace.cpu_s_per_s);
      heap.push_back(trace.heap_kib);
      diverged += trace.diverged() ? 1 : 0;
    }
    table.rows.push_back({cell.method, cell.physics_hz, interval_text(mean_interval(mean), 1.0),
                          interval_text(mean_interval(impulse), 1.0), interval_text(mean_interval(increments), 1e3),
                          interval_text(mean_interval(vibration), 1e3), interval_text(mean_interval(given), 1e3),
                          mean_interval(cycle).mean, mean_interval(step).mean, 1e3 * mean_interval(cpu).mean,
                          mean_interval(heap).mean, static_cast<double>(diverged)});
    costs.push_back({cell, {}, {}});
    costs.back().trace.cpu_s_per_s = mean_interval(cpu).mean;
    costs.back().trace.limit_n = diverged == 0 ? std::numeric_limits<double>::infinity() : -1.0;
  }
  return table;
}

}  // namespace

MeanInterval mean_interval(const std::vector<double>& values) {
  // Student's t at 97.5 % for 1 … 20 degrees of freedom (any table); more are taken as 20, which errs to the wide side.
  constexpr double kT[] = {12.706, 4.303, 3.182, 2.776, 2.571, 2.447, 2.365, 2.306, 2.262, 2.228,
                           2.201,  2.179, 2.160, 2.145, 2.131, 2.120, 2.110, 2.101, 2.093, 2.086};
  MeanInterval out;
  const auto n = static_cast<double>(values.size());
  for (const double each : values) out.mean += each / n;
  if (values.size() < 2) return {out.mean, std::numeric_limits<double>::quiet_NaN()};
  double squares = 0.0;
  for (const double each : values) squares += (each - out.mean) * (each - out.mean);
  const std::size_t freedom = std::min<std::size_t>(values.size() - 1, std::size(kT));
  out.half_width = kT[freedom - 1] * std::sqrt(squares / (n - 1.0) / n);
  return out;
}

void evaluate_precision_stack(const PrecisionStackOptions& options, Experiment& experiment, RunProgress& progress) {
  std::vector<ShownPile> piles;
  for (const std::string& file : options.pile_files) {
    const std::string pile = std::filesystem::path(file).stem().string();
    piles.push_back({pile, [&options, file](int start) { return stack_scene(options, file, start); }});
    if (options.quick) break;
  }
  Table shown = show_piles(piles, options.quick ? 3 : kPileStarts, experiment, progress);
  std::vector<PrecisionRow> costs, rows;
  Table closed = closed_table(options, progress, costs);
  for (PrecisionRow& row : costs) {
    const auto same = [&row](const std::vector<Cell>& each) {
      return std::get<std::string>(each[0]) == row.cell.method && std::get<double>(each[1]) == row.cell.physics_hz;
    };
    const auto found = std::find_if(shown.rows.begin(), shown.rows.end(), same);
    if (found == shown.rows.end()) continue;  // a method that moves bodies cannot be shown a world
    row.error.force_rms_n = std::get<double>((*found)[2]);
    rows.push_back(std::move(row));
  }
  if (!rows.empty()) draw_precision(experiment, "stack_125", "one world shown, cost of the closed loop", rows);
  experiment.add_table(std::move(shown));
  experiment.add_table(std::move(closed));
}

std::string interval_text(const MeanInterval& interval, double scale) {
  char text[64];
  std::snprintf(text, sizeof text, "%.3g ± %.2g", scale * interval.mean, scale * interval.half_width);
  return text;
}

}  // namespace tools
