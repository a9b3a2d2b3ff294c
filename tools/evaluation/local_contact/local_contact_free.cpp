/// Claim j of `rtbus evaluate local-contact`: free bodies that turn, tip, roll, slide off a table, stand on each
/// other and push each other.
#include <algorithm>
#include <cmath>
#include <numbers>

#include "tools/cli/common/formatted.hpp"
#include "tools/cli/common/interrupt.hpp"
#include "tools/evaluation/local_contact/hand_run.hpp"
#include "tools/evaluation/local_contact/local_contact.hpp"
#include "tools/evaluation/shared/method_settings.hpp"

namespace tools {

namespace {

constexpr double kPushStart_s = 1.0, kFreeErrorShare = 0.02;
/// Largest change of the force in 1 ms, at K = 300 to 400 N/m.
constexpr double kChange_n = 0.1;

/// The hand goes straight, at a speed, and stays at the end of its way.
struct FreeCase {
  std::string id, what;
  std::string bodies;  ///< As in a scene file; the second one is watched.
  std::string start_m, direction;
  double distance_m, speed_m_s, duration_s;
  double stiffness_n_per_m = 400.0;
  double proxy_friction = 0.5;
  double error_n = 0.02;   ///< More than with physics at 1 kHz without latency.
  double pushes_n = 0.15;  ///< At least, in truth.
  bool pile = false;       ///< A limit of the method (docs/local-contact.md): it is shown, and has no bars.
};

/// A box of 40 x 30 x 40 mm.
std::string box_at(int number, double y_m, double z_m, double mass_kg) {
  return formatted(
      ", {name: box%d, type: dynamic, mass_kg: %g, shape: {box: {size_m: [0.04, 0.03, 0.04]}}, "
      "position_m: [0, %g, %g], friction: 0.7}",
      number, mass_kg, y_m, z_m);
}

/// Each 0.1 mm before the next one.
std::string row_of(int boxes, double mass_kg) {
  std::string out;
  for (int i = 0; i < boxes; ++i) out += box_at(i, 0.015, -0.0401 * i, mass_kg);
  return out;
}

/// Three on the floor, two on these, one on top.
std::string pyramid(double mass_kg) {
  std::string out;
  for (int level = 0; level < 3; ++level) {
    for (int i = 0; i < 3 - level; ++i)
      out += box_at(3 * level + i, 0.015 + 0.03 * level, -0.041 * i - 0.0205 * level, mass_kg);
  }
  return out;
}

/// Of 400 g, pushed at its side, with eight boxes on it.
std::string tray_of_eight(double mass_kg) {
  std::string out =
      ", {name: tray, type: dynamic, mass_kg: 0.4, shape: {box: {size_m: [0.16, 0.03, 0.08]}}, "
      "position_m: [0, 0.015, -0.02], friction: 0.7}";
  for (int i = 0; i < 8; ++i) {
    out += formatted(
        ", {name: item%d, type: dynamic, mass_kg: %g, shape: {box: {size_m: [0.03, 0.03, 0.03]}}, "
        "position_m: [%g, 0.045, %g], friction: 0.7}",
        i, mass_kg, -0.06 + 0.04 * (i % 4), -0.04 + 0.04 * (i / 4));
  }
  return out;
}

std::vector<FreeCase> free_cases() {
  const std::string floor = "{name: floor, type: static, shape: {plane: {}}, friction: 0.5}";
  return {{"corner", "a block pushed at a corner: it turns",
           "[" + floor +
               ", {name: block, type: dynamic, mass_kg: 0.1, shape: {box: {size_m: [0.06, 0.04, 0.04]}}, "
               "position_m: [0, 0.02, -0.02], friction: 0.6}]",
           "[0.022, 0.02, 0.012]", "[0, 0, -1]", 0.03, 0.03, 3.0, 400.0, 0.5, 0.03},
          {"tip", "a tall box tipped over its edge",
           "[" + floor +
               ", {name: box, type: dynamic, mass_kg: 0.2, shape: {box: {size_m: [0.04, 0.08, 0.03]}}, "
               "position_m: [0, 0.04, -0.015], friction: 1.5}]",
           "[0, 0.07, 0.012]", "[0, 0, -1]", 0.06, 0.03, 4.0},
          {"table", "a block pushed off a table",
           "[{name: table, type: static, shape: {box: {size_m: [0.2, 0.1, 0.1]}}, position_m: [0, -0.05, -0.01], "
           "friction: 0.5}, {name: block, type: dynamic, mass_kg: 0.1, shape: {box: {size_m: [0.04, 0.04, 0.03]}}, "
           "position_m: [0, 0.02, -0.025], friction: 0.4}]",
           "[0, 0.02, 0.002]", "[0, 0, -1]", 0.06, 0.03, 3.5},
          {"ball", "a ball stroked along its top: it rolls",
           "[" + floor +
               ", {name: ball, type: dynamic, mass_kg: 0.05, shape: {sphere: {radius_m: 0.012}}, "
               "position_m: [0.045, 0.012, 0], friction: 0.7}]",
           "[0.035, 0.0275, 0]", "[1, 0, 0]", 0.03, 0.03, 2.5, 300.0, 1.0},
          {"can", "a can pushed off a table",
           "[{name: table, type: static, shape: {box: {size_m: [0.2, 0.1, 0.1]}}, position_m: [0, -0.05, -0.01], "
           "friction: 0.5}, {name: can, type: dynamic, mass_kg: 0.2, shape: {cylinder: {radius_m: 0.02, length_m: "
           "0.04}}, position_m: [0, 0.02, -0.025], friction: 0.4}]",
           "[0, 0.02, 0.002]", "[0, 0, -1]", 0.06, 0.03, 3.5},
          {"roller", "a cylinder stroked along its top on a table: it rolls",
           "[{name: table, type: static, shape: {box: {size_m: [0.4, 0.1, 0.2]}}, position_m: [0, -0.05, 0], "
           "friction: 0.5}, {name: roller, type: dynamic, mass_kg: 0.1, shape: {cylinder: {radius_m: 0.012, length_m: "
           "0.05}}, position_m: [0.045, 0.012, 0], orientation_wxyz: [0.70710678, 0.70710678, 0, 0], friction: 0.7}]",
           "[0.035, 0.0275, 0]", "[1, 0, 0]", 0.03, 0.03, 2.5, 300.0, 1.0},
          {"stack", "a stack of three, pushed down and along at its top",
           "[" + floor +
               ", {name: low, type: dynamic, mass_kg: 0.1, shape: {box: {size_m: [0.04, 0.02, 0.04]}}, "
               "position_m: [0, 0.01, 0], friction: 0.5}, {name: middle, type: dynamic, mass_kg: 0.1, "
               "shape: {box: {size_m: [0.04, 0.02, 0.04]}}, position_m: [0, 0.03, 0], friction: 0.5}, "
               "{name: top, type: dynamic, mass_kg: 0.1, shape: {box: {size_m: [0.04, 0.02, 0.04]}}, "
               "position_m: [0, 0.05, 0], friction: 0.5}]",
           "[0, 0.07, 0]", "[0.2, -1, 0]", 0.01, 0.02, 3.0},
          {"carries", "a box that carries another, pushed",
           "[" + floor +
               ", {name: low, type: dynamic, mass_kg: 0.2, shape: {box: {size_m: [0.04, 0.03, 0.04]}}, "
               "position_m: [0, 0.015, 0], friction: 0.7}, {name: high, type: dynamic, mass_kg: 0.2, "
               "shape: {box: {size_m: [0.04, 0.03, 0.04]}}, position_m: [0, 0.045, 0], friction: 0.7}]",
           "[0, 0.015, 0.03]", "[0, 0, -1]", 0.06, 0.03, 3.5, 400.0, 0.0},
          {"row", "a box pushed against another",
           "[" + floor +
               ", {name: near, type: dynamic, mass_kg: 0.1, shape: {box: {size_m: [0.04, 0.03, 0.04]}}, "
               "position_m: [0, 0.015, 0], friction: 0.7}, {name: far, type: dynamic, mass_kg: 0.3, "
               "shape: {box: {size_m: [0.04, 0.03, 0.04]}}, position_m: [0, 0.015, -0.055], friction: 0.7}]",
           "[0, 0.015, 0.03]", "[0, 0, -1]", 0.06, 0.03, 3.5, 400.0, 0.0},
          {"light_tip", "a tall box of 10 g tipped over its edge",
           "[" + floor +
               ", {name: box, type: dynamic, mass_kg: 0.01, shape: {box: {size_m: [0.04, 0.08, 0.03]}}, "
               "position_m: [0, 0.04, -0.015], friction: 1.5}]",
           "[0, 0.07, 0.012]", "[0, 0, -1]", 0.06, 0.03, 4.0, 400.0, 0.5, 0.02, 0.05},
          {"light_table", "a block of 10 g pushed off a table",
           "[{name: table, type: static, shape: {box: {size_m: [0.2, 0.1, 0.1]}}, position_m: [0, -0.05, -0.01], "
           "friction: 0.5}, {name: block, type: dynamic, mass_kg: 0.01, shape: {box: {size_m: [0.04, 0.04, 0.03]}}, "
           "position_m: [0, 0.02, -0.025], friction: 0.4}]",
           "[0, 0.02, 0.002]", "[0, 0, -1]", 0.06, 0.03, 3.5, 400.0, 0.5, 0.02, 0.05},
          {"light_row", "a box of 10 g pushed against another",
           "[" + floor +
               ", {name: near, type: dynamic, mass_kg: 0.01, shape: {box: {size_m: [0.04, 0.03, 0.04]}}, "
               "position_m: [0, 0.015, 0], friction: 0.7}, {name: far, type: dynamic, mass_kg: 0.01, "
               "shape: {box: {size_m: [0.04, 0.03, 0.04]}}, position_m: [0, 0.015, -0.055], friction: 0.7}]",
           "[0, 0.015, 0.03]", "[0, 0, -1]", 0.06, 0.03, 3.5, 400.0, 0.0, 0.02, 0.05},
          {"very_light_row", "a box of 1 g pushed against another, K = 1480 N/m", "[" + floor + row_of(2, 0.001) + "]",
           "[0, 0.015, 0.03]", "[0, 0, -1]", 0.06, 0.03, 3.5, 1480.0, 0.0, 0.02, 0.015},
          {"row_of_five", "a row of five boxes pushed", "[" + floor + row_of(5, 0.1) + "]", "[0, 0.015, 0.03]",
           "[0, 0, -1]", 0.06, 0.03, 3.5, 400.0, 0.0},
          {"pyramid", "a pyramid of six boxes pushed at its foot", "[" + floor + pyramid(0.1) + "]", "[0, 0.015, 0.03]",
           "[0, 0, -1]", 0.06, 0.03, 3.5, 400.0, 0.0},
          {"carries_light", "a box of 400 g that carries one of 20 g, pushed",
           "[" + floor + box_at(0, 0.015, 0.0, 0.4) + box_at(1, 0.045, 0.0, 0.02) + "]", "[0, 0.015, 0.03]",
           "[0, 0, -1]", 0.06, 0.03, 3.5, 400.0, 0.0},
          {"carries_heavy", "a box of 20 g that carries one of 400 g, pushed",
           "[" + floor + box_at(0, 0.015, 0.0, 0.02) + box_at(1, 0.045, 0.0, 0.4) + "]", "[0, 0.015, 0.03]",
           "[0, 0, -1]", 0.06, 0.03, 3.5, 400.0, 0.0},
          {"on_heavy", "a box of 50 g pushed over one of 600 g",
           "[" + floor +
               ", {name: low, type: dynamic, mass_kg: 0.6, shape: {box: {size_m: [0.06, 0.03, 0.16]}}, "
               "position_m: [0, 0.015, -0.05], friction: 0.7}" +
               box_at(1, 0.045, 0.0, 0.05) + "]",
           "[0, 0.045, 0.03]", "[0, 0, -1]", 0.06, 0.03, 3.5, 400.0, 0.0, 0.02, 0.05},
          {"tray", "a tray of 400 g with eight boxes of 100 g, pushed", "[" + floor + tray_of_eight(0.1) + "]",
           "[0, 0.015, 0.03]", "[0, 0, -1]", 0.06, 0.03, 3.5, 400.0, 0.0},
          {"light_tray", "a tray of 400 g with eight boxes of 20 g, pushed", "[" + floor + tray_of_eight(0.02) + "]",
           "[0, 0.015, 0.03]", "[0, 0, -1]", 0.06, 0.03, 3.5, 400.0, 0.0},
          {"pile", "a row of eight boxes pushed: a pile", "[" + floor + row_of(8, 0.1) + "]", "[0, 0.015, 0.03]",
           "[0, 0, -1]", 0.06, 0.03, 3.5, 400.0, 0.0, 0.02, 0.15, true}};
}

HandRun push(const LocalContactOptions& options, const FreeCase& each, const std::vector<std::string>& more) {
  std::vector<std::string> settings{
      "scene={schema: scene/1, gravity_m_s2: [0, -9.81, 0], bodies: " + each.bodies + "}",
      formatted("haptic.0.coupling={stiffness_n_per_m: %g, damping_n_s_per_m: 0.5}", each.stiffness_n_per_m),
      formatted("haptic.0.proxy={mass_kg: 0.1, radius_m: 0.005, friction: %g}", each.proxy_friction),
      "haptic.0.mapping={offset_m: " + each.start_m + "}",
      formatted("haptic.0.device={schema: device/1, driver: simulated, model: phantom_desktop, hand: {type: push, "
                "start_m: [0, 0, 0], direction: %s, distance_m: %g, speed_m_s: %g, start_s: %g, impedance: firm}}",
                each.direction.c_str(), each.distance_m, each.speed_m_s, kPushStart_s)};
  settings.insert(settings.end(), more.begin(), more.end());
  return run_hand(options, options.config_folder + "/free_block.yaml", settings, each.duration_s, 1);
}

}  // namespace

void claim_free_bodies(const LocalContactOptions& options, Experiment& experiment) {
  Table table{"local_contact_free_bodies",
              {"scene", "physics [Hz]", "method", "force RMS [N]", "force peak [N]", "largest change in 1 ms [N]",
               "body off by [mm]", "and by [deg]"},
              {}};
  std::vector<Panel> panels;
  for (const FreeCase& each : free_cases()) {
    if (interrupted()) break;
    const HandRun truth =
        push(options, each, {"haptic.0.method=local_contact", "haptic.0.rate_hz=10000", "physics.rate_hz=10000"});
    const double largest_n = largest_force_n(truth);
    experiment.check_at_least("local-contact.free." + each.id + ".pushes", each.what + ": largest force of the truth",
                              largest_n, "N", each.pushes_n);
    const HandRun prompt = push(options, each, {"haptic.0.method=local_contact", "physics.rate_hz=1000"});
    const auto add_row = [&](double physics_hz, const std::string& method, const HandRun& felt) {
      const HandError error = hand_error(felt, truth, kPushStart_s);
      const double off_mm = 1e3 * (felt.last.position_m - truth.last.position_m).norm();
      const double off_deg = 180.0 / std::numbers::pi * felt.last.orientation.angularDistance(truth.last.orientation);
      table.rows.push_back({each.what, physics_hz, method, error.rms_n, error.peak_n, error.change_n, off_mm, off_deg});
      return error;
    };
    // What steps of a millisecond of the engine are off by is not the method's.
    const double prompt_n = add_row(1000.0, std::string(kLocalContact) + ", no latency", prompt).rms_n;
    Panel panel{each.what + ", physics 18 Hz", "time [s]", "force [N]", {}, {}};
    panel.lines.push_back(hand_line(truth, converged_line(), kPushStart_s));
    for (const double physics_hz : {100.0, 43.0, 18.0}) {
      if (options.quick && physics_hz == 43.0) continue;
      for (const char* const method : kAllCompared) {
        std::vector<std::string> settings = method_settings(method);
        settings.push_back("physics.rate_hz=1000");
        settings.push_back(formatted("physics.throttle_hz=%g", physics_hz));
        const HandRun felt = push(options, each, settings);
        const HandError error = add_row(physics_hz, method, felt);
        if (physics_hz == 18.0) panel.lines.push_back(hand_line(felt, method_line(method), kPushStart_s));
        if (std::string(method) != kLocalContact || each.pile) continue;
        const std::string id = "local-contact.free." + each.id + formatted(".%ghz", physics_hz);
        const std::string what = each.what + formatted(", physics %g Hz: ", physics_hz);
        experiment.check_at_most(id, what + "force error, RMS", error.rms_n, "N",
                                 prompt_n + std::max(each.error_n, kFreeErrorShare * largest_n));
        experiment.check_at_most(id + ".change", what + "largest change in 1 ms", error.change_n, "N", kChange_n);
      }
    }
    panels.push_back(std::move(panel));
  }
  experiment.add_table(std::move(table));
  draw_panels(experiment, "local_contact_free_bodies", "A tip of 5 mm pushes free bodies at 20 to 30 mm/s", panels);
}

}  // namespace tools
