/// Checks and figures of `rtbus evaluate network`.
#include <algorithm>
#include <cmath>

#include "tools/cli/common/formatted.hpp"
#include "tools/evaluation/network/network_grid.hpp"
#include "tools/evaluation/shared/panels.hpp"

namespace tools {

namespace {

constexpr double kBarTrip_s = 0.2, kBarJitter = 0.3, kBarLost = 0.1;
constexpr double kBar_n = 0.05;
constexpr double kDragRoom = 1.1;

bool is_bar_cell(const NetworkOptions& network) {
  return network.round_trip_s == kBarTrip_s && network.jitter_share == kBarJitter && network.lost_share == kBarLost;
}

std::string id_of(const NetworkMethod& method, const NetworkScene& scene) {
  std::string out = std::string("network.") + method.method + "." + scene.name;
  std::replace(out.begin(), out.end(), ' ', '_');
  return out;
}

const char* style_of(std::size_t method) {
  constexpr const char* styles[] = {"pt 4 lc rgb 'gray40'", "pt 9 lc rgb '#c45a00'", "pt 8 lc rgb '#a0308a'",
                                    "pt 7 lc rgb '#1f5fa8'", "pt 13 lc rgb '#1b7a35'"};
  return styles[method % std::size(styles)];
}

PanelLine line_of(std::size_t method) {
  PanelLine out;
  out.name = network_methods()[method].name;
  out.style = style_of(method);
  out.points = true;
  return out;
}

/// Force error over the round trip at the jitter and loss of the bars, and the drag with its theory.
void draw_errors(const std::vector<NetworkGridCell>& cells, const std::vector<StabilityResult>& results,
                 Experiment& experiment) {
  std::vector<Panel> panels;
  for (std::size_t s = 0; s < network_scenes().size(); ++s) {
    const NetworkScene& scene = network_scenes()[s];
    const bool air = scene.task == StabilityTask::kFree;
    Panel panel{air ? "free air: drag" : std::string(scene.name) + ": force error, RMS",
                "round trip [ms]",
                air ? "drag [N s/m]" : "force [N]",
                {},
                "set xrange [0:520]\nset yrange [0:*]"};
    for (std::size_t m = 0; m < network_methods().size(); ++m) {
      PanelLine line = line_of(m);
      for (std::size_t i = 0; i < cells.size(); ++i) {
        const NetworkOptions& network = cells[i].network;
        const bool jittered = network.round_trip_s == 0.0 || network.jitter_share == kBarJitter;
        if (cells[i].scene != s || cells[i].method != m || !jittered || network.lost_share != kBarLost) continue;
        if (cells[i].refused()) continue;
        line.x.push_back(1e3 * network.round_trip_s);
        line.y.push_back(air ? results[i].truth.drag_n_s_per_m : results[i].truth.force_rms_n);
      }
      panel.lines.push_back(std::move(line));
    }
    if (air) {
      const double stiffness = network_move(network_methods().front(), {}).stiffness_n_per_m;
      panel.lines.push_back({"K times round trip", "lc rgb 'black' dt 2", {0.0, 500.0}, {0.0, 0.5 * stiffness}, false});
    }
    panels.push_back(std::move(panel));
  }
  draw_panels(experiment, "network_errors", "Jitter 30 %, loss 10 %, against the same hand without a network", panels);
}

/// The table of docs/distributed.md: what a session can have, at the jitter and loss of the bars.
Table summary_of(const std::vector<NetworkGridCell>& cells, const std::vector<StabilityResult>& results) {
  Table table{"network_summary", {"scene", "method", "figure"}, {}};
  std::vector<double> trips_s;
  for (const NetworkGridCell& cell : cells) {
    const double trip_s = cell.network.round_trip_s;
    if (trip_s <= 0.0 || std::find(trips_s.begin(), trips_s.end(), trip_s) != trips_s.end()) continue;
    trips_s.push_back(trip_s);
    table.columns.push_back(formatted("%g ms", 1e3 * trip_s));
  }
  for (std::size_t s = 0; s < network_scenes().size(); ++s) {
    for (std::size_t m = 0; m < network_methods().size(); ++m) {
      if (!network_methods()[m].both()) continue;
      const bool air = network_scenes()[s].task == StabilityTask::kFree;
      std::vector<Cell> row{std::string(network_scenes()[s].name), std::string(network_methods()[m].name),
                            std::string(air ? "drag [N s/m]" : "force error, RMS [N]")};
      for (std::size_t i = 0; i < cells.size(); ++i) {
        const NetworkOptions& network = cells[i].network;
        if (cells[i].scene != s || cells[i].method != m || network.round_trip_s <= 0.0) continue;
        if (network.jitter_share != kBarJitter || network.lost_share != kBarLost) continue;
        if (cells[i].refused()) {
          row.push_back(std::string("refused"));
        } else {
          row.push_back(air ? results[i].truth.drag_n_s_per_m : results[i].truth.force_rms_n);
        }
      }
      table.rows.push_back(std::move(row));
    }
  }
  return table;
}

PanelLine force_line(const std::vector<StabilityTick>& run, double from_s, double until_s) {
  PanelLine out;
  for (const StabilityTick& tick : run) {
    if (tick.time_s < from_s || tick.time_s > until_s) continue;
    out.x.push_back(tick.time_s - from_s);
    out.y.push_back(tick.force_n);
  }
  return out;
}

}  // namespace

void draw_forces(const NetworkExperiment& options, Experiment& experiment) {
  const NetworkOptions network{.round_trip_s = kBarTrip_s, .jitter_share = kBarJitter, .lost_share = kBarLost};
  std::vector<Panel> panels;
  for (const NetworkScene& scene : network_scenes()) {
    if (scene.task == StabilityTask::kFree) continue;
    Panel panel{scene.name, "time since the hand began to move [s]", "force [N]", {}, {}};
    for (std::size_t m = 0; m < network_methods().size(); ++m) {
      const NetworkMethod& method = network_methods()[m];
      if (!method.both()) continue;
      const auto at = static_cast<std::size_t>(&scene - network_scenes().data());
      if (NetworkGridCell{at, m, network}.refused()) continue;
      for (const bool behind : {false, true}) {
        StabilityCase each = network_cell(method, scene.task, behind ? network : NetworkOptions{});
        each.seed = 1;
        std::vector<StabilityTick> run;
        (void)run_case(each, options.session_file, options.assignments, false, &run);
        PanelLine line = force_line(run, each.start_s(), each.end_s() + 0.6);
        line.name = std::string(method.name) + (behind ? "" : ", no network");
        line.style = std::string(style_of(m)) + (behind ? "" : " dt 3");
        panel.lines.push_back(std::move(line));
      }
    }
    panels.push_back(std::move(panel));
  }
  draw_panels(experiment, "network_forces", "Force on the hand, 200 ms there and back, 30 % of jitter, 10 % lost",
              panels);
}

void check_grid(const std::vector<NetworkGridCell>& cells, const std::vector<StabilityResult>& results,
                Experiment& experiment) {
  const auto& methods = network_methods();
  for (std::size_t m = 0; m < methods.size(); ++m) {
    if (!methods[m].both()) continue;
    double diverged = 0.0, below = 0.0;
    for (std::size_t i = 0; i < cells.size(); ++i) {
      if (cells[i].method != m || cells[i].refused()) continue;
      const StabilityResult& r = results[i];
      diverged += r.outcome == StabilityOutcome::kDiverged || r.outcome == StabilityOutcome::kFailed ? 1.0 : 0.0;
      below += r.lowest_observed_j < r.deficit_bar_j() ? 1.0 : 0.0;
      const NetworkScene& scene = network_scenes()[cells[i].scene];
      if (scene.task == StabilityTask::kFree) {
        // The answer in use is as old as the round trip, the waiting for a step and the step.
        const double theory = network_move(methods[m], {}).stiffness_n_per_m * r.age_max_s;
        const bool local = std::string(methods[m].method) == StabilityEnvelope::kLocal;
        if (is_bar_cell(cells[i].network)) {
          experiment.check_at_most(id_of(methods[m], scene),
                                   std::string(methods[m].name) + (local ? ": drag" : ": drag, K times the age"),
                                   r.truth.drag_n_s_per_m, "N s/m", local ? 0.01 : kDragRoom * theory);
        }
        continue;
      }
      if (!is_bar_cell(cells[i].network) || !cells[i].usual()) continue;
      experiment.check_at_most(id_of(methods[m], scene),
                               std::string(scene.name) + ", 200 ms, 30 % jitter, 10 % loss: " + methods[m].method +
                                   ", force error, RMS" + (scene.moves_by_itself ? " (bar: K v R)" : ""),
                               r.truth.force_rms_n, "N", scene.moves_by_itself ? position_bound_n(scene) : kBar_n);
    }
    const std::string id = std::string("network.") + methods[m].method;
    experiment.check_at_most(id + ".diverged", std::string(methods[m].name) + ": cells diverged", diverged, "cells",
                             0.0);
    experiment.check_at_most(id + ".energy",
                             std::string(methods[m].name) + ": cells with observed energy below -(0.5 mJ + |F||dx|)",
                             below, "cells", 0.0);
  }
  experiment.add_table(summary_of(cells, results));
  draw_errors(cells, results, experiment);
}

double position_bound_n(const NetworkScene& scene) {
  return network_move(network_methods().front(), {}).stiffness_n_per_m * scene.speed_m_s * kBarTrip_s;
}

void report_stiffness(const std::vector<StiffnessRow>& rows, Experiment& experiment) {
  Table table{"network_stiffness", {"method", "round trip [ms]", "largest stable K [N/m]", "b/R", "b/(0.217 R)"}, {}};
  Panel panel{"Largest stiffness that does not swing, light hand (b = 1 N s/m)",
              "round trip [ms]",
              "K [N/m]",
              {},
              "set logscale xy\nset xrange [8:600]\nset yrange [1:3000]"};
  for (std::size_t m = 0; m < network_methods().size(); ++m) panel.lines.push_back(line_of(m));
  PanelLine reflected{"b/R: force sent back", "lc rgb 'black' dt 2", {}, {}, false};
  PanelLine setpoint{"b/(0.217 R): set-point sent back", "lc rgb 'black' dt 3", {}, {}, false};
  for (const StiffnessRow& row : rows) {
    const double plain = kLightDamping / row.round_trip_s, worst = plain / 0.217;
    table.rows.push_back(
        {std::string(network_methods()[row.method].name), 1e3 * row.round_trip_s, row.stable_n_per_m, plain, worst});
    panel.lines[row.method].x.push_back(1e3 * row.round_trip_s);
    panel.lines[row.method].y.push_back(std::max(row.stable_n_per_m, 1.0));
    if (row.method != 0) continue;
    reflected.x.push_back(1e3 * row.round_trip_s);
    reflected.y.push_back(plain);
    setpoint.x.push_back(1e3 * row.round_trip_s);
    setpoint.y.push_back(worst);
  }
  panel.lines.push_back(std::move(reflected));
  panel.lines.push_back(std::move(setpoint));
  experiment.add_table(std::move(table));
  draw_panels(experiment, "network_stiffness", "A light hand in free air and at a wall", {panel});
}

}  // namespace tools
