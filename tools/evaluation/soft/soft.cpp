#include "tools/evaluation/soft/soft.hpp"

#include <unistd.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <fstream>
#include <limits>
#include <optional>

#include "rtbus/clock.hpp"
#include "rtbus/config/closed_surface.hpp"
#include "rtbus/config/session.hpp"
#include "rtbus/three_digits.hpp"
#include "tools/cli/common/gnuplot.hpp"
#include "tools/cli/common/interrupt.hpp"
#include "tools/cli/common/run_progress.hpp"
#include "tools/cli/still/still.hpp"
#include "tools/evaluation/shared/follow_session.hpp"
#include "tools/evaluation/shared/median.hpp"
#include "tools/evaluation/soft/soft_stroke.hpp"

namespace tools {

namespace {

constexpr double kHeld = 0.95;        // of the ticks between
constexpr double kRateApart = 0.005;  // of the loop's rate against a bare loop's

constexpr const char* kInterpolation = "interpolation";
constexpr const char* kRemote = "remote_virtual_coupling";

/// The paper prints no gains. A light grip does not still a vibration, and at 18 Hz a coupling of 250 N/m is what
/// interpolation goes on with, on the edge; at faster rates one of 300 N/m is calm with both methods.
constexpr std::array kMachines{
    SoftMachine{"own", "unthrottled", 0.0, 300.0, false}, SoftMachine{"100hz", "100 Hz", 100.0, 300.0, false},
    SoftMachine{"43hz", "43 Hz", 43.0, 300.0, false}, SoftMachine{"18hz", "18 Hz", 18.0, 250.0, true}};
/// Calm with both methods: on a machine that is busy, what vibrates on the edge would say more about its load.
constexpr const SoftMachine& kRealMachine = kMachines[2];

std::optional<SoftStroke> stroke_for_real(const SoftOptions& options, const std::vector<std::string>& assignments) {
  FollowedSession session({options.session_file, assignments, "soft", options.duration_s, /*bare_loop=*/true});
  SoftStroke out;
  out.rate_hz = session.plan().haptic.front().rate_hz;
  rtbus::Telemetry first, last;
  const bool ran = session.run(
      [&](const rtbus::Telemetry& tick) {
        if (out.time_s.empty()) first = tick;
        last = tick;
        out.append(tick);
      },
      [&](const rtbus::Stamped<rtbus::ProxyState>& step) { out.step_ms.push_back(1e3 * step.value.step_compute_s); });
  if (!ran) return std::nullopt;
  out.haptic_hz = static_cast<double>(last.tick - first.tick) / rtbus::seconds_between(first.due_ns, last.due_ns);
  out.wakeup_p999_us = session.loop().wakeup_p999_us;
  out.load = session.load();
  if (session.bare() && session.bare()->due > 0) {
    out.bare_hz =
        session.bare()->rate_hz * static_cast<double>(session.bare()->ticks) / static_cast<double>(session.bare()->due);
  }
  return out;
}

void write_stroke(const std::filesystem::path& file, const SoftStroke& stroke) {
  std::ofstream out(file);
  out << "# time [s]\tforce on the hand, upwards [N]\tforce, norm [N]\n";
  for (std::size_t i = 0; i < stroke.time_s.size(); ++i) {
    out << stroke.time_s[i] << '\t' << stroke.up_n[i] << '\t' << stroke.norm_n[i] << '\n';
  }
}

/// Both profiles above each other on one scale, as the paper's Figs 18 and 19 can be laid side by side.
Figure profiles(const std::string& stem, const std::string& title, const std::string& upper, const std::string& lower,
                double peak_n) {
  Figure out;
  out.stem = stem;
  out.height_px = 800;
  char range[80];
  std::snprintf(range, sizeof range, "set yrange [%g:%g]\n", -0.1 * peak_n, 1.15 * peak_n);
  out.body =
      "set multiplot layout 2,1 title " + gnuplot_quoted(title) +
      "\nset grid lc rgb 'gray80'\nset lmargin 9\nset rmargin 3\nset key top right opaque\nset xrange [0.8:7]\n" +
      range + "set ylabel 'force on the hand, upwards [N]'\nplot " + gnuplot_quoted(upper) +
      " using 1:2 with lines lw 1.2 lc rgb '#c05a00' title 'interpolation (Fig. 18)'\n"
      "set xlabel 'time [s]'\nplot " +
      gnuplot_quoted(lower) +
      " using 1:2 with lines lw 1.2 lc rgb '#1f5fb0' title 'remote virtual coupling (Fig. 19)'\nunset multiplot\n";
  return out;
}

void draw(Experiment& experiment, const Figure& figure) {
  const auto gnuplot = Gnuplot::find();
  if (!gnuplot) {
    experiment.note("gnuplot is not there: no figure " + figure.stem);
    return;
  }
  const auto drawn = gnuplot->draw(experiment.folder(), figure);
  if (!drawn) {
    experiment.note("no figure " + figure.stem + ": " + drawn.error());
    return;
  }
  for (const auto& file : *drawn) experiment.add_figure(file);
}

/// What the scene is made of, against the paper's bunnies.
void compare_meshes(const rtbus::config::Scene& scene, Experiment& experiment, Table& compared) {
  double nodes = 0, edges = 0, faces = 0;
  const auto& bodies = scene.soft_bodies;
  const bool alike = std::all_of(bodies.begin(), bodies.end(), [&](const auto& body) {
    return body.mesh->triangles.size() == bodies.front().mesh->triangles.size() &&
           body.mesh->vertices_m.size() == bodies.front().mesh->vertices_m.size();
  });
  if (!bodies.empty() && alike) {
    nodes = static_cast<double>(bodies.front().mesh->vertices_m.size());
    edges = static_cast<double>(rtbus::config::edges_of(*bodies.front().mesh).size());
    faces = static_cast<double>(bodies.front().mesh->triangles.size());
  }
  compared.rows.push_back({std::string("soft bodies"), std::string("5"), static_cast<double>(bodies.size())});
  compared.rows.push_back({std::string("nodes of each"), std::string("450 (453: V - E + F = 2)"), nodes});
  compared.rows.push_back({std::string("edges of each"), std::string("1353"), edges});
  compared.rows.push_back({std::string("faces of each"), std::string("902"), faces});
  experiment.check_between("soft.mesh.euler", "nodes - edges + faces of each body", nodes - edges + faces, "1", 2.0,
                           2.0);
}

/// Both methods on one machine.
struct Pair {
  StrokeFigures interpolation, remote;
  [[nodiscard]] double mean_ratio() const { return interpolation.roughness.mean_n / remote.roughness.mean_n; }
  [[nodiscard]] double increments_ratio() const {
    return interpolation.roughness.increment_rms_n / remote.roughness.increment_rms_n;
  }
  [[nodiscard]] double vibration_ratio() const {
    return std::sqrt(interpolation.roughness.power_above_30hz_n2 / remote.roughness.power_above_30hz_n2);
  }
};

void check_pair(const std::string& id, const std::string& what, bool compared, const Pair& pair,
                Experiment& experiment) {
  experiment.check_at_least(id + ".interpolation.held", what + ": interpolation keeps contact", pair.interpolation.held,
                            "1", kHeld);
  experiment.check_at_least(id + ".remote.held", what + ": remote coupling keeps contact", pair.remote.held, "1",
                            kHeld);
  experiment.check_between(id + ".mean", what + ": mean force, interpolation / remote", pair.mean_ratio(), "1",
                           1.0 - kEqualStrokes, 1.0 + kEqualStrokes);
  if (!compared) return;
  experiment.check_at_least(id + ".increments", what + ": changes per 1 ms, interpolation / remote",
                            pair.increments_ratio(), "1", 1.0);
  experiment.check_at_least(id + ".vibration", what + ": RMS above 30 Hz, interpolation / remote",
                            pair.vibration_ratio(), "1", 1.0);
}

void add_row(Table& table, const std::string& where, const char* method, const StrokeFigures& figures) {
  table.rows.push_back({where, std::string(method), 1e3 * figures.depth_m, figures.roughness.mean_n, figures.peak_n,
                        1e3 * figures.roughness.increment_rms_n, 1e3 * std::sqrt(figures.roughness.power_above_30hz_n2),
                        100.0 * figures.held});
}

/// Of all runs of one method in real processes.
struct RealRuns {
  std::vector<double> mean_n, increments_n, held, rate_ratio, step_ms;
};

/// The experiment with what it collects.
class SoftEvaluation {
 public:
  SoftEvaluation(const SoftOptions& options, Experiment& experiment)
      : options_(options), experiment_(experiment), scene_(load_stroke(options, options.assignments).scene) {
    compare_meshes(scene_, experiment_, compared_);
  }

  void run() {
    for (const SoftMachine& machine : kMachines) {
      if (!compare_in_harness(machine)) return;
    }
    compared_.rows.push_back({std::string("remote coupling against interpolation"), std::string("smoother"),
                              "changes per 1 ms of interpolation over remote: " + ratios_});
    for (int run = 0; run < options_.real_runs; ++run) {
      if (!compare_for_real(run)) return;
    }
    if (options_.real_runs > 0) check_real();
    finish();
  }

 private:
  /// Both methods on one machine, under the simulated clock. @returns false when interrupted; likewise below.
  bool compare_in_harness(const SoftMachine& machine);
  void show_pair(const SoftMachine& machine, const Pair& pair, const SoftStroke& interpolation,
                 const SoftStroke& remote);
  /// Both methods once with real processes, on kRealMachine.
  bool compare_for_real(int run);
  void check_real();
  void finish();

  const SoftOptions& options_;
  Experiment& experiment_;
  const rtbus::config::Scene scene_;
  RunProgress progress_{::isatty(STDERR_FILENO) == 1, false};
  double share_ = 0.0;  ///< Done.
  Table compared_{"soft_paper_ours", {"what", "paper", "ours"}, {}};
  Table profiles_{"soft_profiles",
                  {"physics", "method", "deeper by [mm]", "mean [N]", "peak [N]", "changes per 1 ms, RMS [mN]",
                   "above 30 Hz, RMS [mN]", "in contact [%]"},
                  {}};
  Table real_{"soft_real",
              {"method", "run", "mean [N]", "changes per 1 ms, RMS [mN]", "above 30 Hz, RMS [mN]", "in contact [%]",
               "haptic [Hz]", "bare loop [Hz]", "wake-up p99.9 [us]", "step p50 [ms]"},
              {}};
  std::string ratios_;
  std::vector<StillFrame> pictures_;
  double real_depth_m_ = 0.0;  ///< Of remote coupling at kRealMachine.
  double real_peak_n_ = 0.0;
  std::array<RealRuns, 2> runs_;  ///< Interpolation, remote coupling.
  MachineLoad load_, load_and_steps_;
};

bool SoftEvaluation::compare_in_harness(const SoftMachine& machine) {
  Pair pair;
  progress_.show_share(share_, std::string(machine.what) + ", interpolation, harness");
  const SoftStroke interpolation =
      stroke_in_harness(options_, stroke_settings(options_, machine, kInterpolation, 0.0), nullptr);
  pair.interpolation = judge_stroke(interpolation);
  if (interrupted()) return false;
  progress_.show_share(share_ + 0.1, std::string(machine.what) + ", remote coupling, harness");
  // Means are made equal at the one that does not vibrate: its mean follows the hand's depth.
  StillFrame picture;
  const bool wanted = &machine == &kRealMachine;
  const StrokeAtMean equal =
      stroke_at_mean(options_, machine, kRemote, pair.interpolation.roughness.mean_n, wanted ? &picture : nullptr);
  pair.remote = equal.figures;
  if (wanted) {
    picture.stem = "soft_fig17";
    pictures_.push_back(picture);
    real_depth_m_ = pair.remote.depth_m;
  }
  share_ += 0.2;
  show_pair(machine, pair, interpolation, equal.stroke);
  return true;
}

void SoftEvaluation::show_pair(const SoftMachine& machine, const Pair& pair, const SoftStroke& interpolation,
                               const SoftStroke& remote) {
  const std::string stem = std::string("soft_") + machine.id;
  write_stroke(experiment_.folder() / (stem + "_" + kInterpolation + ".tsv"), interpolation);
  write_stroke(experiment_.folder() / (stem + "_" + kRemote + ".tsv"), remote);
  add_row(profiles_, std::string(machine.what) + ", harness", kInterpolation, pair.interpolation);
  add_row(profiles_, std::string(machine.what) + ", harness", kRemote, pair.remote);
  check_pair(std::string("soft.") + machine.id, machine.what, machine.compared, pair, experiment_);
  ratios_ += (ratios_.empty() ? "" : ", ") + rtbus::three_digits(pair.increments_ratio()) + " (" + machine.what + ")";
  draw(experiment_, profiles(stem,
                             "Pressing and stroking a soft body, physics " + std::string(machine.what) +
                                 ", simulated clock (paper, Figs 18 and 19)",
                             stem + "_" + kInterpolation + ".tsv", stem + "_" + kRemote + ".tsv",
                             std::max(pair.interpolation.peak_n, pair.remote.peak_n)));
}

bool SoftEvaluation::compare_for_real(int run) {
  for (const bool remote : {false, true}) {
    if (interrupted()) return false;
    const char* method = remote ? kRemote : kInterpolation;
    progress_.show_share(0.99, std::string(method) + ", real processes, run " + std::to_string(run + 1));
    const auto stroke =
        stroke_for_real(options_, stroke_settings(options_, kRealMachine, method, remote ? real_depth_m_ : 0.0));
    if (!stroke) continue;
    const StrokeFigures figures = judge_stroke(*stroke);
    if (run == 0) write_stroke(experiment_.folder() / (std::string("soft_real_") + method + ".tsv"), *stroke);
    real_peak_n_ = std::max(real_peak_n_, figures.peak_n);
    RealRuns& runs = runs_[remote];
    runs.mean_n.push_back(figures.roughness.mean_n);
    runs.increments_n.push_back(figures.roughness.increment_rms_n);
    runs.held.push_back(figures.held);
    if (stroke->bare_hz > 0.0) runs.rate_ratio.push_back(stroke->haptic_hz / stroke->bare_hz);
    runs.step_ms.push_back(median(stroke->step_ms));
    load_.include(stroke->load);
    load_and_steps_.include(stroke->load.with_steps(stroke->step_ms, 1e3 / kRealMachine.throttle_hz));
    real_.rows.push_back({std::string(method), static_cast<double>(run + 1), figures.roughness.mean_n,
                          1e3 * figures.roughness.increment_rms_n,
                          1e3 * std::sqrt(figures.roughness.power_above_30hz_n2), 100.0 * figures.held,
                          stroke->haptic_hz, stroke->bare_hz, stroke->wakeup_p999_us, median(stroke->step_ms)});
  }
  return true;
}

void SoftEvaluation::check_real() {
  const std::string where = std::string("real processes, ") + kRealMachine.what + ": ";
  for (const bool remote : {false, true}) {
    const std::string id = std::string("soft.real.") + (remote ? "remote" : "interpolation");
    const std::string what = where + (remote ? "remote coupling" : "interpolation");
    experiment_.check_at_least(id + ".held", what + " keeps contact", median(runs_[remote].held), "1", kHeld,
                               load_and_steps_);
    experiment_.check_between(id + ".rate", what + ", haptic rate / bare loop's", median(runs_[remote].rate_ratio), "1",
                              1.0 - kRateApart, 1.0 + kRateApart, load_);
  }
  const auto& [interpolation, remote] = runs_;
  experiment_.check_between("soft.real.mean", where + "mean force, interpolation / remote",
                            median(interpolation.mean_n) / median(remote.mean_n), "1", 1.0 - kEqualStrokes,
                            1.0 + kEqualStrokes, load_and_steps_);
  if (kRealMachine.compared) {
    experiment_.check_at_least("soft.real.increments", where + "changes per 1 ms, interpolation / remote",
                               median(interpolation.increments_n) / median(remote.increments_n), "1", 1.0,
                               load_and_steps_);
  }
  compared_.rows.push_back(
      {std::string("engine time of a step of 1/43 s [ms]"), std::string("-"), median(remote.step_ms)});
  draw(experiment_, profiles("soft_real", "Pressing and stroking a soft body, physics 43 Hz, real processes",
                             std::string("soft_real_") + kInterpolation + ".tsv",
                             std::string("soft_real_") + kRemote + ".tsv", real_peak_n_));
}

void SoftEvaluation::finish() {
  progress_.show_share(1.0, "drawing");
  experiment_.add_table(std::move(compared_));
  experiment_.add_table(std::move(profiles_));
  if (options_.real_runs > 0) experiment_.add_table(std::move(real_));
  const StillsOutcome stills = draw_stills(experiment_.folder(), scene_, pictures_, {});
  for (const std::string& file : stills.files) experiment_.add_figure(file);
  if (!stills.problem.empty()) experiment_.note(stills.problem);
  progress_.clear();
  experiment_.note(
      "profiles and their figures: the vertical force on the hand, from 2.2 to 5.5 s: pressed in, still for 0.8 s, "
      "then stroking");
}

}  // namespace

void evaluate_soft(const SoftOptions& options, Experiment& experiment) { SoftEvaluation(options, experiment).run(); }

}  // namespace tools
