/// Claims b, c and d of `rtbus evaluate local-contact`: free air, sliding, a stiff wall.
#include <algorithm>
#include <cmath>
#include <cstdio>

#include "rtbus/clock.hpp"
#include "tools/cli/common/formatted.hpp"
#include "tools/evaluation/drop/fall.hpp"
#include "tools/evaluation/local_contact/local_contact.hpp"
#include "tools/evaluation/shared/method_settings.hpp"

namespace tools {

namespace {

using Settings = std::vector<std::string>;

constexpr double kAir_n = 0.02, kRipple_n = 0.05, kSettling = 1.2;
constexpr double kStart_s = 1.0;

/// A hand moves the tip along x, from −60 to 60 mm at height `y_m`.
Settings stroke(const std::string& method, double y_m, double speed_m_s) {
  Settings out = method_settings(method);
  out.push_back(
      formatted("haptic.0.device={schema: device/1, driver: simulated, model: phantom_desktop, hand: {type: push, "
                "start_m: [-0.06, %g, 0], direction: [1, 0, 0], distance_m: 0.12, speed_m_s: %g, start_s: %g, "
                "impedance: firm}}",
                y_m, speed_m_s, kStart_s));
  out.emplace_back("haptic.0.coupling.stiffness_n_per_m=500");
  return out;
}

Settings with(Settings all, const Settings& more) {
  all.insert(all.end(), more.begin(), more.end());
  return all;
}

double time_of(const std::vector<rtbus::Telemetry>& ticks, std::size_t i) {
  return rtbus::seconds_between(ticks.front().due_ns, ticks[i].due_ns);
}

}  // namespace

void claim_free_air(const LocalContactOptions& options, Experiment& experiment) {
  constexpr double kSpeed_m_s = 0.2;
  struct Row {
    const char* method;
    const char* name;
    double physics_hz;
    bool paper;
  };
  constexpr Row kRows[] = {{"direct", "direct", 0, false},
                           {kLocalContact, "local_contact, physics 18 Hz", 18, false},
                           {kRemoteCoupling, "remote coupling, 100 Hz", 100, false},
                           {kRemoteCoupling, "remote coupling, 18 Hz", 18, false},
                           {kLeadingCoupling, "remote coupling, lead_steps: 2, 18 Hz", 18, false},
                           {kRemoteCoupling, "remote coupling, form: paper (50 packets/s)", 0, true}};
  const char* const styles[] = {"lc rgb 'black'",   "lc rgb '#1b7a35'",      "lc rgb '#7fb0e6'",
                                "lc rgb '#1f5fa8'", "lc rgb '#1f5fa8' dt 3", "lc rgb '#a0308a'"};
  Table table{"local_contact_air", {"method", "physics [Hz]", "largest force [N]", "mean drag [N s/m]"}, {}};
  Panel panel{"Free air, K = 500 N/m, at 0.2 m/s", "time [s]", "force against the motion [N]", {}, {}};
  std::size_t style = 0;
  for (const Row& row : kRows) {
    Settings settings = stroke(row.method, 0.02, kSpeed_m_s);
    if (row.physics_hz > 0) settings.push_back(formatted("physics.throttle_hz=%g", row.physics_hz));
    if (row.paper) settings.emplace_back("haptic.0.form=paper");
    const auto ticks = record_hand(options, "wall.yaml", settings, 1.9);
    double largest_n = 0.0, drag = 0.0;
    std::size_t count = 0;
    PanelLine line{row.name, styles[style++], {}, {}, false};
    for (std::size_t i = 0; i < ticks.size(); ++i) {
      if (time_of(ticks, i) < 0.9) continue;
      largest_n = std::max(largest_n, norm(ticks[i].rendered_force_n));
      line.x.push_back(time_of(ticks, i));
      line.y.push_back(-ticks[i].rendered_force_n[0]);
      if (ticks[i].velocity_m_s[0] < 0.9 * kSpeed_m_s) continue;
      drag -= ticks[i].rendered_force_n[0] / ticks[i].velocity_m_s[0];
      ++count;
    }
    panel.lines.push_back(std::move(line));
    table.rows.push_back(
        {std::string(row.name), row.physics_hz, largest_n, count > 0 ? drag / static_cast<double>(count) : 0.0});
    if (std::string(row.method) == kLocalContact) {
      experiment.check_at_most("local-contact.air.force", "free air at 0.2 m/s, physics 18 Hz: largest force",
                               largest_n, "N", kAir_n);
      experiment.check_at_least("local-contact.air.moves", "free air: ticks at 0.2 m/s that were looked at",
                                static_cast<double>(count), "1", 100.0);
    }
  }
  experiment.add_table(std::move(table));
  draw_panels(experiment, "local_contact_air", "Drag in free air", {panel});
}

void claim_sliding(const LocalContactOptions& options, Experiment& experiment) {
  constexpr double kSpeed_m_s = 0.1;
  struct Surface {
    const char* id;
    const char* what;
    const char* session;
    double friction;
    double y_m;              ///< Of the hand: deeper where the surface falls away.
    double from_s, until_s;  ///< The middle of the way, after what the beginning shakes.
  };
  constexpr Surface kSurfaces[] = {{"flat", "flat, without friction", "wall.yaml", 0.0, -0.003, 1.4, 1.98},
                                   {"flat_friction", "flat, friction 0.3", "wall.yaml", 0.3, -0.003, 1.4, 1.98},
                                   {"ball", "ball of 50 mm", "sphere.yaml", 0.0, -0.008, 1.45, 1.85}};
  Table table{"local_contact_sliding",
              {"surface", "method", "physics [Hz]", "mean normal force [N]", "ripple, peak to peak [N]"},
              {}};
  std::vector<Panel> panels;
  for (const Surface& surface : kSurfaces) {
    const Settings rubs = {formatted("haptic.0.proxy.friction=%g", surface.friction), "scene.bodies.0.friction=1"};
    // What the surface itself does to the force: friction, and on a ball the way over it.
    const auto smooth = record_hand(options, surface.session, stroke("direct", surface.y_m, kSpeed_m_s), 2.1);
    Panel panel{surface.what, "time [s]", "force beyond friction, along x [N]", {}, {}};
    for (const auto& [method, physics_hz] :
         {std::pair{kRemoteCoupling, 100.0}, std::pair{kRemoteCoupling, 18.0}, std::pair{kLeadingCoupling, 100.0},
          std::pair{kLeadingCoupling, 18.0}, std::pair{kLocalContact, 100.0}, std::pair{kLocalContact, 18.0}}) {
      const auto ticks = record_hand(
          options, surface.session,
          with(with(stroke(method, surface.y_m, kSpeed_m_s), rubs), {formatted("physics.throttle_hz=%g", physics_hz)}),
          2.1);
      double low_n = HUGE_VAL, high_n = -HUGE_VAL, normal_n = 0.0;
      std::size_t count = 0;
      const bool local = std::string(method) == kLocalContact;
      const bool leads = std::string(method) == kLeadingCoupling;
      const char* const colour = local ? "'#1b7a35'" : leads ? "'#7fb0e6'" : "'#1f5fa8'";
      PanelLine line{std::string(method) + formatted(", %g Hz", physics_hz),
                     std::string("lc rgb ") + colour + (physics_hz == 18.0 ? "" : " dt 3"),
                     {},
                     {},
                     false};
      for (std::size_t i = 0; i < std::min(ticks.size(), smooth.size()); ++i) {
        const double t = time_of(ticks, i);
        if (t < surface.from_s || t > surface.until_s) continue;
        const double pressed_n = norm(smooth[i].rendered_force_n);
        const double beyond_n = ticks[i].rendered_force_n[0] - smooth[i].rendered_force_n[0] +
                                surface.friction * ticks[i].rendered_force_n[1];
        low_n = std::min(low_n, beyond_n);
        high_n = std::max(high_n, beyond_n);
        normal_n += pressed_n;
        ++count;
        line.x.push_back(t);
        line.y.push_back(beyond_n);
      }
      normal_n /= static_cast<double>(std::max<std::size_t>(count, 1));
      panel.lines.push_back(std::move(line));
      table.rows.push_back({std::string(surface.what), std::string(method), physics_hz, normal_n, high_n - low_n});
      if (!local) continue;
      experiment.check_at_most(
          formatted((std::string("local-contact.sliding.") + surface.id + ".%ghz").c_str(), physics_hz),
          std::string("sliding at 0.1 m/s, ") + surface.what +
              formatted(", physics %g Hz: ripple beyond friction, peak to peak", physics_hz),
          high_n - low_n, "N", kRipple_n);
      if (physics_hz != 18.0) continue;
      experiment.check_at_least(std::string("local-contact.sliding.") + surface.id + ".presses",
                                std::string("sliding, ") + surface.what + ": mean force of direct there", normal_n, "N",
                                0.5);
    }
    panels.push_back(std::move(panel));
  }
  experiment.add_table(std::move(table));
  draw_panels(experiment, "local_contact_sliding", "Sliding along a surface at 0.1 m/s, K = 500 N/m", panels);
}

void claim_wall(const LocalContactOptions& options, Experiment& experiment) {
  FallSetup setup;
  setup.session_file = options.config_folder + "/wall.yaml";
  setup.duration_s = 4.0;
  const Settings wall = {"haptic.0.coupling.stiffness_n_per_m=2000", "haptic.0.coupling.damping_n_s_per_m=2",
                         "haptic.0.device.limits.max_stiffness_n_per_m=2000"};
  const FallLimits limits;
  struct Row {
    const char* method;
    double physics_hz;
  };
  constexpr Row kRows[] = {{"direct", 0}, {kLocalContact, 18}, {kRemoteCoupling, 18}, {kLeadingCoupling, 18}};
  Table table{
      "local_contact_wall", {"method", "physics [Hz]", "outcome", "settling [s]", "rest [mm]", "peak force [N]"}, {}};
  Panel heights{"Height of the tip", "time since the release [s]", "height [mm]", {}, "set xrange [0:1.5]"};
  Panel forces{"Force on the hand", "time since the release [s]", "force [N]", {}, "set xrange [0:1.5]"};
  double direct_s = 0.0;
  for (const Row& row : kRows) {
    setup.assignments = with(wall, method_settings(row.method));
    if (row.physics_hz > 0) setup.assignments.push_back(formatted("physics.throttle_hz=%g", row.physics_hz));
    setup.assignments.insert(setup.assignments.end(), options.assignments.begin(), options.assignments.end());
    const FallTrace trace = fall_in_harness(setup, {});
    const FallFigures figures = judge_fall(trace, limits);
    const bool settled = figures.outcome == Outcome::kSettled;
    const std::string name =
        row.physics_hz > 0 ? row.method + formatted(", physics %g Hz", row.physics_hz) : row.method;
    PanelLine height = method_line(row.method, name), force = height;
    const std::size_t release = release_index(trace);
    for (std::size_t i = release; i < trace.time_s.size(); ++i) {
      height.x.push_back(trace.time_s[i] - trace.time_s[release]);
      height.y.push_back(1e3 * trace.height_m[i]);
      force.x.push_back(height.x.back());
      force.y.push_back(trace.force_n[i]);
    }
    heights.lines.push_back(std::move(height));
    forces.lines.push_back(std::move(force));
    table.rows.push_back({std::string(row.method), row.physics_hz, std::string(to_string(figures.outcome)),
                          settled ? Cell(figures.settling_s) : Cell(std::string("-")), 1e3 * figures.rest_m,
                          figures.peak_force_n});
    if (row.physics_hz == 0) direct_s = settled ? figures.settling_s : 0.0;
    if (std::string(row.method) != kLocalContact) continue;
    experiment.check_at_most("local-contact.wall.settling",
                             "wall, K = 2000 N/m, B = 2 N s/m, no hand, physics 18 Hz: settling over direct's at 1 kHz",
                             settled && direct_s > 0.0 ? figures.settling_s / direct_s : HUGE_VAL, "1", kSettling);
  }
  experiment.add_table(std::move(table));
  draw_panels(experiment, "local_contact_wall", "Nobody holds the tip: it falls 20 mm onto a wall of 2000 N/m",
              {heights, forces});
}

}  // namespace tools
