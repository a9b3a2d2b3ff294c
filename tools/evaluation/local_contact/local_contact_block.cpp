/// Claims a and f of `rtbus evaluate local-contact`: a block that gives way, against the loop that knows of no latency.
#include <algorithm>
#include <cmath>
#include <cstdio>

#include "tools/cli/common/formatted.hpp"
#include "tools/cli/common/interrupt.hpp"
#include "tools/evaluation/local_contact/local_contact.hpp"
#include "tools/evaluation/shared/method_settings.hpp"

namespace tools {

namespace {

constexpr double kConverged_hz = 10000.0;
constexpr double kBetter = 0.2;  // a fifth of remote coupling's error
constexpr double kDearest_us = 10.0;

struct Gain {
  double stiffness_n_per_m;
  double bar_n;  ///< Where remote coupling diverges.
};
constexpr std::size_t kLocal = 0, kRemote = 1;  ///< In kAllCompared.
constexpr Gain kGains[] = {{500.0, 0.25}, {1000.0, 0.6}};

PrecisionScene pushed_block(const LocalContactOptions& options, double stiffness_n_per_m) {
  WorkPrecisionOptions precision;
  precision.block_file = options.config_folder + "/free_block.yaml";
  PrecisionScene scene = block_scene(precision);
  scene.assignments.push_back(formatted("haptic.0.coupling.stiffness_n_per_m=%.17g", stiffness_n_per_m));
  scene.assignments.insert(scene.assignments.end(), options.assignments.begin(), options.assignments.end());
  return scene;
}

PanelLine force_line(PanelLine line, const PrecisionTrace& trace, const PrecisionScene& scene) {
  for (std::size_t i = 0; i < trace.time_s.size(); ++i) {
    if (trace.time_s[i] < scene.from_s) continue;
    line.x.push_back(trace.time_s[i]);
    line.y.push_back(trace.force_n[i]);
  }
  return line;
}

}  // namespace

void claim_block(const LocalContactOptions& options, Experiment& experiment, RunProgress& progress) {
  Table table{"local_contact_block",
              {"K [N/m]", "physics [Hz]", "method", "force RMS [N]", "force peak [N]", "outcome", "cycle, median [us]",
               "cycle, p99 [us]"},
              {}};
  std::vector<Panel> panels;
  const LoadMeter meter;
  double dearest_us = 0.0;
  int done = 0;
  for (const Gain& gain : kGains) {
    const PrecisionScene scene = pushed_block(options, gain.stiffness_n_per_m);
    progress.show_share(0.1 + 0.05 * done, "block, converged loop");
    const PrecisionTrace finest = nearly_continuous(scene, kConverged_hz);
    const std::string stiffness = formatted("K = %g N/m", gain.stiffness_n_per_m);
    Panel forces{"Force on the hand, " + stiffness + ", physics 18 Hz", "time [s]", "force [N]", {}, {}};
    Panel errors{"RMS of the error, " + stiffness,
                 "results of physics [Hz]",
                 "force error [N]",
                 {},
                 "set logscale xy\nset xrange [15:120]\nset xtics (18, 43, 100)"};
    std::vector<PanelLine> lines;
    for (const char* method : kAllCompared) lines.push_back(method_line(method));
    for (PanelLine& line : lines) line.points = true;
    for (const double rate_hz : {100.0, 43.0, 18.0}) {
      if (interrupted()) return;
      progress.show_share(0.1 + 0.05 * done++, "block, " + stiffness);
      double error_n[std::size(kAllCompared)] = {};
      bool diverged = false;
      for (std::size_t m = 0; m < std::size(kAllCompared); ++m) {
        const std::string method = kAllCompared[m];
        const bool local = method == kLocalContact;
        const PrecisionTrace trace = run_precisely(scene, {method, rate_hz});
        const PrecisionError error = error_of(trace, scene, reference_of(finest));
        error_n[m] = error.force_rms_n;
        if (method == kRemoteCoupling) diverged = trace.diverged();
        table.rows.push_back({gain.stiffness_n_per_m, rate_hz, method, error.force_rms_n, error.force_peak_n,
                              std::string(trace.diverged() ? "diverged" : "bounded"), 1e-3 * trace.cycle_ns,
                              1e-3 * trace.cycle_p99_ns});
        if (local) dearest_us = std::max(dearest_us, 1e-3 * trace.cycle_p99_ns);
        lines[m].x.push_back(rate_hz);
        lines[m].y.push_back(error.force_rms_n);
        if (rate_hz == 18.0) forces.lines.push_back(force_line(method_line(method), trace, scene));
      }
      char id[80];
      std::snprintf(id, sizeof id, "local-contact.block.k%g.%ghz", gain.stiffness_n_per_m, rate_hz);
      const std::string what = "block, " + stiffness + formatted(", physics %g Hz: ", rate_hz);
      if (diverged) {
        experiment.check_at_most(id, what + "force error, RMS (remote coupling diverges)", error_n[kLocal], "N",
                                 gain.bar_n);
      } else {
        experiment.check_at_most(id, what + "force error over remote coupling's", error_n[kLocal] / error_n[kRemote],
                                 "1", kBetter);
      }
    }
    PanelLine reference{"without latency, 10 kHz", "lc rgb 'black' dt 2", {}, {}, false};
    forces.lines.push_back(force_line(reference, finest, scene));
    errors.lines = std::move(lines);
    panels.push_back(std::move(forces));
    panels.push_back(std::move(errors));
  }
  experiment.add_table(std::move(table));
  experiment.check_at_most("local-contact.block.cycle", "block: dearest haptic cycle, p99", dearest_us, "us",
                           kDearest_us, meter.read());
  draw_panels(experiment, "local_contact_block", "A hand pushes a free block of 0.1 kg; physics one full period late",
              panels);
}

void claim_rates(const LocalContactOptions& options, Experiment& experiment, RunProgress& progress) {
  const PrecisionScene scene = pushed_block(options, 500.0);
  const PrecisionTrace finest = nearly_continuous(scene, kConverged_hz);
  const std::vector<double> loops =
      options.quick ? std::vector<double>{1000, 10000} : std::vector<double>{1000, 2000, 4000, 10000};
  const std::vector<double> rates =
      options.quick ? std::vector<double>{5, 18, 100, 1000} : std::vector<double>{5, 10, 18, 43, 100, 250, 500, 1000};
  const char* const colours[] = {"'#0b3d91'", "'#1b7a35'", "'#c45a00'", "'#a0308a'"};
  const char* const marks[] = {"5", "7", "9", "13"};
  Table table{
      "local_contact_rates", {"method", "loop [Hz]", "physics [Hz]", "force RMS [N]", "force peak [N]", "outcome"}, {}};
  std::vector<Panel> panels;
  double worst = 0.0;
  std::size_t done = 0;
  for (const std::string method : kAllCompared) {
    Panel panel{method,
                "results of physics [Hz]",
                "force error, RMS [N]",
                {},
                "set logscale xy\nset xrange [4:1200]\nset yrange [0.0005:10]"};
    for (std::size_t l = 0; l < loops.size(); ++l) {
      PanelLine line{formatted("loop %g kHz", 1e-3 * loops[l]),
                     std::string("pt ") + marks[l] + " lc rgb " + colours[l],
                     {},
                     {},
                     true};
      for (const double rate_hz : rates) {
        if (interrupted()) return;
        progress.show_share(0.5 + 0.2 * static_cast<double>(done++) /
                                      static_cast<double>(std::size(kAllCompared) * loops.size() * rates.size()),
                            method + line.name);
        const PrecisionTrace trace = run_precisely(scene, {method, rate_hz, loops[l]});
        const PrecisionError error = error_of(trace, scene, reference_of(finest));
        line.x.push_back(rate_hz);
        line.y.push_back(error.force_rms_n);
        if (method == kLocalContact && trace.diverged()) worst = HUGE_VAL;
        if (method == kLocalContact) worst = std::max(worst, error.force_rms_n);
        table.rows.push_back({method, loops[l], rate_hz, error.force_rms_n, error.force_peak_n,
                              std::string(trace.diverged() ? "diverged" : "bounded")});
      }
      panel.lines.push_back(std::move(line));
    }
    panels.push_back(std::move(panel));
  }
  experiment.check_at_most("local-contact.rates.worst",
                           "block, K = 500 N/m, loops 1 to 10 kHz, physics 5 Hz to 1 kHz: worst force error, RMS",
                           worst, "N", 0.25);
  experiment.add_table(std::move(table));
  draw_panels(experiment, "local_contact_rates", "Force error of the pushed block, K = 500 N/m, over both rates",
              panels);
}

}  // namespace tools
