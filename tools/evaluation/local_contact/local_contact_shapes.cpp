/// Claim h of `rtbus evaluate local-contact`: a finger strokes over shapes that are no plane and no ball.
#include <algorithm>
#include <cmath>
#include <fstream>
#include <numbers>

#include "tools/cli/common/formatted.hpp"
#include "tools/cli/common/interrupt.hpp"
#include "tools/evaluation/local_contact/hand_run.hpp"
#include "tools/evaluation/local_contact/local_contact.hpp"
#include "tools/evaluation/shared/method_settings.hpp"

namespace tools {

namespace {

constexpr double kStrokeSpeed_m_s = 0.03, kHalfStroke_m = 0.02, kTip_m = 0.004, kStrokeStart_s = 1.0;
constexpr double kShapeError_n = 0.02, kShapeErrorShare = 0.02, kShapeChange_n = 0.1, kShapeCycle_us = 25.0;

struct ShapeCase {
  std::string id;
  std::string what;
  std::string shape;        ///< As in a scene file.
  std::string orientation;  ///< wxyz.
  double hand_y_m = 0.0;    ///< About 2 mm below first touch.
};

/// Points on an ellipsoid, half axes 25, 20 and 25 mm.
std::filesystem::path write_hull(const std::filesystem::path& file, int points) {
  std::ofstream out(file);
  for (int i = 0; i < points; ++i) {  // Fibonacci's spiral
    const double y = 1.0 - 2.0 * (i + 0.5) / points, ring = std::sqrt(1.0 - y * y);
    const double angle = std::numbers::pi * (3.0 - std::sqrt(5.0)) * i;
    out << "v " << 0.025 * ring * std::cos(angle) << ' ' << 0.02 * y << ' ' << 0.025 * ring * std::sin(angle) << '\n';
  }
  return file;
}

std::vector<ShapeCase> shape_cases(const std::filesystem::path& folder, bool quick) {
  const auto mesh = [&](int cells) {
    const auto file = write_bumps(folder / formatted("bumps_%d.obj", 2 * cells * cells), cells);
    return "{mesh: {file: " + std::filesystem::absolute(file).string() + ", metres_per_unit: 1}}";
  };
  const auto hull = [&](int points) {
    const auto file = write_hull(folder / formatted("hull_%d.obj", points), points);
    return "{convex_hull: {file: " + std::filesystem::absolute(file).string() + ", metres_per_unit: 1}}";
  };
  std::vector<ShapeCase> out{
      {"ridge", "ridge of a box", "{box: {size_m: [0.03, 0.03, 0.06]}}", "[0.9238795, 0, 0, 0.3826834]", 0.0232},
      {"hull_32", "hull of 32 points", hull(32), "[1, 0, 0, 0]", 0.0215},
      {"hull_200", "hull of 200 points", hull(200), "[1, 0, 0, 0]", 0.0215},
      {"mesh_10000", "bumps, 10 000 triangles", mesh(71), "[1, 0, 0, 0]", 0.003}};
  if (!quick) {
    out.push_back({"mesh_100000", "bumps, 100 000 triangles", mesh(224), "[1, 0, 0, 0]", 0.003});
  }
  return out;
}

HandRun stroke_over(const LocalContactOptions& options, const ShapeCase& each, const std::vector<std::string>& more) {
  std::vector<std::string> settings{
      "physics.engine=bullet",
      "scene.bodies.0.shape=" + each.shape,
      "scene.bodies.0.orientation_wxyz=" + each.orientation,
      "haptic.0.coupling={stiffness_n_per_m: 400, damping_n_s_per_m: 0.5}",
      formatted("haptic.0.proxy={mass_kg: 0.1, radius_m: %g, friction: 0}", kTip_m),
      formatted("haptic.0.device={schema: device/1, driver: simulated, model: phantom_desktop, hand: {type: push, "
                "start_m: [%g, 0, 0.002], direction: [1, 0, 0], distance_m: %g, speed_m_s: %g, start_s: %g, "
                "impedance: firm}}",
                -kHalfStroke_m, 2.0 * kHalfStroke_m, kStrokeSpeed_m_s, kStrokeStart_s),
      formatted("haptic.0.mapping={offset_m: [0, %g, 0]}", each.hand_y_m)};
  settings.insert(settings.end(), more.begin(), more.end());
  return run_hand(options, options.config_folder + "/wall.yaml", settings,
                  kStrokeStart_s + 2.0 * kHalfStroke_m / kStrokeSpeed_m_s + 0.5);
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
        options, each, {"haptic.0.method=local_contact", "haptic.0.rate_hz=10000", "physics.rate_hz=10000"});
    const double largest_n = largest_force_n(truth);
    experiment.check_at_least("local-contact.shapes." + each.id + ".presses",
                              each.what + ": largest force of the truth", largest_n, "N", 0.3);
    Panel panel{each.what + ", physics 18 Hz", "time [s]", "force [N]", {}, {}};
    panel.lines.push_back(hand_line(truth, converged_line(), kStrokeStart_s));
    for (const double physics_hz : {100.0, 43.0, 18.0}) {
      if (options.quick && physics_hz == 43.0) continue;
      for (const char* const method : {kLocalContact, kRemoteCoupling, kLeadingCoupling}) {
        std::vector<std::string> settings = method_settings(method);
        settings.push_back("physics.rate_hz=1000");
        settings.push_back(formatted("physics.throttle_hz=%g", physics_hz));
        const HandRun felt = stroke_over(options, each, settings);
        const HandError error = hand_error(felt, truth, kStrokeStart_s);
        table.rows.push_back({each.what, physics_hz, std::string(method), error.rms_n, error.peak_n, error.change_n,
                              felt.cycle_us, felt.cycle_p99_us});
        if (physics_hz == 18.0) panel.lines.push_back(hand_line(felt, method_line(method), kStrokeStart_s));
        if (std::string(method) != kLocalContact) continue;
        const std::string id = "local-contact.shapes." + each.id + formatted(".%ghz", physics_hz);
        const std::string what = each.what + formatted(", physics %g Hz: ", physics_hz);
        experiment.check_at_most(id, what + "force error, RMS", error.rms_n, "N",
                                 std::max(kShapeError_n, kShapeErrorShare * largest_n));
        experiment.check_at_most(id + ".change", what + "largest change in 1 ms", error.change_n, "N", kShapeChange_n);
        experiment.check_at_most(id + ".cycle", what + "haptic cycle, p99", felt.cycle_p99_us, "us", kShapeCycle_us,
                                 meter.read());
      }
    }
    panels.push_back(std::move(panel));
  }
  experiment.add_table(std::move(table));
  draw_panels(experiment, "local_contact_shapes", "A tip of 4 mm strokes over shapes at 30 mm/s, K = 400 N/m", panels);
}

}  // namespace tools
