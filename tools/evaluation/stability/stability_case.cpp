#include "tools/evaluation/stability/stability_case.hpp"
#include "tools/cli/common/formatted.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdarg>
#include <cstdio>

namespace tools {

namespace {

constexpr double kBoxEdgeM = 0.02;  // of a moving body, at scale 1
constexpr double kRampS = 0.02;
constexpr double kMarginM = 0.001;  // of a soft body
constexpr double kPlateRiseM = 0.005, kPlateMoveS = 1.0;
constexpr double kSecondHandM = 0.002;  // it presses the block that far, at first
constexpr double kGravityMS2 = 9.81;
constexpr double kWedgeUnitM = 1e-3, kWedgeDepthM = 0.03, kWedgeMiddleM = 0.04 / 3.0;  // of wedge.obj
constexpr double kTableHeight = 5.0;                                                   // edges

std::string hand_map(const StabilityCase& each) {
  const char* const impedance = each.hand == StabilityHand::kSoft ? "light" : "firm";
  const double start_s = each.start_s();
  switch (each.task) {
    case StabilityTask::kDrop:
      return formatted("{type: drop, position_m: [0, %.9g, 0], release_s: %.9g}", each.height_m, start_s);
    case StabilityTask::kDeep:
      if (each.hand == StabilityHand::kNone) return "{type: none}";
      return formatted("{type: hold, position_m: [0, %.9g, 0], impedance: %s}", -each.depth_m, impedance);
    case StabilityTask::kFree:
      return formatted(
          "{type: push, start_m: [-0.02, 0.015, -0.01], direction: [1, 0.3, 0.5], distance_m: %.9g, "
          "speed_m_s: %.9g, start_s: %.9g, ramp_s: %g, impedance: %s}",
          each.height_m, each.speed_m_s, start_s, kRampS, impedance);
    case StabilityTask::kBlock:
    case StabilityTask::kSecondHand:
    case StabilityTask::kTip:
    case StabilityTask::kTable:
      return formatted(
          "{type: push, start_m: [0, 0, %.9g], direction: [0, 0, -1], distance_m: %.9g, speed_m_s: %.9g, "
          "start_s: %.9g, ramp_s: %g, impedance: %s}",
          each.height_m, each.height_m + each.depth_m, each.speed_m_s, start_s, kRampS, impedance);
    case StabilityTask::kFall:
      if (each.hand == StabilityHand::kNone) break;
      return formatted("{type: hold, position_m: [0, %.9g, 0], impedance: %s}", each.height_m, impedance);
    case StabilityTask::kPress:
    case StabilityTask::kRub:
    case StabilityTask::kStack:
    case StabilityTask::kSoft:
    case StabilityTask::kPlate:
      break;
  }
  if (each.hand == StabilityHand::kNone) {
    return formatted("{type: drop, position_m: [0, %.9g, 0], release_s: %.9g}", each.height_m, start_s);
  }
  const double aside = each.task == StabilityTask::kRub ? 1.0 : 0.0;
  const double way_m = (each.height_m + each.depth_m) * std::hypot(1.0, aside);
  return formatted(
      "{type: push, start_m: [%.9g, %.9g, 0], direction: [%g, -1, 0], distance_m: %.9g, speed_m_s: %.9g, "
      "start_s: %.9g, ramp_s: %g, impedance: %s}",
      -0.5 * aside * each.height_m, each.height_m, aside, way_m, each.speed_m_s, start_s, kRampS, impedance);
}

/// The proxy has a radius where bodies move, and on hulls and meshes; its surface is at the hand's zero.
double radius_m(const StabilityCase& each) {
  if (each.task == StabilityTask::kSoft) return 0.35 * kBoxEdgeM;  // as large as the meshes of the skin
  return each.needs_bullet() ? std::min(1.0, 0.25 * kBoxEdgeM * each.scale) : 0.0;
}

/// config/scenes/meshes, in millimetres and metres; beside the session's file.
std::string wedge(double scale) {
  return formatted("convex_hull: {file: scenes/meshes/wedge.obj, metres_per_unit: %.9g}", kWedgeUnitM * scale);
}
std::string hill(double scale) {
  return formatted("mesh: {file: scenes/meshes/hill.obj, metres_per_unit: %.9g}", scale);
}

std::string box_shape(double x_m, double y_m, double z_m) {
  return formatted("box: {size_m: [%.9g, %.9g, %.9g]}", x_m, y_m, z_m);
}

std::string dynamic_body(const char* name, double mass_kg, const std::string& shape, double x_m, double y_m, double z_m,
                         double friction) {
  return formatted(", {name: %s, type: dynamic, mass_kg: %.9g, shape: {", name, mass_kg) + shape +
         formatted("}, position_m: [%.9g, %.9g, %.9g], friction: %.9g}", x_m, y_m, z_m, friction);
}

/// Of what kBlock and kSecondHand push, along z.
double pushed_depth_m(const StabilityCase& each) {
  return each.body == StabilityBody::kHull ? kWedgeDepthM * each.scale : kBoxEdgeM * each.scale;
}

std::string pushed_body(const StabilityCase& each, double edge_m) {
  const double mass_kg = each.proxy_kg * each.body_ratio;
  const double z_m = -0.5 * pushed_depth_m(each) - radius_m(each);
  if (each.task == StabilityTask::kTip) {
    return dynamic_body("box0", mass_kg, box_shape(2.0 * edge_m, 4.0 * edge_m, edge_m), 0.0, 2.0 * edge_m, z_m,
                        each.friction);
  }
  if (each.body == StabilityBody::kBall) {
    return dynamic_body("box0", mass_kg, formatted("sphere: {radius_m: %.9g}", 0.5 * edge_m), 0.0, 0.5 * edge_m, z_m,
                        each.friction);
  }
  if (each.body == StabilityBody::kHull) {
    return dynamic_body("box0", mass_kg, wedge(each.scale), -kWedgeMiddleM * each.scale, 0.0, z_m, each.friction);
  }
  return dynamic_body("box0", mass_kg, box_shape(2.0 * edge_m, edge_m, edge_m), 0.0, 0.5 * edge_m, z_m, each.friction);
}

/// A body that falls comes down at speed_m_s on a tip that is held, or lies, at its height.
std::string falling_body(const StabilityCase& each, double edge_m) {
  const double drop_m = 0.5 * each.speed_m_s * each.speed_m_s / kGravityMS2;
  const double y_m = (each.height_m + drop_m) * each.scale + 2.0 * radius_m(each) + 0.5 * edge_m;
  const bool ball = each.body == StabilityBody::kBall;
  return dynamic_body(
      "block", each.proxy_kg * each.body_ratio,
      ball ? formatted("sphere: {radius_m: %.9g}", 0.5 * edge_m) : box_shape(2.0 * edge_m, edge_m, edge_m), 0.0, y_m,
      0.0, each.friction);
}

/// Up when the hand has come to it, down again, and then it stays.
std::string plate(const StabilityCase& each) {
  const double s = each.scale, thick_m = kBoxEdgeM * s, from_s = each.start_s() + each.way_s();
  const auto point = [&](double time_s, double rise_m) {
    return formatted("{time_s: %.9g, position_m: [0, %.9g, 0]}", time_s, rise_m * s - 0.5 * thick_m);
  };
  return formatted(
             ", {name: plate, type: kinematic, shape: {box: {size_m: [%.9g, %.9g, %.9g]}}, position_m: [0, %.9g, 0], "
             "friction: %.9g, motion: {waypoints: {points: [",
             5.0 * thick_m, thick_m, 5.0 * thick_m, -0.5 * thick_m, each.friction) +
         point(from_s, 0.0) + ", " + point(from_s + kPlateMoveS, kPlateRiseM) + ", " +
         point(from_s + 2.0 * kPlateMoveS, 0.0) + "]}}}";
}

/// One ball on the floor.
std::string soft_body(const StabilityCase& each) {
  const StabilityCase::SoftMaterial& m = each.soft;
  return formatted(
      "], soft_bodies: [{name: ball, mesh: {ball: {radius_m: %.9g, nodes: %d}}, position_m: [0, %.9g, 0], mass_kg: "
      "%.9g, "
      "linear_stiffness: %.9g, pose_matching_hz: %.9g, bulk_modulus_pa: %.9g, damping_per_s: %.9g, friction: %.9g, "
      "margin_m: %g, position_iterations: %d}",
      kBoxEdgeM, m.nodes, kBoxEdgeM + kMarginM, each.proxy_kg * each.body_ratio, m.linear_stiffness, m.pose_matching_hz,
      m.bulk_modulus_pa, m.damping_per_s, each.friction, kMarginM, m.iterations);
}

std::string scene_map(const StabilityCase& each) {
  const double s = each.scale;
  const double edge_m = kBoxEdgeM * s;
  const char* const head = "{schema: scene/1, gravity_m_s2: [0, %.9g, 0], bodies: [";
  // A world of another size has the gravity that feels the same, as far as a scene may have it.
  std::string out = formatted(head, -std::min(kGravityMS2 * s, 100.0));
  if (each.moves_bodies()) {
    double floor_m = 0.0;
    if (each.task == StabilityTask::kPlate) floor_m = -0.2 * s;
    if (each.task == StabilityTask::kTable) floor_m = -kTableHeight * edge_m;
    out += formatted("{name: floor, type: static, shape: {plane: {}}, position_m: [0, %.9g, 0], friction: %.9g}",
                     floor_m, std::max(0.2, each.friction));
    if (each.task == StabilityTask::kPlate) return out + plate(each) + "]}";
    if (each.task == StabilityTask::kSoft) return out + soft_body(each) + "]}";
    if (each.task == StabilityTask::kFall) return out + falling_body(each, edge_m) + "]}";
    if (each.task == StabilityTask::kTable) {
      // A part of the block is beyond its edge already.
      const double deep_m = 5.0 * edge_m, end_m = -radius_m(each) - 0.7 * edge_m;
      out += ", {name: table, type: static, shape: {" + box_shape(20.0 * edge_m, kTableHeight * edge_m, deep_m) +
             formatted("}, position_m: [0, %.9g, %.9g], friction: %.9g}", -0.5 * kTableHeight * edge_m,
                       end_m + 0.5 * deep_m, std::max(0.2, each.friction));
    }
    if (each.along_z()) return out + pushed_body(each, edge_m) + "]}";
    for (int i = 0; i < each.boxes; ++i) {
      const double mass_kg = i % 2 == 0 ? each.proxy_kg * each.body_ratio : each.proxy_kg;
      out += dynamic_body(formatted("box%d", i).c_str(), mass_kg, box_shape(2.0 * edge_m, edge_m, edge_m), 0.0,
                          (i + 0.5) * edge_m, 0.0, each.friction);
    }
    return out + "]}";
  }
  std::string shape = "plane: {}";
  double x_m = 0.0, y_m = 0.0;
  if (each.shape == StabilityShape::kSphere) {
    shape = formatted("sphere: {radius_m: %.9g}", 0.05 * s);
    y_m = -0.05 * s;
  } else if (each.shape == StabilityShape::kBox) {
    shape = box_shape(0.1 * s, 0.1 * s, 0.1 * s);
    y_m = -0.05 * s;
  } else if (each.shape == StabilityShape::kHull) {
    shape = wedge(s);
    x_m = -0.01 * s;  // there it is 15 mm high
    y_m = -0.015 * s;
  } else if (each.shape == StabilityShape::kMesh) {
    shape = hill(s);
    y_m = -0.015 * s;
  }
  return out + formatted("{name: wall, type: static, shape: {%s}, position_m: [%.9g, %.9g, 0], friction: %.9g}]}",
                         shape.c_str(), x_m, y_m, each.friction);
}

std::string soft_text(const StabilityCase& each) {
  if (each.task != StabilityTask::kSoft) return {};
  const StabilityCase::SoftMaterial& m = each.soft;
  return formatted(
      ", soft ball of %d nodes, links %.3g, matching %.3g Hz, bulk %.3g Pa, damping %.3g /s, %d iterations", m.nodes,
      m.linear_stiffness, m.pose_matching_hz, m.bulk_modulus_pa, m.damping_per_s, m.iterations);
}

std::string shape_text(const StabilityCase& each) {
  if (!each.moves_bodies()) return formatted(", %s", to_string(each.shape));
  return each.body == StabilityBody::kBox ? "" : formatted(", %s", to_string(each.body));
}

std::string network_text(const NetworkOptions& network) {
  if (!network.exists()) return {};
  return formatted(", round trip %.4g ms, jitter %.2g, lost %.2g in bursts of %.3g ms%s", network.round_trip_s * 1e3,
                   network.jitter_share, network.lost_share, network.burst_s * 1e3,
                   network.reorder ? "" : ", in order");
}

std::string mapping_map(const StabilityCase& each) {
  const double edge_m = kBoxEdgeM * each.scale;
  double y_m = 0.0;
  if (each.along_z()) y_m = (each.task == StabilityTask::kTip ? 3.5 : 0.5) * edge_m;
  if (each.shape >= StabilityShape::kHull) y_m = radius_m(each);
  if (each.task == StabilityTask::kPlate) y_m = radius_m(each);
  if (each.task == StabilityTask::kStack) y_m = each.boxes * edge_m + radius_m(each);
  if (each.task == StabilityTask::kFall) y_m = radius_m(each);
  if (each.task == StabilityTask::kSoft) y_m = 2.0 * (kBoxEdgeM + kMarginM) + radius_m(each);
  return formatted("{position_scale: %.9g, offset_m: [0, %.9g, 0]}", each.scale, y_m);
}

}  // namespace

const char* to_string(StabilityTask task) noexcept {
  constexpr std::array names{"drop", "press", "rub",   "free",        "deep", "block", "stack",
                             "fall", "soft",  "plate", "second_hand", "tip",  "table"};
  return names[static_cast<std::size_t>(task)];
}

const char* to_string(StabilityShape shape) noexcept {
  constexpr std::array names{"plane", "sphere", "box", "hull", "mesh"};
  return names[static_cast<std::size_t>(shape)];
}

const char* to_string(StabilityBody body) noexcept {
  constexpr std::array names{"box", "ball", "hull"};
  return names[static_cast<std::size_t>(body)];
}

const char* to_string(StabilityHand hand) noexcept {
  constexpr std::array names{"none", "soft", "stiff"};
  return names[static_cast<std::size_t>(hand)];
}

double StabilityCase::way_s() const noexcept { return (height_m + depth_m) * 1.5 / std::max(speed_m_s, 1e-3) + kRampS; }

double StabilityCase::end_s() const noexcept {
  double motion_s = way_s();
  if (task == StabilityTask::kPlate) motion_s += 2.0 * kPlateMoveS;
  if (task == StabilityTask::kDeep) motion_s = depth_m / 0.1;  // physics moves the proxy out at 0.1 m/s
  if (hand == StabilityHand::kNone && task != StabilityTask::kDeep) {
    motion_s = std::sqrt(2.0 * height_m / kGravityMS2) + 0.2;
  }
  if (task == StabilityTask::kFall) motion_s = std::max(motion_s, speed_m_s / kGravityMS2 - start_s() + 0.3);
  const double pause_s = std::max(loop_pause_s, physics_pause_s);
  return start_s() + motion_s + (pause_s > 0.0 ? pause_s + 0.3 : 0.0) + 3.0 / physics_hz + 2.0 * longest_round_trip_s();
}

namespace {

std::string device_map(const StabilityCase& each, const std::string& start, const std::string& hand) {
  const std::string limits = each.stiff_device ? ", limits: {max_stiffness_n_per_m: 20000, max_slew_n_per_ms: 30}" : "";
  return formatted("{schema: device/1, driver: simulated, model: %s, mechanics: {position_quantum_m: %.9g}%s%s, hand: ",
                   StabilityEnvelope::kDevice, each.quantum_m, limits.c_str(), start.c_str()) +
         hand + "}";
}

std::string coupling_map(const StabilityCase& each) {
  return formatted("{stiffness_n_per_m: %.9g, damping_n_s_per_m: %.9g}", each.stiffness_n_per_m,
                   each.damping_n_s_per_m);
}

std::string proxy_map(const StabilityCase& each) {
  return formatted("{mass_kg: %.9g, radius_m: %.9g}", each.proxy_kg, radius_m(each));
}

/// On the far side of the block; where its device is at z = 0, it touches the block.
std::string second_hand(const StabilityCase& each) {
  const double edge_m = kBoxEdgeM * each.scale;
  const std::string hold = formatted(
      "{type: push, start_m: [0, 0, -0.005], direction: [0, 0, 1], distance_m: %.9g, "
      "speed_m_s: 0.05, start_s: %.9g, ramp_s: %g, impedance: %s}",
      0.005 + kSecondHandM, each.start_s(), kRampS, each.hand == StabilityHand::kSoft ? "light" : "firm");
  const std::string method =
      each.method == StabilityEnvelope::kDefault ? "" : formatted(", method: %s", each.method.c_str());
  return formatted("{name: second, rate_hz: %.9g%s, coupling: ", each.haptic_hz, method.c_str()) + coupling_map(each) +
         ", proxy: " + proxy_map(each) +
         formatted(", mapping: {position_scale: %.9g, offset_m: [0, %.9g, %.9g]}, device: ", each.scale, 0.5 * edge_m,
                   -pushed_depth_m(each) - 2.0 * radius_m(each)) +
         device_map(each, "", hold) + "}";
}

}  // namespace

std::vector<std::string> assignments_of(const StabilityCase& each) {
  std::vector<std::string> out;
  out.push_back("scene=" + scene_map(each));
  const bool two = each.task == StabilityTask::kSecondHand;
  if (two || each.method == StabilityEnvelope::kDefault) {  // the session's file names a method
    out.push_back("haptic=[{name: haptic0, device: devices/sim_phantom_desktop.yaml}" +
                  (two ? ", " + second_hand(each) : "") + "]");
  }
  const double step_hz = each.paper ? std::clamp(each.physics_hz, 15.0, each.haptic_hz) : each.physics_hz;
  if (each.needs_bullet()) {
    out.emplace_back("physics.engine=bullet");
    out.push_back(formatted("physics.solver_iterations=%d", each.solver_iterations));
  }
  out.push_back(
      formatted("physics.rate_hz=%.9g", std::max(each.task == StabilityTask::kSoft ? 500.0 : 1000.0, step_hz)));
  if (each.paper) {
    out.emplace_back("haptic.0.form=paper");
    out.push_back(formatted("haptic.0.link_rate_hz=%.9g", step_hz));
  } else {
    out.push_back(formatted("physics.throttle_hz=%.9g", each.physics_hz));
  }
  const std::string start = each.task == StabilityTask::kDeep && each.hand == StabilityHand::kNone
                                ? formatted(", start_position_m: [0, %.9g, 0]", -each.depth_m)
                                : "";
  out.push_back("haptic.0.device=" + device_map(each, start, hand_map(each)));
  out.push_back(formatted("haptic.0.rate_hz=%.9g", each.haptic_hz));
  if (each.method != StabilityEnvelope::kDefault) out.push_back("haptic.0.method=" + each.method);
  out.push_back("haptic.0.coupling=" + coupling_map(each));
  out.push_back("haptic.0.proxy=" + proxy_map(each));
  out.push_back("haptic.0.mapping=" + mapping_map(each));
  return out;
}

HarnessOptions link_of(const StabilityCase& each) {
  HarnessOptions out;
  out.physics_phase_s = each.phase / each.physics_hz;
  out.jitter_s = each.jitter_s;
  out.lost_share = each.lost_share;
  out.link_seed = each.seed + 1;
  out.network = each.network;
  out.passivity = each.bounds || each.damps;
  out.energy_bound = each.bounds;
  out.energy_damper = each.damps;
  out.echo_lag = each.lags;
  const double middle_s = each.start_s() + 0.25;
  if (each.loop_pause_s > 0.0) {
    out.loop_stops_s = middle_s;
    out.loop_pause_s = each.loop_pause_s;
  }
  if (each.physics_pause_s > 0.0) {
    out.physics_dies_s = middle_s;
    out.physics_returns_s = middle_s + each.physics_pause_s;
  }
  return out;
}

StabilityCase direct_reference(const StabilityCase& each, double stiffness_n_per_m, double damping_n_s_per_m) {
  StabilityCase out = each;
  out.method = "direct";
  out.paper = false;
  out.haptic_hz = 10000.0;
  out.stiffness_n_per_m = stiffness_n_per_m;
  out.damping_n_s_per_m = damping_n_s_per_m;
  out.stiff_device = true;
  out.jitter_s = out.lost_share = out.loop_pause_s = out.physics_pause_s = 0.0;
  return out;
}

std::string describe(const StabilityCase& each) {
  return formatted(
      "%s%s %s hand %s: K %.4g N/m, B %.3g N s/m, physics %.4g Hz, loop %.5g Hz, proxy %.3g kg, body x%.3g, "
      "friction %.2f, quantum %.3g um, scale %.3g, %.2g m/s, height %.3g mm, depth %.3g mm, jitter %.3g ms, lost "
      "%.2g, pauses %.3g/%.3g s%s",
      each.method.c_str(), each.paper ? " (paper)" : "", to_string(each.task), to_string(each.hand),
      each.stiffness_n_per_m, each.damping_n_s_per_m, each.physics_hz, each.haptic_hz, each.proxy_kg, each.body_ratio,
      each.friction, each.quantum_m * 1e6, each.scale, each.speed_m_s, each.height_m * 1e3, each.depth_m * 1e3,
      each.jitter_s * 1e3, each.lost_share, each.loop_pause_s, each.physics_pause_s,
      (shape_text(each) + soft_text(each) + network_text(each.network) + (each.envelope ? ", in the envelope" : ""))
          .c_str());
}

}  // namespace tools
