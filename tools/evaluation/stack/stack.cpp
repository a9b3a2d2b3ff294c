#include "tools/evaluation/stack/stack.hpp"

#include <unistd.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <limits>

#include "tools/cli/common/interrupt.hpp"
#include "tools/cli/common/run_progress.hpp"
#include "tools/cli/still/still.hpp"
#include "tools/evaluation/shared/method_settings.hpp"
#include "tools/evaluation/shared/set_hand.hpp"

namespace tools {

namespace {

/// The paper prints neither gains nor masses here. Cubes of 100 g resist a push of some newtons, a light grip does not
/// still a vibration, a hand that comes with 20 mm/s starts one, and the coupling is as stiff as lets interpolation go
/// on with it at that rate (docs/results.md).
constexpr double kCube_kg = 0.1;
constexpr double kSpeed_m_s = 0.02;
constexpr double kDepth_m = 0.013;            // of the hand's wish beyond the stack's face
constexpr double kPipeProxy_n_per_m = 400.0;  // explicit at 50 Hz: a stiffer server spring would diverge
constexpr double kSmoother = 1.0;

/// Long steps are made of parts. 250 cubes come to rest with 2.9 ms as with 2 ms, after half a millimetre, and leave
/// time to spare of the 23 ms when all of them are pushed; 500 fall over sooner with longer parts, and then cost more.
constexpr std::array kCells{
    StackCell{"125_own", 125, false, 0.0, 0.0, 800.0, false},
    StackCell{"250_own", 250, false, 0.0, 0.0, 800.0, false},
    StackCell{"500_own", 500, false, 0.0, 0.0, 800.0, false},
    StackCell{"125_100hz", 125, false, 100.0, 0.0, 800.0, true},
    StackCell{"250_43hz", 250, false, 43.0, 8 * 43.0, 400.0, true},
    StackCell{"500_18hz", 500, false, 18.0, 0.0, 275.0, true},
    StackCell{"125_pipe_50hz", 125, true, 0.0, 0.0, 450.0, true},
    StackCell{"250_pipe_50hz", 250, true, 0.0, 0.0, 450.0, true},
    StackCell{"500_pipe_50hz", 500, true, 0.0, 0.0, 450.0, true},
};

constexpr std::array kPublished{PublishedStack{125, 10.0, 100.0, 1008.0}, PublishedStack{250, 23.0, 43.0, 1003.0},
                                PublishedStack{500, 57.0, 18.0, 1003.0}};

double ratio(double value, double reference) {
  return reference != 0.0 ? value / reference : std::numeric_limits<double>::quiet_NaN();
}

HarnessOptions harness_link() {
  HarnessOptions link;
  link.physics_phase_s = 0.4e-3;
  return link;
}

bool in_harness(const StackOptions& options, const StackCell& cell) {
  return cell.compared && in_real_processes(options, cell);
}

/// The hand that gives remote coupling the mean force `target_n`. Hand and coupling are springs in series, and what the
/// stack feels of them is a straight line: through the last two runs, at first through what dry friction keeps.
double hand_for(double target_n, double stiffness_n_per_m, const std::vector<std::array<double, 2>>& hand_and_mean) {
  constexpr double kKept_n = 0.03;
  const auto in_series = [&](double hand) { return hand * stiffness_n_per_m / (hand + stiffness_n_per_m); };
  const auto& [hand, mean_n] = hand_and_mean.back();
  double slope = (mean_n + kKept_n) / in_series(hand);
  if (hand_and_mean.size() > 1) {
    const auto& [before, before_n] = hand_and_mean[hand_and_mean.size() - 2];
    const double secant = (mean_n - before_n) / (in_series(hand) - in_series(before));
    if (secant > 0.1 * slope) slope = secant;
  }
  // Stay within what a hand can be, wherever the line leads to.
  const double wanted = std::clamp(in_series(hand) + (target_n - mean_n) / slope, 0.2 * in_series(hand),
                                   std::min(3.0 * in_series(hand), 0.8 * stiffness_n_per_m));
  return wanted * stiffness_n_per_m / (stiffness_n_per_m - wanted);
}

std::vector<StackPair> compare_all(const StackOptions& options, RunProgress& progress) {
  std::vector<StackPair> pairs(kCells.size());
  for (std::size_t i = 0; i < kCells.size() && !interrupted(); ++i) {
    if (!in_harness(options, kCells[i])) continue;
    progress.show_share(0.4 * static_cast<double>(i) / kCells.size(),
                        std::to_string(kCells[i].cubes) + " cubes, harness, " + kCells[i].id);
    pairs[i] = compare_at_equal_mean(options, kCells[i]);
  }
  return pairs;
}

void add_harness_table(const StackOptions& options, const std::vector<StackPair>& pairs, Experiment& experiment) {
  Table table{"stack_roughness",
              {"cell", "method", "K [N/m]", "hand [N/m]", "mean [N]", "peak [N]", "change per ms, RMS [mN]",
               "above 30 Hz, RMS [mN]"},
              {}};
  for (std::size_t i = 0; i < pairs.size(); ++i) {
    if (!in_harness(options, kCells[i])) continue;
    const auto row = [&](const char* method, const PushFigures& figures, double hand_n_per_m) {
      table.rows.push_back({std::string(kCells[i].id), std::string(method), kCells[i].stiffness_n_per_m, hand_n_per_m,
                            figures.roughness.mean_n, figures.peak_n, figures.roughness.increment_rms_n * 1e3,
                            std::sqrt(figures.roughness.power_above_30hz_n2) * 1e3});
    };
    row("interpolation", pairs[i].interpolation, pairs[i].hand_interpolation_n_per_m);
    row("remote_virtual_coupling, same hand", pairs[i].remote_same_hand, kStackHand_n_per_m);
    row("remote_virtual_coupling, equal mean", pairs[i].remote, pairs[i].hand_remote_n_per_m);
  }
  experiment.add_table(std::move(table));
}

void check_smoothness(const StackOptions& options, const std::vector<StackPair>& pairs, Experiment& experiment) {
  for (std::size_t i = 0; i < pairs.size(); ++i) {
    if (!in_harness(options, kCells[i])) continue;
    const std::string id = std::string("stack.") + kCells[i].id, what = std::string(kCells[i].id) + ", harness: ";
    experiment.check_between(id + ".mean_ratio", what + "mean force, remote over interpolation", pairs[i].mean_ratio(),
                             "1", 1.0 - kEqualMean, 1.0 + kEqualMean);
    experiment.check_at_most(id + ".increments", what + "change per ms, remote over interpolation",
                             pairs[i].increment_ratio(), "1", kSmoother);
    experiment.check_at_most(id + ".vibration", what + "force above 30 Hz, remote over interpolation",
                             pairs[i].vibration_ratio(), "1", kSmoother);
  }
}

/// Worst of the runs of a cell that count; NaN when there is none.
double worst(const std::vector<StackRun>& runs, const StackCell& cell, double (*figure)(const StackRun&)) {
  double out = std::numeric_limits<double>::quiet_NaN();
  for (const StackRun& run : runs) {
    if (run.cell != &cell || !run.counted) continue;
    const double value = figure(run);
    if (!(out <= value)) out = value;
  }
  return out;
}

void check_rates(const std::vector<StackRun>& runs, Experiment& experiment) {
  for (const StackCell& cell : kCells) {
    bool any = false;
    MachineLoad load, load_and_steps;
    for (const StackRun& run : runs) {
      if (run.cell != &cell) continue;
      any = true;
      load.include(run.push.load);
      load_and_steps.include(run.push.load_and_steps);
    }
    if (!any) continue;
    const std::string id = std::string("stack.") + cell.id, what = std::string(cell.id) + ", real: ";
    experiment.check_between(id + ".haptic_rate", what + "haptic rate over the bare loop's, worst run",
                             worst(runs, cell, [](const StackRun& r) { return r.push.haptic_hz / r.push.bare_hz; }),
                             "1", 0.999, 1.001, load);
    const double wanted_hz = cell.pipe ? 50.0 : cell.throttle_hz;
    if (wanted_hz > 0.0) {
      experiment.check_between(id + ".simulation_rate", what + "simulation rate, slowest run",
                               worst(runs, cell, [](const StackRun& r) { return r.push.simulation_hz; }), "Hz",
                               0.97 * wanted_hz, 1.03 * wanted_hz, load_and_steps);
    }
  }
}

/// Table I and Fig. 13 beside ours: of each stack its throttled cell, and this machine's own speed.
Table paper_and_ours(const std::vector<StackRun>& runs) {
  Table table{"stack_paper_ours",
              {"cubes", "simulation, paper [Hz]", "ours, throttled [Hz]", "ours, own speed [Hz]", "step, paper [ms]",
               "ours, p50 [ms]", "p99 [ms]", "haptic, paper [Hz]", "ours [Hz]", "bare loop [Hz]", "late, p99.9 [us]",
               "bare loop, p99.9 [us]"},
              {}};
  const auto or_dash = [](double value) { return std::isfinite(value) ? Cell(value) : Cell(std::string("-")); };
  for (const PublishedStack& paper : kPublished) {
    std::vector<Cell> row{static_cast<double>(paper.cubes), paper.simulation_hz};
    const StackCell *throttled = nullptr, *own = nullptr;
    for (const StackCell& cell : kCells) {
      if (cell.cubes != paper.cubes || cell.pipe) continue;
      (cell.throttle_hz > 0.0 ? throttled : own) = &cell;
    }
    const auto add = [&](const StackCell& cell, double (*figure)(const StackRun&)) {
      row.push_back(or_dash(worst(runs, cell, figure)));
    };
    add(*throttled, [](const StackRun& r) { return r.push.simulation_hz; });
    add(*own, [](const StackRun& r) { return r.push.simulation_hz; });
    row.emplace_back(paper.step_ms);
    add(*throttled, [](const StackRun& r) { return r.push.step_p50_ms; });
    add(*throttled, [](const StackRun& r) { return r.push.step_p99_ms; });
    row.emplace_back(paper.haptic_hz);
    add(*throttled, [](const StackRun& r) { return r.push.haptic_hz; });
    add(*throttled, [](const StackRun& r) { return r.push.bare_hz; });
    add(*throttled, [](const StackRun& r) { return r.push.wakeup_p999_us; });
    add(*throttled, [](const StackRun& r) { return r.push.bare.wakeup_p999_us; });
    table.rows.push_back(std::move(row));
  }
  return table;
}

Table runs_table(const std::vector<StackRun>& runs) {
  Table table{"stack_runs",
              {"cell", "method", "simulation [Hz]", "of real time", "step p50 [ms]", "p99 [ms]", "haptic [Hz]",
               "bare loop [Hz]", "late, p99.9 [us]", "bare, p99.9 [us]", "mean [N]", "change per ms [mN]",
               "above 30 Hz [mN]", "worst pause [ms]", "counted"},
              {}};
  for (const StackRun& run : runs) {
    const LivePush& push = run.push;
    table.rows.push_back({std::string(run.cell->id), std::string(run.method), push.simulation_hz, push.real_time_factor,
                          push.step_p50_ms, push.step_p99_ms, push.haptic_hz, push.bare_hz, push.wakeup_p999_us,
                          push.bare.wakeup_p999_us, run.figures.roughness.mean_n,
                          run.figures.roughness.increment_rms_n * 1e3,
                          std::sqrt(run.figures.roughness.power_above_30hz_n2) * 1e3, push.worst_pause_ms,
                          std::string(run.counted ? "yes" : "no")});
  }
  return table;
}

/// Figs 12 and 14: the smallest and the largest stack at the end of the paper's push, as the harness leaves them.
void draw_stills(const StackOptions& options, Experiment& experiment) {
  for (const auto& [cubes, stem] : {std::pair{125, "stack_fig12"}, std::pair{500, "stack_fig14"}}) {
    for (std::size_t i = 0; i < kCells.size(); ++i) {
      if (kCells[i].cubes != cubes || kCells[i].pipe || !kCells[i].compared || interrupted()) continue;
      const PushSetup setup =
          stack_setup(options, kCells[i], "remote_virtual_coupling", kStackHand_n_per_m, StackOptions::kPaperPush_s);
      StillFrame frame;
      (void)push_in_harness(setup, harness_link(), &frame);
      std::vector<rtbus::config::Override> overrides;
      for (const std::string& text : setup.assignments) overrides.push_back(rtbus::config::parse_override(text));
      frame.stem = stem;
      char text[80];
      std::snprintf(text, sizeof text, "%d cubes after %g s", cubes, setup.duration_s);
      frame.moment = text;
      const StillsOutcome drawn = tools::draw_stills(
          experiment.folder(), rtbus::config::load_session(setup.session_file, overrides).scene, {&frame, 1}, {});
      for (const std::string& file : drawn.files) experiment.add_figure(file);
      if (!drawn.problem.empty()) experiment.note(drawn.problem);
    }
  }
}

}  // namespace

std::span<const StackCell> stack_cells() noexcept { return kCells; }
std::span<const PublishedStack> published_stacks() noexcept { return kPublished; }
bool in_real_processes(const StackOptions& options, const StackCell& cell) noexcept {
  return !options.quick || !cell.pipe || cell.cubes == 125;
}

PushSetup stack_setup(const StackOptions& options, const StackCell& cell, const char* method, double hand_n_per_m,
                      double push_s) {
  PushSetup setup;
  setup.session_file = options.config_folder + "/stack_" + std::to_string(cell.cubes) + ".yaml";
  std::vector<std::string>& sets = setup.assignments;
  sets = method_settings(method);
  sets.insert(sets.end(),
              {"haptic.0.device.hand.impedance=light", set_hand("device.hand.stiffness_n_per_m", hand_n_per_m),
               set_hand("coupling.stiffness_n_per_m", cell.stiffness_n_per_m),
               "scene.bodies.cube.mass_kg=" + std::to_string(kCube_kg)});
  setup.duration_s = push_s;
  if (push_s < StackOptions::kPaperPush_s) {  // begins nearer to the stack
    setup.gap_mm = 3.0;
    sets.emplace_back("haptic.0.device.hand.start_m=[0, 0, 0.008]");
    sets.push_back(set_hand("device.hand.start_s", 0.3));
  }
  sets.push_back(set_hand("device.hand.speed_m_s", kSpeed_m_s));
  sets.push_back(set_hand("device.hand.ramp_s", 0.02));
  sets.push_back(set_hand("device.hand.distance_m", setup.gap_mm * 1e-3 + kDepth_m));
  // Where the two lower stacks are pushed as well: a column of ten, pushed in its middle, falls over at once.
  if (cell.cubes == 500) sets.emplace_back("haptic.0.mapping.offset_m=[0.0105, 0.05, 0]");
  if (cell.throttle_hz > 0.0) sets.push_back("physics.throttle_hz=" + std::to_string(cell.throttle_hz));
  if (cell.parts_hz > 0.0) sets.push_back("physics.rate_hz=" + std::to_string(cell.parts_hz));
  if (cell.pipe) {
    sets.insert(sets.end(), {"haptic.0.form=paper", "haptic.0.link=pipe", "haptic.0.link_rate_hz=50"});
    sets.push_back(set_hand("proxy.stiffness_n_per_m", kPipeProxy_n_per_m));
  }
  sets.insert(sets.end(), options.assignments.begin(), options.assignments.end());
  return setup;
}

double StackPair::mean_ratio() const noexcept { return ratio(remote.roughness.mean_n, interpolation.roughness.mean_n); }
double StackPair::increment_ratio() const noexcept {
  return ratio(remote.roughness.increment_rms_n, interpolation.roughness.increment_rms_n);
}
double StackPair::vibration_ratio() const noexcept {
  return std::sqrt(ratio(remote.roughness.power_above_30hz_n2, interpolation.roughness.power_above_30hz_n2));
}

StackPair compare_at_equal_mean(const StackOptions& options, const StackCell& cell) {
  const HarnessOptions link = harness_link();
  StackPair pair;
  pair.hand_interpolation_n_per_m = pair.hand_remote_n_per_m = kStackHand_n_per_m;
  const PushSetup interpolation =
      stack_setup(options, cell, "interpolation", kStackHand_n_per_m, StackOptions::kShortPush_s);
  pair.interpolation_trace = push_in_harness(interpolation, link);
  pair.interpolation = judge_push(pair.interpolation_trace, interpolation.gap_mm);
  PushAtMean equal = push_at_mean(options, cell, "remote_virtual_coupling", pair.interpolation.roughness.mean_n, link);
  pair.remote_trace = std::move(equal.trace);
  pair.remote = equal.figures;
  pair.remote_same_hand = equal.first;
  pair.hand_remote_n_per_m = equal.hand_n_per_m;
  return pair;
}

PushAtMean push_at_mean(const StackOptions& options, const StackCell& cell, const char* method, double mean_n,
                        const HarnessOptions& link) {
  constexpr int kTries = 5;
  PushAtMean out;
  std::vector<std::array<double, 2>> hand_and_mean;
  for (int attempt = 1; attempt <= kTries && !interrupted(); ++attempt) {
    const PushSetup setup = stack_setup(options, cell, method, out.hand_n_per_m, StackOptions::kShortPush_s);
    out.trace = push_in_harness(setup, link);
    out.figures = judge_push(out.trace, setup.gap_mm);
    if (attempt == 1) out.first = out.figures;
    const double share = ratio(out.figures.roughness.mean_n, mean_n);
    // A hand that is not led to the stack, or a method that only shakes, leaves nothing to go by.
    if (attempt == kTries || !(share > 0.0) || std::abs(share - 1.0) <= kEqualMean) break;
    hand_and_mean.push_back({out.hand_n_per_m, out.figures.roughness.mean_n});
    out.hand_n_per_m = hand_for(mean_n, cell.stiffness_n_per_m, hand_and_mean);
  }
  return out;
}

void evaluate_stack(const StackOptions& options, Experiment& experiment) {
  RunProgress progress(::isatty(STDERR_FILENO) == 1, false);
  const std::vector<StackPair> pairs = compare_all(options, progress);
  const std::vector<StackRun> runs = run_stacks(options, pairs, experiment);
  Table larger;
  if (!options.quick) {
    progress.show_share(0.9, "1000, 2000 and 5000 cubes");
    larger = larger_stacks(options);
  }
  experiment.add_table(paper_and_ours(runs));
  add_harness_table(options, pairs, experiment);
  experiment.add_table(runs_table(runs));
  if (!options.quick) experiment.add_table(std::move(larger));
  check_rates(runs, experiment);
  check_smoothness(options, pairs, experiment);
  progress.clear();
  draw_stack(experiment, pairs, runs);
  if (options.quick) {
    experiment.note(
        "--quick: no stills, no stacks beyond 500 cubes, of the pipe 125 cubes only, one method at this machine's own "
        "speed");
  } else {
    draw_stills(options, experiment);
  }
  experiment.note(
      "equal mean force: the hand of the remote coupling pushes the harder or softer (column hand) until the means of "
      "the harness agree within 10 %, in a push of 7 s; the real processes use the same hands");
}

}  // namespace tools
