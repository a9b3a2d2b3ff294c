#include <array>
#include <cmath>
#include <cstdio>
#include <fstream>

#include "haptic_node/rendering/registry.hpp"
#include "tools/cli/common/gnuplot.hpp"
#include "tools/evaluation/stability/parallel_cases.hpp"
#include "tools/evaluation/stability/stability.hpp"

namespace tools {

namespace {

/// What the theory of the boundaries knows of the device: phantom_desktop, and the loop at 1 kHz.
constexpr double kViscousNSPerM = 0.05, kPeriodS = 1e-3;
/// Damping of the maps over the rate of physics, as a part of the stiffness.
constexpr double kDampingS = 1e-3;

struct Axis {
  double low, high;
  int count;
  [[nodiscard]] double at(int i) const { return low * std::pow(high / low, static_cast<double>(i) / (count - 1)); }
};

/// Nobody, a soft and a stiff hand: the three that each cell has to stand.
std::array<StabilityCase, 3> cell_cases(const std::string& method, bool paper, double stiffness, double damping,
                                        double physics_hz) {
  std::array<StabilityCase, 3> out;
  for (int i = 0; i < 3; ++i) {
    StabilityCase& each = out[static_cast<std::size_t>(i)];
    each.method = method;
    each.paper = paper;
    each.hand = static_cast<StabilityHand>(i);
    each.task = each.hand == StabilityHand::kNone ? StabilityTask::kDrop : StabilityTask::kPress;
    each.stiffness_n_per_m = stiffness;
    each.damping_n_s_per_m = damping;
    each.stiff_device = true;
    each.physics_hz = physics_hz;
    each.height_m = 0.01;
    each.depth_m = 1.5 * (1.0 / stiffness + 1.0 / (each.hand == StabilityHand::kSoft ? 100.0 : 700.0));
    each.depth_m = std::min(each.depth_m, 0.04);
    each.phase = 0.3;
  }
  return out;
}

std::string number(double value) {
  char text[32];
  std::snprintf(text, sizeof text, "%.6g", value);
  return text;
}

std::string script(const StabilityMap& map) {
  // One series per outcome, so that each has its place in the key, whether it occurs or not.
  struct Look {
    StabilityOutcome outcome;
    const char* style;
    const char* title;
  };
  constexpr std::array looks{Look{StabilityOutcome::kSettled, "pt 5 ps 1.6 lc rgb '#7fbf7f'", "settled"},
                             Look{StabilityOutcome::kMoving, "pt 5 ps 1.6 lc rgb '#b8cfe5'", "still moving"},
                             Look{StabilityOutcome::kLimitCycle, "pt 5 ps 1.6 lc rgb '#f0c040'", "limit cycle"},
                             Look{StabilityOutcome::kDiverged, "pt 5 ps 1.6 lc rgb '#d04030'", "diverged"},
                             Look{StabilityOutcome::kFailed, "pt 9 ps 1.6 lc rgb 'black'", "failed"}};
  std::string out = "set title " + gnuplot_quoted(map.title) + "\nset logscale xy\nset xlabel " +
                    gnuplot_quoted(map.x_label) + "\nset ylabel " + gnuplot_quoted(map.y_label) +
                    "\nset yrange [7:30000]\nset key outside right top\nset grid lc rgb 'gray85'\n";
  const double low = map.cells.front().x / 1.3, high = map.cells.back().x * 1.3;
  out += "set xrange [" + number(low) + ":" + number(high) + "]\nplot ";
  const std::string file = gnuplot_quoted(map.stem + ".tsv");
  for (const Look& look : looks) {
    out += (&look == &looks.front() ? "" : ", \\\n     ") + file +
           " using 1:($3==" + std::to_string(static_cast<int>(look.outcome)) + "?$2:NaN) with points " + look.style +
           " title " + gnuplot_quoted(look.title);
  }
  int dash = 1;
  for (const auto& [function, title] : map.lines) {
    out += ", \\\n     " + function + " with lines lw 2 dt " + std::to_string(dash++) + " lc rgb 'black' title " +
           gnuplot_quoted(title);
  }
  return out + "\n";
}

}  // namespace

std::vector<StabilityMap> run_maps(const StabilityOptions& options, int jobs,
                                   const std::function<void(std::size_t, std::size_t)>& progress,
                                   std::vector<StabilityResult>& results) {
  const Axis stiffness{10.0, 20000.0, options.fine_maps ? 24 : 9};
  const Axis rate{5.0, 1000.0, options.fine_maps ? 20 : 6};
  const Axis damping{0.01, 20.0, options.fine_maps ? 20 : 6};
  std::vector<StabilityMap> maps;
  std::vector<std::pair<std::size_t, StabilityCase>> cases;  // map and case, three to a cell
  const auto add = [&](StabilityMap map, const std::string& method, bool paper, const Axis& x, bool rates) {
    for (int i = 0; i < x.count; ++i) {
      for (int j = 0; j < stiffness.count; ++j) {
        const double K = stiffness.at(j);
        map.cells.push_back({x.at(i), K, StabilityOutcome::kSettled, 0.0, 0.0});
        for (const StabilityCase& each : rates ? cell_cases(method, paper, K, kDampingS * K, x.at(i))
                                               : cell_cases(method, paper, K, x.at(i), 1000.0)) {
          cases.emplace_back(maps.size(), each);
        }
      }
    }
    maps.push_back(std::move(map));
  };
  for (const haptic::MethodEntry& method : haptic::registered_methods()) {
    if (!method.needs_physics) continue;
    for (const bool paper : {false, true}) {
      if (paper && method.needs_contacts) continue;  // the paper does not have it
      const std::string name(method.name);
      StabilityMap map{"map_rate_" + name + (paper ? "_paper" : ""),
                       name + (paper ? ", as published" : "") + ": worst of no, soft and stiff hand, 1 kHz, B = K·1 ms",
                       "rate of physics [Hz], delivered one period late",
                       "stiffness asked for [N/m]",
                       {},
                       {}};
      // Age of what is held: a period until it is there, half a period on the average after that. The
      // surface of local_contact is in the loop.
      map.lines = {
          {number(2.0 * kViscousNSPerM / kPeriodS), "K = 2b/T (passivity, B = 0)"},
          {number(kViscousNSPerM) + "/(" + number(0.5 * kPeriodS) + (method.needs_contacts ? ")" : "+1.5/x)"),
           method.needs_contacts ? "K = b/(T/2) (linear, B = 0)" : "K = b/(T/2 + 1.5 periods) (linear, B = 0)"},
          {"4100", "rendered at most at 1 kHz"}};
      add(std::move(map), name, paper, rate, true);
    }
  }
  for (const char* const name : {"direct", StabilityEnvelope::kRemote, StabilityEnvelope::kLocal}) {
    StabilityMap map{std::string("map_damping_") + name,
                     std::string(name) + ": worst of no, soft and stiff hand, loop and physics at 1 kHz",
                     "damping asked for [N s/m]",
                     "stiffness asked for [N/m]",
                     {},
                     {}};
    const double delay_s = std::string(name) == StabilityEnvelope::kRemote ? 1.5e-3 : 0.0;  // to the hand's own motion
    map.lines = {
        {"(" + number(kViscousNSPerM) + ">x?2*(" + number(kViscousNSPerM) + "-x)/" + number(kPeriodS) + ":NaN)",
         "K = 2(b - B)/T (passivity)"},
        {"(" + number(kViscousNSPerM) + "+x)/" + number(0.5 * kPeriodS + delay_s), "K = (b + B)/(T/2 + t_d) (linear)"},
        {"4100", "rendered at most at 1 kHz"}};
    add(std::move(map), name, false, damping, false);
  }

  results.assign(cases.size(), {});
  std::size_t done = 0;
  const bool whole = run_cases(
      cases.size(), jobs,
      [&](std::size_t i) { return run_case(cases[i].second, options.session_file, options.assignments); },
      [&](const StabilityResult& result) {
        results[result.index] = result;
        if (++done % 20 == 0) progress(done, cases.size());
      });
  if (!whole) return {};
  std::vector<std::size_t> next(maps.size(), 0);
  for (std::size_t i = 0; i < cases.size(); ++i) {
    const std::size_t map = cases[i].first;
    MapCell& cell = maps[map].cells[next[map]++ / 3];
    cell.worst = std::max(cell.worst, results[i].outcome);
    cell.swing_n = std::max(cell.swing_n, results[i].swing_n);
    cell.rendered_n_per_m = results[i].rendered_n_per_m;
  }
  return maps;
}

void draw_maps(Experiment& experiment, const std::vector<StabilityMap>& maps) {
  const auto gnuplot = Gnuplot::find();
  if (!gnuplot) experiment.note("gnuplot is not there: no maps are drawn");
  for (const StabilityMap& map : maps) {
    std::ofstream tsv(experiment.folder() / (map.stem + ".tsv"));
    tsv << "# " << map.x_label << '\t' << map.y_label
        << "\toutcome (0 settled, 1 moving, 2 limit cycle, 3 diverged, 4 failed)\tswing [N p-p]\trendered [N/m]\n";
    for (const MapCell& cell : map.cells) {
      tsv << cell.x << '\t' << cell.y << '\t' << static_cast<int>(cell.worst) << '\t' << cell.swing_n << '\t'
          << cell.rendered_n_per_m << '\n';
    }
    tsv.close();
    if (!gnuplot) continue;
    Figure figure;
    figure.stem = map.stem;
    figure.body = script(map);
    const auto drawn = gnuplot->draw(experiment.folder(), figure);
    if (!drawn) {
      experiment.note("no figure " + map.stem + ": " + drawn.error());
      continue;
    }
    for (const auto& file : *drawn) experiment.add_figure(file);
  }
}

}  // namespace tools
