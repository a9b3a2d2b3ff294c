#include "haptic_node/node_config.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <numbers>

#include "haptic_node/rendering/registry.hpp"

namespace haptic {

namespace {

using rtbus::config::Map;

/// Hand speed that the slew limit must be able to follow on the stiffest spring (docs/safety.md).
constexpr double kSlewHandSpeed_m_s = 0.6;
/// A sampled spring on the bare tip is stable while K·T² is a small part of its mass (K < (b + B)/(T/2) is stricter and
/// is what passivity watches): a tenth leaves a phase of 18 degrees per period.
constexpr double kStiffnessPerMassRate2 = 0.1;
/// A sampled damper is stable for B·T < 2m without a filter; the velocity filter adds its own delay 1/(2π·cutoff).
constexpr double kDampingPerMassRate = 0.25;
/// The coupling has a fifth: one encoder step of a tip at rest then makes less than 0.05 N on the stiffest spring of a
/// Desktop.
constexpr double kCouplingDampingPerMassRate = 0.2;
/// Least damping ratio ζ of the tip on a coupling whose other end follows slowly. The corners of the set-point's line,
/// one per period T of physics, reach the tip's own frequency f with sinc²(π·f·T) of their size and are amplified there
/// by 1/(2ζ): half of this keeps them smaller than what made them wherever 1/T is below 1.5·f; the other half is for a
/// tip that moves, which dry friction does not calm (decision 0009).
constexpr double kLeastDampingRatio = 0.2, kSlowPhysics = 1.5;
/// What the passivity damper may make of one encoder step.
constexpr double kDamperNoise_n = 0.05;
/// `local_contact` holds (docs/results.md) for bodies down to this part of the tip's mass as the world sees it.
constexpr double kLightestBody = 0.01;
/// More shapes than these cost `direct` more than some microseconds in a tick.
constexpr std::size_t kMaxDirectShapes = 32;

std::string format_number(double value) {
  char text[32];
  std::snprintf(text, sizeof text, "%.6g", value);
  return text;
}

Eigen::Vector3d to_vector(const std::vector<double>& v) { return {v[0], v[1], v[2]}; }
Eigen::Vector3d to_vector(const drivers::Vec3& v) { return {v[0], v[1], v[2]}; }

void read_mapping(Map& entry, HapticConfig& out) {
  auto map = entry.optional_map("mapping");
  if (!map) return;
  const auto q = map->numbers("rotation_wxyz", 4, {-1.0, 1.0}, {1.0, 0.0, 0.0, 0.0});
  const Eigen::Quaterniond rotation(q[0], q[1], q[2], q[3]);
  if (std::abs(rotation.norm() - 1.0) > 1e-3) {
    map->fail("rotation_wxyz", "is not a unit quaternion (w, x, y, z): its norm is " + format_number(rotation.norm()));
  }
  out.mapping.q_WD = rotation.normalized();
  out.mapping.offset_m = to_vector(map->numbers("offset_m", 3, {-1e3, 1e3}, {0.0, 0.0, 0.0}));
  out.mapping.position_scale = map->number("position_scale", {1e-3, 1e3}, 1.0);
  out.mapping.force_scale = map->number("force_scale", {1e-3, 1e3}, 1.0 / out.mapping.position_scale);
  if (map->has("clutch_button")) out.clutch_button = static_cast<int>(map->integer("clutch_button", 0, 31, 0));
  map->finish();
}

void read_safety(Map& entry, HapticConfig& out) {
  const drivers::DeviceInfo& device = out.device->info();
  SafetyConfig& safety = out.safety;
  safety.max_force_n = device.max_force_n;
  safety.continuous_force_n = std::min(device.continuous_force_n, device.max_force_n);
  safety.thermal_time_constant_s = device.thermal_time_constant_s;
  safety.slew_n_per_ms = device.max_slew_n_per_ms;
  safety.overspeed_m_s = device.max_speed_m_s;
  // 2·K·v in N/s: less would make the wall itself slew-limited at ordinary speeds.
  const double slew_floor_n_per_ms = 2.0 * out.stiffness_n_per_m * kSlewHandSpeed_m_s * 1e-3;

  if (auto map = entry.optional_map("safety")) {
    safety.max_force_n = map->number("max_force_n", {0.0, 1e3}, safety.max_force_n);
    if (safety.max_force_n > device.max_force_n) {
      map->fail("max_force_n", "exceeds " + format_number(device.max_force_n) + " N, the limit of " + device.model +
                                   "; lower it or leave it out");
    }
    safety.continuous_force_n = std::min(safety.continuous_force_n, safety.max_force_n);
    safety.slew_n_per_ms = map->number("slew_n_per_ms", {1e-3, 1e3}, safety.slew_n_per_ms);
    if (safety.slew_n_per_ms > device.max_slew_n_per_ms) {
      map->fail("slew_n_per_ms", "exceeds " + format_number(device.max_slew_n_per_ms) + " N/ms, the limit of " +
                                     device.model + "; lower it or leave it out");
    }
    if (safety.slew_n_per_ms < slew_floor_n_per_ms * (1.0 - 1e-9)) {
      map->fail("slew_n_per_ms", "is below 2*K*v = " + format_number(slew_floor_n_per_ms) +
                                     " N/ms for K = " + format_number(out.stiffness_n_per_m) +
                                     " N/m and a hand at 0.6 m/s: the wall would lag; raise it or lower the stiffness");
    }
    safety.start_ramp_s = map->number("start_ramp_ms", {50.0, 1e4}, 200.0) * 1e-3;
    safety.resume_ramp_s = map->number("resume_ramp_ms", {10.0, 1e4}, 100.0) * 1e-3;
    safety.overspeed_m_s =
        map->number("overspeed_m_s", {std::min(0.1, device.max_speed_m_s), device.max_speed_m_s}, safety.overspeed_m_s);
    safety.stale_fade_s = map->number("stale_fade_ms", {0.0, 40.0}, 40.0) * 1e-3;
    out.link.loss_timeout_s = map->number("loss_timeout_ms", {25.0, 60.0}, 55.0) * 1e-3;
    map->finish();
  }
  safety.stiffness_n_per_m = out.stiffness_n_per_m;
  safety.force_timeout_s = device.force_timeout_s;

  PassivityConfig& passivity = safety.passivity;
  // A spring of this stiffness cannot hold more than this: at the force limit, or stretched across the workspace.
  const double workspace_m = (to_vector(device.workspace_max_m) - to_vector(device.workspace_min_m)).norm();
  passivity.reservoir_max_j =
      std::min(safety.max_force_n * safety.max_force_n / (2.0 * std::max(out.stiffness_n_per_m, 1e-9)),
               0.5 * out.stiffness_n_per_m * workspace_m * workspace_m);
  // A law without a spring stores nothing, and still may not give what it has not got.
  passivity.debt_floor_j = safety.max_force_n * 1e-3;
  // A tenth of m/T: the injected damper stays well inside its own sampled-data limit (2m/T) and its noise small.
  // One encoder step must not make more of it than anybody feels.
  const double noise_m_s = device.position_quantum_m * 2.0 * std::numbers::pi * out.velocity_cutoff_hz;
  passivity.damping_max_n_s_per_m =
      std::min(0.1 * device.apparent_mass_kg * out.rate_hz, kDamperNoise_n / std::max(noise_m_s, 1e-9));
  passivity.stiffness_n_per_m = out.stiffness_n_per_m;
  passivity.books_world = find_renderer(out.method)->books_world;
  passivity.noise_speed_m_s = 2.0 * noise_m_s;
  passivity.allowance_n_s_per_m = kDampingPerMassRate * device.apparent_mass_kg * out.rate_hz;
  passivity.viscous_damping_n_s_per_m = device.viscous_damping_n_s_per_m;
  passivity.coulomb_friction_n = device.coulomb_friction_n;
  passivity.position_quantum_m = device.position_quantum_m;
  // The published methods had no such controller, and an experiment that shows their divergence must not have one
  // either. On a device that somebody may hold it stays, whatever the form.
  passivity.control = !(out.wire.paper && device.simulated);
}

/// Without `method`: the most exact one that the session allows. The pipe carries no contacts, and what the paper does
/// not have cannot be as the paper has it. Two hands that hold one body are springs to each other, which neither of
/// their local worlds knows; a body that is very light beside the tip is thrown by the impulses of one step of physics;
/// and soft ones give way twice as much in the loop as they do (decision 0008), which no rate of physics mends.
const char* default_method(const rtbus::config::SessionConfig& session, const rtbus::config::LinkConfig& wire,
                           double tip_mass_kg) {
  if (!session.physics) return "direct";
  const auto& bodies = session.scene.bodies;
  const bool light = std::any_of(bodies.begin(), bodies.end(), [tip_mass_kg](const auto& body) {
    return body.mass_kg > 0.0 && body.mass_kg < kLightestBody * tip_mass_kg;
  });
  const bool soft = !session.scene.soft_bodies.empty();
  return wire.paper || wire.pipe || session.haptic.size() > 1 || light || soft ? "remote_virtual_coupling"
                                                                               : "local_contact";
}

void read_method(Map& entry, const RendererEntry& method, HapticConfig& out) {
  if (out.wire.rate_hz && *out.wire.rate_hz > out.rate_hz) {
    entry.fail("link_rate_hz", "is above rate_hz = " + format_number(out.rate_hz) +
                                   " Hz: there is no newer state of the hand to send; lower it or leave it out");
  }
  if (out.wire.pipe && !method.needs_physics) {
    entry.fail("link", "has no physics at its other end: method " + out.method + " needs none; leave it out");
  }
  if (method.needs_contacts && out.wire.paper) {
    entry.fail("form", "is not for method " + out.method + ", which the paper does not have; leave it out");
  }
  if (method.needs_contacts && out.wire.pipe) {
    entry.fail("link", "carries no contacts, which method " + out.method + " needs; use bus");
  }
  // One period of the ramp and half a period of age: what lies between the sampling of a hand and the force.
  out.prediction_periods = entry.number("prediction_periods", {0.0, 10.0}, 1.5);
  if (method.server_force != ServerForce::kPredicted) out.prediction_periods = 0.0;
  if (auto proxy = entry.optional_map("proxy"); proxy && !method.needs_physics) {
    out.proxy_mass_kg = proxy->number("mass_kg", {0.001, 100.0}, out.proxy_mass_kg);  // physics reads the rest
  }
}

void read_realtime(Map& entry, HapticConfig& out) {
  auto map = entry.optional_map("realtime");
  if (!map) return;
  out.realtime_enforce = map->choice("policy", {"warn", "enforce"}, "warn") == "enforce";
  out.realtime.priority = static_cast<int>(map->integer("priority", 1, 98, 80));
  if (map->has("core")) {
    // "auto" or a CPU number.
    const std::string core = map->text("core");
    if (core != "auto") {
      if (core.empty() || core.size() > 4 || core.find_first_not_of("0123456789") != std::string::npos) {
        map->fail("core", "is neither auto nor a CPU number");
      }
      out.realtime.core = std::stoi(core);
    }
  }
  out.realtime.lock_memory = map->boolean("lock_memory", true);
  out.realtime.hold_dma_latency = map->boolean("hold_dma_latency", true);
  out.spin_s = map->number("spin_us", {0.0, 200.0}, 0.0) * 1e-6;
  if (out.spin_s * out.rate_hz > 0.5) {
    map->fail("spin_us", "is more than half the period of the loop; lower it, or the core does nothing else");
  }
  map->finish();
}

/// Of the steps of physics, as the session declares them.
double physics_hz(rtbus::config::SessionConfig& session) {
  if (!session.physics) return 0.0;
  const double rate_hz = session.physics->number("rate_hz", {1.0, 20000.0}, 1000.0);
  return session.physics->has("throttle_hz") ? std::min(rate_hz, session.physics->number("throttle_hz", {0.5, 1000.0}))
                                             : rate_hz;
}

/// Of the two that are made for it, as improved: does the loop damp against something slower than itself?
bool slow_link(const RendererEntry& method, const HapticConfig& config, double physics_rate_hz) {
  return (method.books_world || method.needs_contacts) && !config.wire.paper && physics_rate_hz < config.rate_hz;
}

/// Without it the set-point of a slow physics, which moves in straight lines, rings the tip at each corner.
double damping_floor_n_s_per_m(const RendererEntry& method, const HapticConfig& config, double physics_rate_hz) {
  if (!method.books_world || config.wire.paper) return 0.0;
  const double mass_kg = config.device->info().apparent_mass_kg;
  const double own_hz = std::sqrt(config.stiffness_n_per_m / mass_kg) / (2.0 * std::numbers::pi);
  if (physics_rate_hz >= kSlowPhysics * own_hz) return 0.0;
  return 2.0 * kLeastDampingRatio * std::sqrt(config.stiffness_n_per_m * mass_kg);
}

}  // namespace

std::uint64_t HapticConfig::period_ns() const noexcept {
  return static_cast<std::uint64_t>(std::llround(1e9 / rate_hz));
}

double HapticConfig::passive_stiffness_n_per_m() const noexcept {
  return 2.0 * (device->info().viscous_damping_n_s_per_m - std::abs(damping_n_s_per_m)) * rate_hz;
}

HapticConfig read_haptic_config(rtbus::config::SessionConfig& session, std::size_t index) {
  Map& entry = session.haptic.at(index).map;
  HapticConfig out;
  out.name = session.haptic.at(index).name;
  (void)entry.has("name");

  auto device_file = entry.file_or_map("device");
  out.device = drivers::parse_device(device_file);
  const drivers::DeviceInfo& device = out.device->info();

  // Two free-running clocks cost up to a tick of delay, and with it stiffness: a USB device paces unless told
  // otherwise.
  const bool paces = out.device->uses_usb() && device.can_pace_loop;
  out.rate_hz = entry.number("rate_hz", {500.0, 10000.0}, paces ? device.sample_rate_hz : 1000.0);
  out.clock = entry.choice("clock", {"timer", "device"}, paces ? "device" : "timer") == "device" ? LoopClock::kDevice
                                                                                                 : LoopClock::kTimer;
  if (out.clock == LoopClock::kDevice && !device.can_pace_loop) {
    entry.fail("clock", "needs a device that wakes the loop, which " + device.model + " does not; use timer");
  }
  if (out.clock == LoopClock::kDevice && out.rate_hz != device.sample_rate_hz) {
    entry.fail("rate_hz", "differs from " + format_number(device.sample_rate_hz) + " Hz, at which " + device.model +
                              " samples and so, with clock: device, paces the loop; make them equal");
  }

  read_mapping(entry, out);
  out.wire = rtbus::config::read_link_config(entry);
  const double tip_mass_kg = device.apparent_mass_kg * out.mapping.force_scale / out.mapping.position_scale;
  std::vector<std::string> methods;
  for (const RendererEntry& row : registered_renderers()) methods.emplace_back(row.name);
  out.method = entry.choice("method", methods, default_method(session, out.wire, tip_mass_kg));
  const RendererEntry* method = find_renderer(out.method);
  if (method->needs_physics && !session.physics) {
    entry.fail("method", "needs physics, and the session has no physics section; add one, or use direct");
  }
  out.shapes = session.scene.static_shapes();
  if (!method->needs_physics && out.shapes.empty()) {
    entry.fail("method", "finds its surface by itself, but the scene has no static plane, sphere or box");
  }

  if (!method->needs_physics && out.shapes.size() > kMaxDirectShapes) {
    entry.fail("method", "looks at every shape in every cycle and takes at most " + std::to_string(kMaxDirectShapes) +
                             "; the scene has " + std::to_string(out.shapes.size()) + ": use remote_virtual_coupling");
  }

  read_method(entry, *method, out);

  out.velocity.adaptive =
      entry.choice("velocity_estimator", {"low_pass", "adaptive_window"},
                   slow_link(*method, out, physics_hz(session)) ? "adaptive_window" : "low_pass") == "adaptive_window";
  out.velocity.quantum_m = device.position_quantum_m;
  out.velocity_cutoff_hz = entry.number("velocity_cutoff_hz", {10.0, 5000.0}, 100.0);
  out.velocity.cutoff_hz = out.velocity_cutoff_hz;
  auto coupling = entry.map("coupling");
  out.stiffness_requested_n_per_m = coupling.number("stiffness_n_per_m", {0.0, 1e5});
  out.damping_requested_n_s_per_m = coupling.number("damping_n_s_per_m", {0.0, 1e3}, 0.0);
  coupling.finish();
  // What device, rate and slew limit cannot carry is lowered, not refused: the same session runs on every device.
  out.stiffness_n_per_m = std::min({out.stiffness_requested_n_per_m, device.max_stiffness_n_per_m,
                                    kStiffnessPerMassRate2 * device.apparent_mass_kg * out.rate_hz * out.rate_hz,
                                    device.max_slew_n_per_ms * 1e3 / (2.0 * kSlewHandSpeed_m_s)});
  out.damping_n_s_per_m =
      std::min(std::max(out.damping_requested_n_s_per_m, damping_floor_n_s_per_m(*method, out, physics_hz(session))),
               kCouplingDampingPerMassRate * device.apparent_mass_kg *
                   std::min(out.rate_hz, 2.0 * std::numbers::pi * out.velocity_cutoff_hz));

  if (entry.has("enable_button")) out.enable_button = static_cast<int>(entry.integer("enable_button", 0, 31, 0));
  if (out.enable_button >= 0 && out.enable_button == out.clutch_button) {
    entry.fail("enable_button", "is also mapping.clutch_button; give them different buttons");
  }
  read_safety(entry, out);
  read_realtime(entry, out);
  (void)entry.optional_map("proxy");  // physics reads it
  entry.finish();
  return out;
}

}  // namespace haptic
