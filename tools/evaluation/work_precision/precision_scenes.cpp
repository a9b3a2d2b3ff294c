#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <memory>

#include "tools/cli/common/formatted.hpp"
#include "tools/evaluation/work_precision/wall_solution.hpp"
#include "tools/evaluation/work_precision/work_precision.hpp"

namespace tools {

namespace {

// One hand for the wall and its closed form: the session gets these numbers, and so does the solution.
constexpr double kTouch_m = 0.020, kWay_m = 0.025, kSpeed_m_s = 0.05, kRamp_s = 0.1, kBegin_s = 0.5;
constexpr double kWallStiffness = 500.0, kWallDamping = 1.0;
constexpr double kDropStiffness = 200.0, kDropDamping = 0.02, kRelease_s = 0.5;
constexpr double kSoftStiffness = 300.0;
constexpr const char* kOneRabbit =
    "scene.soft_bodies=[{name: middle, mesh: {rabbit: {nodes: 453, height_m: 0.07}}, position_m: [0, 0.001, 0], "
    "orientation_wxyz: [0.7071, 0, 0.7071, 0], mass_kg: 0.1, pose_matching_hz: 20, bulk_modulus_pa: 5000, "
    "damping_per_s: 4}]";
constexpr double kHandStiffness = 300.0, kHandDamping = 3.0, kHandMass_kg = 0.08;

/// A device without quanta, and integrated finely: what is left is the method's own error.
std::vector<std::string> exact_device() {
  return {"haptic.0.device.mechanics.position_quantum_m=0", "haptic.0.device.mechanics.force_step_n=0",
          "haptic.0.device.mechanics.integration_step_us=10"};
}

std::vector<std::string> push(const char* start, const char* direction, double way_m, double speed_m_s,
                              double begin_s) {
  return {std::string("haptic.0.device.hand.start_m=") + start,
          std::string("haptic.0.device.hand.direction=") + direction,
          formatted("haptic.0.device.hand.distance_m=%.17g", way_m),
          formatted("haptic.0.device.hand.speed_m_s=%.17g", speed_m_s),
          formatted("haptic.0.device.hand.start_s=%.17g", begin_s),
          formatted("haptic.0.device.hand.ramp_s=%.17g", kRamp_s)};
}

std::vector<std::string> gains(double stiffness, double damping) {
  return {formatted("haptic.0.coupling.stiffness_n_per_m=%.17g", stiffness),
          formatted("haptic.0.coupling.damping_n_s_per_m=%.17g", damping),
          "haptic.0.proxy={mass_kg: 0.1}"};  // a point; its spring as stiff as the hand's
}

void append(std::vector<std::string>& to, const std::vector<std::string>& more) {
  to.insert(to.end(), more.begin(), more.end());
}

PrecisionScene scene(const std::string& name, const std::string& file, const std::vector<std::string>& device,
                     const std::vector<std::string>& coupling, const WorkPrecisionOptions& options) {
  PrecisionScene out;
  out.name = name;
  out.session_file = file;
  out.assignments = device;
  append(out.assignments, exact_device());
  append(out.assignments, coupling);
  append(out.assignments, options.assignments);
  return out;
}

}  // namespace

PrecisionScene wall_scene(const WorkPrecisionOptions& options) {
  std::vector<std::string> device{"haptic.0.device=devices/sim_phantom_desktop_push.yaml"};
  append(device, push("[0, 0.02, 0]", "[0, -1, 0]", kWay_m, kSpeed_m_s, kBegin_s));
  PrecisionScene out = scene("wall", options.wall_file, device, gains(kWallStiffness, kWallDamping), options);
  out.from_s = kBegin_s;
  out.until_s = 2.0;
  return out;
}

PrecisionScene drop_scene(const WorkPrecisionOptions& options) {
  PrecisionScene out = scene("drop", options.wall_file, {formatted("haptic.0.device.hand.release_s=%.17g", kRelease_s)},
                             gains(kDropStiffness, kDropDamping), options);
  out.from_s = kRelease_s;
  out.until_s = 2.0;
  return out;
}

PrecisionScene sphere_scene(const WorkPrecisionOptions& options) {
  std::vector<std::string> device{"haptic.0.device=devices/sim_phantom_desktop_push.yaml"};
  // Down onto the flank of the ball: the contact slides and its normal turns.
  append(device, push("[0.01, 0.015, 0]", "[0.3, -1, 0]", 0.030, 0.05, kBegin_s));
  PrecisionScene out = scene("sphere", options.sphere_file, device, gains(kWallStiffness, kWallDamping), options);
  out.assignments.emplace_back("scene.bodies.0.friction=0");  // `direct` has none
  out.from_s = kBegin_s;
  out.until_s = 2.0;
  return out;
}

PrecisionScene block_scene(const WorkPrecisionOptions& options) {
  PrecisionScene out = scene("block", options.block_file, push("[0, 0, 0.02]", "[0, 0, -1]", 0.05, 0.05, kBegin_s),
                             gains(kWallStiffness, kWallDamping), options);
  out.assignments.insert(out.assignments.begin(), "scene.bodies.1.mass_kg=0.1");
  out.assignments.emplace_back("haptic.0.proxy.radius_m=0.005");
  out.axis = 2;
  out.from_s = kBegin_s;
  out.until_s = 2.5;
  out.at_rest = false;
  out.iterations = {1, 4, 40};
  return out;
}

PrecisionScene ridge_scene(const WorkPrecisionOptions& options) {
  PrecisionScene out =
      scene("ridge", options.block_file, push("[-0.02, 0.0232, 0.002]", "[1, 0, 0]", 0.04, 0.03, kBegin_s),
            gains(kWallStiffness, kWallDamping), options);
  append(out.assignments,
         {"scene={schema: scene/1, bodies: [{name: ridge, type: static, shape: {box: {size_m: [0.03, 0.03, 0.06]}}, "
          "orientation_wxyz: [0.9238795, 0, 0, 0.3826834], friction: 0.3}]}",
          "haptic.0.proxy.radius_m=0.004", "haptic.0.proxy.friction=0", "haptic.0.mapping.offset_m=[0, 0, 0]"});
  out.from_s = kBegin_s;
  out.until_s = 2.2;
  out.at_rest = false;
  return out;
}

PrecisionScene ball_scene(const WorkPrecisionOptions& options) {
  PrecisionScene out = scene("ball", options.block_file, push("[0, 0, 0]", "[1, 0, 0]", 0.03, 0.03, kBegin_s),
                             gains(kSoftStiffness, kWallDamping), options);
  append(
      out.assignments,
      {"scene={schema: scene/1, gravity_m_s2: [0, -9.81, 0], bodies: [{name: floor, type: static, shape: {plane: {}}, "
       "friction: 0.5}, {name: ball, type: dynamic, mass_kg: 0.05, shape: {sphere: {radius_m: 0.012}}, "
       "position_m: [0.045, 0.012, 0], friction: 0.7}]}",
       "haptic.0.proxy.radius_m=0.005", "haptic.0.mapping.offset_m=[0.035, 0.0275, 0]"});
  out.axis = 1;
  out.from_s = kBegin_s;
  out.until_s = 2.0;
  out.at_rest = false;
  out.iterations = {1, 4, 40};
  return out;
}

PrecisionScene own_scene(const WorkPrecisionOptions& options) {
  PrecisionScene out;
  out.name = std::filesystem::path(options.own_file).stem();
  out.session_file = options.own_file;
  out.assignments = options.assignments;
  out.until_s = options.seconds;
  out.at_rest = false;
  double most_n2 = -1.0;
  int axis = 1;
  for (int each = 0; each < 3; ++each) {
    out.axis = each;
    double sum_n2 = 0.0;
    for (const double force_n : run_precisely(out, {"remote_virtual_coupling"}).force_n) sum_n2 += force_n * force_n;
    if (sum_n2 > most_n2) most_n2 = sum_n2, axis = each;
  }
  out.axis = axis;
  if (most_n2 <= 0.0) {
    throw rtbus::config::Error(options.own_file + ": its hand feels nothing within " +
                               formatted("%g", options.seconds) +
                               " s, so there is no error to compare; give the device a hand that touches something, "
                               "or raise --seconds");
  }
  return out;
}

PrecisionScene soft_scene(const WorkPrecisionOptions& options) {
  std::vector<std::string> device{"haptic.0.device=devices/sim_phantom_desktop_push.yaml"};
  // Down onto its back and 17 mm in, as in evaluate soft; the four others are not there.
  append(device, push("[-0.01, 0.01, 0]", "[0, -1, 0]", 0.027, 0.05, kBegin_s));
  PrecisionScene out = scene("soft", options.soft_file, device,
                             {formatted("haptic.0.coupling.stiffness_n_per_m=%.17g", kSoftStiffness),
                              formatted("haptic.0.coupling.damping_n_s_per_m=%.17g", kWallDamping)},
                             options);
  out.assignments.insert(out.assignments.begin(), kOneRabbit);
  out.from_s = kBegin_s;
  out.until_s = 2.0;
  out.at_rest = false;
  out.engine_hz = {500, 2000, 4000};
  return out;
}

Reference wall_reference(const PrecisionScene& scene) {
  WallParameters p;
  p.stiffness_n_per_m = kWallStiffness;
  p.damping_n_s_per_m = kWallDamping;
  p.hand_stiffness_n_per_m = kHandStiffness;
  p.hand_damping_n_s_per_m = kHandDamping;
  p.hand_mass_kg = kHandMass_kg;
  std::vector<HandPage> hand{{0.0, {kTouch_m, 0.0, 0.0, 0.0, 0.0}}};
  for (HandPage page : push_pages(kTouch_m, -kWay_m, kSpeed_m_s, kRamp_s)) {
    page.begin_s += kBegin_s;
    hand.push_back(page);
  }
  auto solution = std::make_shared<WallSolution>(p, kTouch_m, hand, scene.until_s);
  return [solution](double time_s) {
    const WallMoment at = solution->at(time_s);
    return ReferencePoint{at.height_m, at.force_n};
  };
}

Reference drop_reference(const PrecisionScene& scene) {
  WallParameters p;
  p.stiffness_n_per_m = kDropStiffness;
  p.damping_n_s_per_m = kDropDamping;
  auto solution = std::make_shared<WallSolution>(p, kTouch_m, std::vector<HandPage>{}, scene.until_s - kRelease_s);
  return [solution](double time_s) {
    const WallMoment at = solution->at(time_s - kRelease_s);
    return ReferencePoint{at.height_m, at.force_n};
  };
}

}  // namespace tools
