/// Claim h of `rtbus evaluate local-contact`: a finger strokes over shapes that are no plane and no ball.
#include <algorithm>
#include <cmath>
#include <fstream>
#include <numbers>
#include <string_view>
#include <utility>

#include "tools/cli/common/formatted.hpp"
#include "tools/cli/common/interrupt.hpp"
#include "tools/evaluation/local_contact/hand_run.hpp"
#include "tools/evaluation/local_contact/local_contact.hpp"
#include "tools/evaluation/shared/method_settings.hpp"

namespace tools {

namespace {

constexpr double kStrokeSpeed_m_s = 0.03, kHalfStroke_m = 0.02, kTip_m = 0.004, kStrokeStart_s = 1.0;
/// What a shape is felt as: the methods of each table, and local_contact as it is where no shape is known.
constexpr const char* kCompared[] = {kLocalContact, kPlanesAlone, kRemoteCoupling, kLeadingCoupling,
                                     kForceInterpolation};
constexpr double kShapeError_n = 0.02, kShapeErrorShare = 0.02, kShapeChange_n = 0.1, kMeshCycle_us = 25.0;

/// In the bodies of a case: when motions begin. By the clock of the simulation, which is a step ahead of the hand's:
/// the first step is done when the hand's first sample has come.
constexpr std::string_view kBegins = "BEGINS";

/// The hand goes along +x.
struct ShapeCase {
  std::string id, what;
  std::string bodies;   ///< As in a scene file.
  std::string start_m;  ///< About 2 mm below first touch.
  double distance_m = 2.0 * kHalfStroke_m;
  double tip_friction = 0.0;
  bool forces_move = false;  ///< Then the error is compared with that of physics at 1 kHz without latency.
  double cycle_us = 10.0;    ///< Bar of the p99.
};

/// Points on an ellipsoid, half axes 25, 20 and 25 mm.
/// @param low What lies below is cut off, as a share of the half axis.
std::filesystem::path write_hull(const std::filesystem::path& file, int points, double low = -1.0) {
  std::ofstream out(file);
  for (int i = 0; i < points; ++i) {  // Fibonacci's spiral
    const double y = std::max(low, 1.0 - 2.0 * (i + 0.5) / points), ring = std::sqrt(1.0 - y * y);
    const double angle = std::numbers::pi * (3.0 - std::sqrt(5.0)) * i;
    out << "v " << 0.025 * ring * std::cos(angle) << ' ' << 0.02 * y << ' ' << 0.025 * ring * std::sin(angle) << '\n';
  }
  return file;
}

/// A floor that rises by 30 degrees from x = 5 mm on.
std::filesystem::path write_crease(const std::filesystem::path& file) {
  std::ofstream out(file);
  const double high = 0.025 * std::tan(std::numbers::pi / 6.0);
  for (const auto& [x, y] : {std::pair{-0.03, 0.0}, std::pair{0.005, 0.0}, std::pair{0.03, high}}) {
    out << "v " << x << ' ' << y << " -0.03\nv " << x << ' ' << y << " 0.03\n";
  }
  out << "f 1 2 4 3\nf 3 4 6 5\n";
  return file;
}

std::vector<ShapeCase> shape_cases(const std::filesystem::path& folder, bool quick) {
  const auto of_file = [](const char* kind, const std::filesystem::path& file) {
    return formatted("{%s: {file: ", kind) + std::filesystem::absolute(file).string() + ", metres_per_unit: 1}}";
  };
  const auto mesh = [&](int cells) {
    return of_file("mesh", write_bumps(folder / formatted("bumps_%d.obj", 2 * cells * cells), cells));
  };
  const auto hull = [&](int points) {
    return of_file("convex_hull", write_hull(folder / formatted("hull_%d.obj", points), points));
  };
  const auto body = [](const std::string& type, const std::string& shape, const std::string& more = "") {
    return "[{name: shape, type: " + type + ", shape: " + shape + more + "}]";
  };
  const std::string spins =
      ", motion: {spin: {axis: [0, 0, 1], rate_rad_s: 0.5, ramp_s: 0.5, start_s: " + std::string(kBegins) + "}}";
  const std::string cut = of_file("convex_hull", write_hull(folder / "hull_cut.obj", 64, -0.4));
  std::vector<ShapeCase> out{
      {"ridge", "ridge of a box",
       body("static", "{box: {size_m: [0.03, 0.03, 0.06]}}", ", orientation_wxyz: [0.9238795, 0, 0, 0.3826834]"),
       "[-0.02, 0.0232, 0.002]"},
      {"corner", "corner of a box",
       body("static", "{box: {size_m: [0.03, 0.03, 0.03]}}", ", orientation_wxyz: [0.888074, -0.325058, 0, 0.325058]"),
       "[-0.02, 0.028, 0.002]"},
      {"crease", "crease of a mesh", body("static", of_file("mesh", write_crease(folder / "crease.obj"))),
       "[-0.02, 0.002, 0.002]", 0.032},
      {"hull_32", "hull of 32 points", body("static", hull(32)), "[-0.02, 0.0215, 0.002]"},
      {"hull_200", "hull of 200 points", body("static", hull(200)), "[-0.02, 0.0215, 0.002]"},
      {"driven_box", "edge of a box that turns by itself",
       body("kinematic", "{box: {size_m: [0.03, 0.03, 0.06]}}", ", orientation_wxyz: [0.99929, 0, 0, 0.03769]" + spins),
       "[-0.02, 0.0232, 0.002]"},
      {"driven_hull", "hull of 32 points that turns by itself", body("kinematic", hull(32), spins),
       "[-0.02, 0.0215, 0.002]"},
      {"pushed_hull", "hull of 64 points, pushed",
       "[{name: floor, type: static, shape: {plane: {}}, friction: 0.5}, {name: shape, type: dynamic, mass_kg: 0.1, "
       "shape: " +
           cut + ", position_m: [0, 0.008, 0], friction: 0.6}]",
       "[-0.031, 0.008, 0.006]", 0.04, 0.5, true},
      {"mesh_10000", "bumps, 10 000 triangles", body("static", mesh(71)), "[-0.02, 0.003, 0.002]"}};
  if (!quick) {
    out.push_back({"mesh_100000", "bumps, 100 000 triangles", body("static", mesh(224)), "[-0.02, 0.003, 0.002]"});
  }
  for (ShapeCase& each : out) {
    if (each.id.starts_with("mesh")) each.cycle_us = kMeshCycle_us;
  }
  return out;
}

/// @param step_s Of physics.
HandRun stroke_over(const LocalContactOptions& options, const ShapeCase& each, double step_s,
                    const std::vector<std::string>& more, bool knows_shapes = true) {
  std::string bodies = each.bodies;
  if (const std::size_t at = bodies.find(kBegins); at != std::string::npos) {
    bodies.replace(at, kBegins.size(), formatted("%.9f", step_s));
  }
  std::vector<std::string> settings{
      "physics.engine=bullet",
      "scene={schema: scene/1, bodies: " + bodies + "}",
      "haptic.0.coupling={stiffness_n_per_m: 400, damping_n_s_per_m: 0.5}",
      formatted("haptic.0.proxy={mass_kg: 0.1, radius_m: %g, friction: %g}", kTip_m, each.tip_friction),
      formatted("haptic.0.device={schema: device/1, driver: simulated, model: phantom_desktop, hand: {type: push, "
                "start_m: [0, 0, 0], direction: [1, 0, 0], distance_m: %g, speed_m_s: %g, start_s: %g, "
                "impedance: firm}}",
                each.distance_m, kStrokeSpeed_m_s, kStrokeStart_s),
      "haptic.0.mapping={offset_m: " + each.start_m + "}"};
  settings.insert(settings.end(), more.begin(), more.end());
  return run_hand(options, options.config_folder + "/wall.yaml", settings,
                  kStrokeStart_s + each.distance_m / kStrokeSpeed_m_s + 0.5, std::nullopt, knows_shapes);
}

}  // namespace

std::filesystem::path write_bumps(const std::filesystem::path& file, int cells) {
  std::ofstream out(file);
  for (int i = 0; i <= cells; ++i) {
    for (int k = 0; k <= cells; ++k) {
      const double x = 0.05 * i / cells - 0.025, z = 0.05 * k / cells - 0.025;
      out << "v " << x << ' ' << 1e-3 * std::sin(314.0 * x) * std::cos(150.0 * z) << ' ' << z << '\n';
    }
  }
  for (int i = 0; i < cells; ++i) {
    for (int k = 1; k <= cells; ++k) {
      const int a = i * (cells + 1) + k, d = a + cells + 1;
      out << "f " << a << ' ' << a + 1 << ' ' << d + 1 << ' ' << d << '\n';
    }
  }
  return file;
}

void claim_shapes(const LocalContactOptions& options, Experiment& experiment) {
  Table table{"local_contact_shapes",
              {"shape", "physics [Hz]", "method", "force RMS [N]", "force peak [N]", "largest change in 1 ms [N]",
               "cycle, median [us]", "cycle, p99 [us]"},
              {}};
  std::vector<Panel> panels;
  const LoadMeter meter;
  for (const ShapeCase& each : shape_cases(experiment.folder(), options.quick)) {
    if (interrupted()) break;
    const HandRun truth = stroke_over(
        options, each, 1e-4, {"haptic.0.method=local_contact", "haptic.0.rate_hz=10000", "physics.rate_hz=10000"});
    const double largest_n = largest_force_n(truth);
    experiment.check_at_least("local-contact.shapes." + each.id + ".presses",
                              each.what + ": largest force of the truth", largest_n, "N", 0.3);
    // What steps of a millisecond of the engine are off by is not the method's.
    double prompt_n = 0.0;
    if (each.forces_move) {
      const HandRun prompt =
          stroke_over(options, each, 1e-3, {"haptic.0.method=local_contact", "physics.rate_hz=1000"});
      prompt_n = hand_error(prompt, truth, kStrokeStart_s).rms_n;
    }
    Panel panel{each.what + ", physics 18 Hz", "time [s]", "force [N]", {}, {}};
    panel.lines.push_back(hand_line(truth, converged_line(), kStrokeStart_s));
    for (const double physics_hz : {100.0, 43.0, 18.0}) {
      if (options.quick && physics_hz == 43.0) continue;
      for (const char* const method : kCompared) {
        std::vector<std::string> settings = method_settings(method);
        settings.push_back("physics.rate_hz=1000");
        settings.push_back(formatted("physics.throttle_hz=%g", physics_hz));
        const HandRun felt =
            stroke_over(options, each, 1.0 / physics_hz, settings, std::string_view(method) != kPlanesAlone);
        const HandError error = hand_error(felt, truth, kStrokeStart_s);
        table.rows.push_back({each.what, physics_hz, std::string(method), error.rms_n, error.peak_n, error.change_n,
                              felt.cycle_us, felt.cycle_p99_us});
        if (physics_hz == 18.0) panel.lines.push_back(hand_line(felt, method_line(method), kStrokeStart_s));
        if (std::string(method) != kLocalContact) continue;
        const std::string id = "local-contact.shapes." + each.id + formatted(".%ghz", physics_hz);
        const std::string what = each.what + formatted(", physics %g Hz: ", physics_hz);
        experiment.check_at_most(id, what + "force error, RMS", error.rms_n, "N",
                                 prompt_n + std::max(kShapeError_n, kShapeErrorShare * largest_n));
        experiment.check_at_most(id + ".change", what + "largest change in 1 ms", error.change_n, "N", kShapeChange_n);
        experiment.check_at_most(id + ".cycle", what + "haptic cycle, p99", felt.cycle_p99_us, "us", each.cycle_us,
                                 meter.read());
      }
    }
    panels.push_back(std::move(panel));
  }
  experiment.add_table(std::move(table));
  draw_panels(experiment, "local_contact_shapes", "A tip of 4 mm strokes over shapes at 30 mm/s, K = 400 N/m", panels);
}

}  // namespace tools
