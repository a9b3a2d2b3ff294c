/// Claims e and g of `rtbus evaluate local-contact`: how rough piles and soft bodies feel, and Newton's third law.
#include <algorithm>
#include <cmath>
#include <cstdio>

#include "tools/cli/common/interrupt.hpp"
#include "tools/evaluation/local_contact/local_contact.hpp"
#include "tools/evaluation/shared/method_settings.hpp"
#include "tools/evaluation/soft/soft_stroke.hpp"
#include "tools/evaluation/stack/stack.hpp"

namespace tools {

namespace {

constexpr double kRough = 1.0 / 3.0;  // of remote coupling's
constexpr double kNoRougher = 1.5;    // of what is there, which is chaotic: one run beside another
constexpr double kThirdLaw = 0.02;    // of what was felt within a second
constexpr double kWindow_s = 1.0;

using Settings = std::vector<std::string>;

double vibration_n(const Roughness& roughness) { return std::sqrt(roughness.power_above_30hz_n2); }

/// Both figures of roughness, against remote coupling's at a mean force that is equal within 10 %.
void check_rough(const std::string& id, const std::string& what, const Roughness& remote, const Roughness& local,
                 Experiment& experiment) {
  experiment.check_between(id + ".mean", what + ": mean force over remote coupling's", local.mean_n / remote.mean_n,
                           "1", 0.9, 1.1);
  experiment.check_at_most(id + ".vibration", what + ": RMS above 30 Hz over remote coupling's",
                           vibration_n(local) / vibration_n(remote), "1", kRough);
  experiment.check_at_most(id + ".increments", what + ": changes per 1 ms over remote coupling's",
                           local.increment_rms_n / remote.increment_rms_n, "1", kRough);
}

/// Of a pile, which is itself as rough as what remote coupling makes of it by filtering (docs/decisions/0008): no
/// rougher than it is. Means are made equal as far as one run of something chaotic can be told to; over many starts
/// they are compared by work-precision. What all that is of remote coupling's is told, without a bar.
void check_as_rough(const std::string& name, const Roughness& remote, const Roughness& there, const Roughness& local,
                    Experiment& experiment) {
  const std::string id = "local-contact.rough." + name, what = name + ", physics 18 Hz: ";
  experiment.check_at_most(id + ".vibration", what + "RMS above 30 Hz over that at full rate without latency",
                           vibration_n(local) / vibration_n(there), "1", kNoRougher);
  experiment.check_at_most(id + ".increments", what + "changes per 1 ms over those at full rate without latency",
                           local.increment_rms_n / there.increment_rms_n, "1", kNoRougher);
  char text[280];
  std::snprintf(text, sizeof text,
                "%s: local_contact (mean %.2f N) has %.2f of remote coupling's changes per 1 ms and %.2f of its "
                "RMS above 30 Hz; the pile itself at full rate without latency (%.2f N) %.2f and %.2f",
                name.c_str(), local.mean_n, local.increment_rms_n / remote.increment_rms_n,
                vibration_n(local) / vibration_n(remote), there.mean_n, there.increment_rms_n / remote.increment_rms_n,
                vibration_n(there) / vibration_n(remote));
  experiment.note(text);
}

void add_row(Table& table, const std::string& scene, const char* method, const Roughness& rough, double peak_n) {
  table.rows.push_back(
      {scene, std::string(method), rough.mean_n, peak_n, 1e3 * rough.increment_rms_n, 1e3 * vibration_n(rough)});
}

Panel soft_panel(const LocalContactOptions& options, Table& table, Experiment& experiment) {
  SoftOptions soft;
  soft.session_file = options.config_folder + "/soft.yaml";
  soft.assignments = options.assignments;
  // A light grip; stiffness and rate at which interpolation is on the edge (soft.cpp).
  const SoftMachine machine{"18hz", "18 Hz", 18.0, 250.0, true};
  Panel panel{"Soft body pressed and stroked, K = 250 N/m",
              "time [s]",
              "force on the hand, upwards [N]",
              {},
              "set xrange [0.8:7]"};
  const SoftStroke remote = stroke_in_harness(soft, stroke_settings(soft, machine, kRemoteCoupling, 0.0), nullptr);
  const StrokeFigures of_remote = judge_stroke(remote);
  const StrokeAtMean local = stroke_at_mean(soft, machine, kLocalContact, of_remote.roughness.mean_n, nullptr);
  const StrokeAtMean leads = stroke_at_mean(soft, machine, kLeadingCoupling, of_remote.roughness.mean_n, nullptr);
  for (const auto& [method, stroke] : {std::pair{kRemoteCoupling, &remote}, std::pair{kLeadingCoupling, &leads.stroke},
                                       std::pair{kLocalContact, &local.stroke}}) {
    PanelLine line = method_line(method);
    line.x = stroke->time_s;
    line.y = stroke->up_n;
    panel.lines.push_back(std::move(line));
  }
  add_row(table, "soft", kRemoteCoupling, of_remote.roughness, of_remote.peak_n);
  add_row(table, "soft", kLeadingCoupling, leads.figures.roughness, leads.figures.peak_n);
  add_row(table, "soft", kLocalContact, local.figures.roughness, local.figures.peak_n);
  check_rough("local-contact.rough.soft", "soft, physics 18 Hz", of_remote.roughness, local.figures.roughness,
              experiment);
  experiment.check_at_least("local-contact.rough.soft.held", "soft: share of the stroke with a force",
                            local.figures.held, "1", 0.95);
  experiment.check_at_least("local-contact.rough.soft.energy",
                            "soft: energy that the hand has put in by the end (below 0: made)",
                            1e3 * local.stroke.absorbed_j, "mJ", 0.0);
  return panel;
}

Panel stack_panel(const LocalContactOptions& options, int cubes, Table& table, Experiment& experiment) {
  const StackOptions stack{options.config_folder, options.assignments, /*quick=*/true};
  const StackCell cell{"18hz", cubes, false, 18.0, 0.0, 275.0, true};
  const std::string name = "stack_" + std::to_string(cubes);
  Panel panel{
      "Push into " + std::to_string(cubes) + " cubes, K = 275 N/m", "time [s]", "force on the hand [N]", {}, {}};
  const PushSetup setup = stack_setup(stack, cell, kRemoteCoupling, kStackHand_n_per_m, StackOptions::kShortPush_s);
  const PushTrace remote = push_in_harness(setup, {});
  const PushFigures of_remote = judge_push(remote, setup.gap_mm);
  const PushAtMean local = push_at_mean(stack, cell, kLocalContact, of_remote.roughness.mean_n, {});
  const PushAtMean leads = push_at_mean(stack, cell, kLeadingCoupling, of_remote.roughness.mean_n, {});
  // What is there: the pile told at full rate without latency.
  StackCell full = cell;
  full.throttle_hz = 0.0;
  const PushAtMean there = push_at_mean(stack, full, kLocalContact, local.figures.roughness.mean_n, {});
  PanelLine of_there{"full rate, no latency", "lc rgb 'black' dt 2", there.trace.time_s, there.trace.force_n, false};
  panel.lines.push_back(std::move(of_there));
  for (const auto& [method, trace] : {std::pair{kRemoteCoupling, &remote}, std::pair{kLeadingCoupling, &leads.trace},
                                      std::pair{kLocalContact, &local.trace}}) {
    PanelLine line = method_line(method);
    line.x = trace->time_s;
    line.y = trace->force_n;
    panel.lines.push_back(std::move(line));
  }
  add_row(table, name, kRemoteCoupling, of_remote.roughness, of_remote.peak_n);
  add_row(table, name, kLeadingCoupling, leads.figures.roughness, leads.figures.peak_n);
  add_row(table, name, kLocalContact, local.figures.roughness, local.figures.peak_n);
  add_row(table, name, "full rate, no latency", there.figures.roughness, there.figures.peak_n);
  check_as_rough(name, of_remote.roughness, there.figures.roughness, local.figures.roughness, experiment);
  return panel;
}

}  // namespace

void claim_rough(const LocalContactOptions& options, Experiment& experiment, RunProgress& progress) {
  Table table{"local_contact_rough",
              {"scene", "method", "mean [N]", "peak [N]", "changes per 1 ms, RMS [mN]", "above 30 Hz, RMS [mN]"},
              {}};
  std::vector<Panel> panels;
  progress.show_share(0.7, "soft");
  panels.push_back(soft_panel(options, table, experiment));
  for (const int cubes : {125, 500}) {
    if (interrupted() || (options.quick && cubes > 125)) break;
    progress.show_share(cubes == 125 ? 0.8 : 0.85, std::to_string(cubes) + " cubes");
    panels.push_back(stack_panel(options, cubes, table, experiment));
  }
  if (options.quick) experiment.note("--quick: no 500 cubes");
  experiment.add_table(std::move(table));
  draw_panels(experiment, "local_contact_rough", "Roughness at equal mean force; physics 18 Hz, one full period late",
              panels);
}

/// What the hand had felt by the sample that a step answers, and what physics had handed to the world by then.
void claim_third_law(const LocalContactOptions& options, Experiment& experiment) {
  Table table{"local_contact_third_law",
              {"scene", "method", "physics [Hz]", "felt in all [N s]", "worst difference in 1 s [N s]",
               "of what was felt in it"},
              {}};
  Panel panel{"Impulse within the last second: felt less applied", "time [s]", "difference [mN s]", {}, {}};
  struct Case {
    const char* name;
    const char* session;
    const char* method;
    Settings more;
    double physics_hz;
    double until_s;
    const char* style;
  };
  const Settings block{"scene.bodies.1.mass_kg=0.1", "haptic.0.coupling.stiffness_n_per_m=500"};
  for (const Case& each :
       {Case{"free block", "free_block.yaml", kRemoteCoupling, block, 18, 4.5, "lc rgb '#1f5fa8'"},
        Case{"soft body", "soft.yaml", kRemoteCoupling, {}, 18, options.quick ? 3.5 : 7.0, "lc rgb '#1f5fa8' dt 3"},
        Case{"free block", "free_block.yaml", kLeadingCoupling, block, 18, 4.5, "lc rgb '#8db4e2'"},
        Case{"soft body", "soft.yaml", kLeadingCoupling, {}, 18, options.quick ? 3.5 : 7.0, "lc rgb '#8db4e2' dt 3"},
        Case{"free block", "free_block.yaml", kLocalContact, block, 100, 4.5, "lc rgb '#7fc79a'"},
        Case{"free block", "free_block.yaml", kLocalContact, block, 18, 4.5, "lc rgb '#1b7a35'"},
        Case{"soft body", "soft.yaml", kLocalContact, {}, 18, options.quick ? 3.5 : 7.0, "lc rgb '#1b7a35' dt 3"}}) {
    Settings settings = each.more;
    char text[120];
    std::snprintf(text, sizeof text, "physics.throttle_hz=%g", each.physics_hz);
    settings.emplace_back(text);
    for (const std::string& one : method_settings(each.method)) settings.push_back(one);
    settings.insert(settings.end(), options.assignments.begin(), options.assignments.end());
    std::vector<rtbus::config::Override> overrides;
    for (const std::string& one : settings) overrides.push_back(rtbus::config::parse_override(one));
    auto session = rtbus::config::load_session(options.config_folder + "/" + each.session, overrides);
    Harness harness(session, {});
    const double tick_s = 1.0 / harness.config().rate_hz;
    rtbus::Vec3 sum{}, given{};
    double felt_n_s = 0.0, so_far_n_s = 0.0;  // along the way of the force, for a size
    struct Moment {
      double time_s, felt_n_s;
      rtbus::Vec3 difference_n_s;
    };
    std::vector<Moment> moments;
    harness.observe_steps([&](const rtbus::ProxyState& step) {
      Moment now{harness.now_s(), so_far_n_s, {}};
      for (std::size_t a = 0; a < 3; ++a) {
        given[a] -= step.contact_force_n[a] * step.step_s;
        now.difference_n_s[a] = sum[a] - given[a];
      }
      felt_n_s = so_far_n_s;
      moments.push_back(now);
    });
    harness.run(each.until_s, [&](const rtbus::Telemetry& tick) {
      for (std::size_t a = 0; a < 3; ++a) sum[a] -= tick.force_n[a] * tick_s;
      so_far_n_s += norm(tick.force_n) * tick_s;
    });
    std::snprintf(text, sizeof text, "%s, %s, %g Hz", each.method, each.name, each.physics_hz);
    PanelLine line{text, each.style, {}, {}, false};
    double worst_n_s = 0.0, share = 0.0;
    std::size_t before = 0;
    for (const Moment& now : moments) {
      while (moments[before].time_s < now.time_s - kWindow_s) ++before;
      if (now.time_s < kWindow_s) continue;
      rtbus::Vec3 change{};
      for (std::size_t a = 0; a < 3; ++a) change[a] = now.difference_n_s[a] - moments[before].difference_n_s[a];
      line.x.push_back(now.time_s);
      line.y.push_back(1e3 * norm(change));
      const double felt_here_n_s = now.felt_n_s - moments[before].felt_n_s;
      worst_n_s = std::max(worst_n_s, norm(change));
      if (felt_here_n_s > 0.02) share = std::max(share, norm(change) / felt_here_n_s);
    }
    panel.lines.push_back(std::move(line));
    table.rows.push_back(
        {std::string(each.name), std::string(each.method), each.physics_hz, felt_n_s, worst_n_s, share});
    if (std::string(each.method) != kLocalContact) continue;
    const std::string id = std::string("local-contact.third_law.") + (each.session[0] == 's' ? "soft" : "block");
    std::snprintf(text, sizeof text, ".%ghz", each.physics_hz);
    experiment.check_at_most(id + text, panel.lines.back().name + ": |felt - applied| in any second over what was felt",
                             share, "1", kThirdLaw);
    experiment.check_at_least(id + text + ".felt", panel.lines.back().name + ": impulse felt", felt_n_s, "N s", 0.1);
  }
  experiment.add_table(std::move(table));
  draw_panels(experiment, "local_contact_third_law", "Newton's third law across the link", {panel});
}

}  // namespace tools
