#include "haptic_node/node_config.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>
#include <numbers>
#include <optional>

#include "haptic_node/across_network.hpp"
#include "haptic_node/config_warnings.hpp"
#include "haptic_node/rendering/registry.hpp"
#include "rtbus/config/vector3.hpp"
#include "rtbus/eigen.hpp"

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
/// What the passivity damper, or the allowance of the energy limit, may make of one encoder step.
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

/// `rate_hz` and `clock`. Two free-running clocks cost up to a tick of delay, and with it stiffness: a USB device paces
/// unless told otherwise.
void read_clock(Map& entry, HapticConfig& out) {
  const drivers::DeviceInfo& device = out.device->info();
  const bool paces = out.device->has_link() && device.can_pace_loop;
  out.rate_hz = entry.number("rate_hz", {500.0, 10000.0}, paces ? device.sample_rate_hz : 1000.0);
  const bool by_device = entry.choice("clock", {"timer", "device"}, paces ? "device" : "timer") == "device";
  out.clock = by_device ? LoopClock::kDevice : LoopClock::kTimer;
  if (!by_device) return;
  if (!device.can_pace_loop) {
    entry.fail("clock", "needs a device that wakes the loop, which " + device.model + " does not; use timer");
  }
  if (out.rate_hz != device.sample_rate_hz) {
    entry.fail("rate_hz", "differs from " + format_number(device.sample_rate_hz) + " Hz, at which " + device.model +
                              " samples and so, with clock: device, paces the loop; make them equal");
  }
}

void read_mapping(Map& entry, HapticConfig& out) {
  auto map = entry.optional_map("mapping");
  if (!map) return;
  const auto q = map->numbers("rotation_wxyz", 4, {-1.0, 1.0}, {1.0, 0.0, 0.0, 0.0});
  const Eigen::Quaterniond rotation(q[0], q[1], q[2], q[3]);
  if (std::abs(rotation.norm() - 1.0) > 1e-3) {
    map->fail("rotation_wxyz", "is not a unit quaternion (w, x, y, z): its norm is " + format_number(rotation.norm()));
  }
  out.mapping.q_WD = rotation.normalized();
  out.mapping.offset_m = read_vector3(*map, "offset_m", {-1e3, 1e3}, {0.0, 0.0, 0.0});
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
    out.gain_limits.stiffness_max_n_per_m =
        std::min(out.gain_limits.stiffness_max_n_per_m, safety.slew_n_per_ms * 1e3 / (2.0 * kSlewHandSpeed_m_s));
    safety.start_ramp_s = map->number("start_ramp_ms", {50.0, 1e4}, 200.0) * 1e-3;
    safety.resume_ramp_s = map->number("resume_ramp_ms", {10.0, 1e4}, 100.0) * 1e-3;
    safety.overspeed_m_s =
        map->number("overspeed_m_s", {std::min(0.1, device.max_speed_m_s), device.max_speed_m_s}, safety.overspeed_m_s);
    safety.stale_fade_s = map->number("stale_fade_ms", {0.0, 40.0}, 40.0) * 1e-3;
    out.link.loss_timeout_s = map->number("loss_timeout_ms", {25.0, 60.0}, 55.0) * 1e-3;
    map->finish();
  }
  if (out.wire.dds) out.link = across_network(out.link, out.wire.round_trip_s);
  safety.stiffness_n_per_m = out.stiffness_n_per_m;
  safety.damping_n_s_per_m = out.damping_n_s_per_m;
  safety.period_s = 1.0 / out.rate_hz;
  safety.force_timeout_s = device.force_timeout_s;

  PassivityConfig& passivity = safety.passivity;
  safety.workspace_m = (rtbus::vector_of(device.workspace_max_m) - rtbus::vector_of(device.workspace_min_m)).norm();
  passivity.energy_cap_j = safety.energy_cap_j();
  // A method without a spring stores nothing, and still may not give what it has not got.
  passivity.deficit_floor_j = safety.max_force_n * 1e-3;
  // A tenth of m/T: the injected damper stays well inside its own sampled-data limit (2m/T) and its noise small.
  // One encoder step must not make more of it than anybody feels.
  const double noise_m_s = device.position_quantum_m * 2.0 * std::numbers::pi * out.velocity_cutoff_hz;
  passivity.damping_max_n_s_per_m =
      std::min(0.1 * device.apparent_mass_kg * out.rate_hz, kDamperNoise_n / std::max(noise_m_s, 1e-9));
  passivity.stiffness_n_per_m = out.stiffness_n_per_m;
  passivity.counts_world_work = find_method(out.method)->counts_world_work;
  passivity.noise_speed_m_s = 2.0 * noise_m_s;
  safety.allowance_most_n_s_per_m = kDampingPerMassRate * device.apparent_mass_kg * out.rate_hz;
  safety.allowance_least_n_s_per_m =
      std::min(safety.allowance_most_n_s_per_m, kDamperNoise_n / std::max(noise_m_s, 1e-9));
  passivity.allowance_n_s_per_m = safety.allowance_n_s_per_m();
  passivity.viscous_damping_n_s_per_m = device.viscous_damping_n_s_per_m;
  passivity.coulomb_friction_n = device.coulomb_friction_n;
  passivity.position_quantum_m = device.position_quantum_m;
  // The published methods had no such controller, and an experiment that shows their divergence must not have one
  // either. On a device that somebody may hold it stays, whatever the form.
  passivity.control = !(out.wire.paper && device.simulated);
}

/// Without `method`: the most exact one that the session allows. The pipe carries no contacts, and what the paper does
/// not have cannot be as the paper has it. A body that is very light beside the tip is thrown by the impulses of one
/// step of physics, but not by the engine bullet, where a bed of such bodies yields (World::drive_tool). Hands on
/// several machines know of each other through physics alone, a round trip late.
const char* default_method(rtbus::config::SessionConfig& session, const rtbus::config::LinkConfig& wire,
                           double tip_mass_kg) {
  if (!session.physics) return "direct";
  const auto& bodies = session.scene.bodies;
  const bool yields = session.physics->text("engine", "") == "bullet";
  const bool light = !yields && std::any_of(bodies.begin(), bodies.end(), [tip_mass_kg](const auto& body) {
    return body.mass_kg > 0.0 && body.mass_kg < kLightestBody * tip_mass_kg;
  });
  const bool far_hands = wire.dds && refused_across_network(*find_method("local_contact"), session.haptic.size());
  return wire.paper || wire.pipe || far_hands || light ? "remote_virtual_coupling" : "local_contact";
}

/// Keys of the link and of some methods, and what does not go together. @param hands Of the session.
void read_method_keys(Map& entry, const MethodEntry& method, std::size_t hands, HapticConfig& out) {
  if (out.wire.rate_hz && *out.wire.rate_hz > out.rate_hz) {
    entry.fail("link_rate_hz", "is above rate_hz = " + format_number(out.rate_hz) +
                                   " Hz: there is no newer state of the hand to send; lower it or leave it out");
  }
  if ((out.wire.pipe || out.wire.dds) && !method.needs_physics) {
    entry.fail("link", "has no physics at its other end: method " + out.method + " needs none; leave it out");
  }
  if (method.needs_contacts && out.wire.paper) {
    entry.fail("form", "is not for method " + out.method + ", which the paper does not have; leave it out");
  }
  if (method.needs_contacts && out.wire.pipe) {
    entry.fail("link", "carries no contacts, which method " + out.method + " needs; use bus");
  }
  if (out.wire.dds && refused_across_network(method, hands)) {
    entry.fail("method",
               "does not carry several hands over a network: each would hear of the others a round trip late, "
               "and they would lose what they hold; leave it out, or use remote_virtual_coupling");
  }
  // One period of the ramp and half a period of age: what lies between the sampling of a hand and the force.
  out.prediction_periods = entry.number("prediction_periods", {0.0, 10.0}, 1.5);
  if (method.server_force != ServerForce::kPredicted) out.prediction_periods = 0.0;
}

/// `form`, `link`, `method` and what depends on them.
void read_method(Map& entry, rtbus::config::SessionConfig& session, HapticConfig& out) {
  out.wire = rtbus::config::read_link_config(entry);
  const double tip_mass_kg = out.device->info().apparent_mass_kg * out.mapping.gain_to_world();
  std::vector<std::string> methods;
  for (const MethodEntry& row : registered_methods()) methods.emplace_back(row.name);
  out.method = entry.choice("method", methods, default_method(session, out.wire, tip_mass_kg));
  const MethodEntry& method = *find_method(out.method);
  if (method.needs_physics && !session.physics) {
    entry.fail("method", "needs physics, and the session has no physics section; add one, or use direct");
  }
  out.shapes = session.scene.static_shapes();
  if (method.needs_contacts && rtbus::config::simulates_the_scene(*session.physics)) {
    out.known = session.scene.known_shapes();
    if (session.physics->text("engine", "") == "mujoco") {  // which tells such a hull in axes of its own
      std::erase_if(out.known, [](const auto& each) {
        return !each.stands && std::holds_alternative<rtbus::shapes::Hull>(each.shape);
      });
    }
    if (!out.known.empty()) out.shape_hash = session.scene.shape_hash();
  }
  if (!method.needs_physics && out.shapes.empty()) {
    entry.fail("method", "finds its surface by itself, but the scene has no static plane, sphere or box");
  }
  if (!method.needs_physics && out.shapes.size() > kMaxDirectShapes) {
    entry.fail("method", "looks at every shape in every cycle and takes at most " + std::to_string(kMaxDirectShapes) +
                             "; the scene has " + std::to_string(out.shapes.size()) + ": use remote_virtual_coupling");
  }
  read_method_keys(entry, method, session.haptic.size(), out);
}

void read_realtime(Map& entry, HapticConfig& out) {
  auto map = entry.optional_map("realtime");
  if (!map) return;
  out.realtime_enforce = map->choice("policy", {"warn", "enforce"}, "warn") == "enforce";
  out.realtime.priority = static_cast<int>(map->integer("priority", 1, 98, 80));
  const std::optional<int> core = rtbus::config::read_core(*map);
  if (!core) map->fail("core", "is neither auto nor a CPU number");
  out.realtime.core = *core;
  out.realtime.lock_memory = map->boolean("lock_memory", true);
  out.realtime.hold_dma_latency = map->boolean("hold_dma_latency", true);
  out.spin_s = map->number("spin_us", {0.0, 200.0}, 0.0) * 1e-6;
  if (out.spin_s * out.rate_hz > 0.5) {
    map->fail("spin_us", "is more than half the period of the loop; lower it, or the core does nothing else");
  }
  map->finish();
}

/// Of the two that are made for it, as improved: does the loop damp against something slower than itself?
bool slow_link(const MethodEntry& method, const HapticConfig& config, double physics_rate_hz) {
  return (method.counts_world_work || method.needs_contacts) && !config.wire.paper && physics_rate_hz < config.rate_hz;
}

/// @param steps_per_s Of physics; 0: the session has none.
void read_velocity(Map& entry, double steps_per_s, HapticConfig& out) {
  const char* const usual = slow_link(*find_method(out.method), out, steps_per_s) ? "adaptive_window" : "low_pass";
  const std::string estimator = entry.choice("velocity_estimator", {"low_pass", "adaptive_window", "device"}, usual);
  out.velocity.adaptive = estimator == "adaptive_window";
  out.velocity.of_device = estimator == "device";
  if (out.velocity.of_device && !out.device->info().measures_velocity) {
    entry.fail("velocity_estimator", "needs a device that measures its velocity, and " + out.device->info().model +
                                         " does not (docs/devices.md); use adaptive_window or low_pass");
  }
  out.velocity.quantum_m = out.device->info().position_quantum_m;
  out.velocity_cutoff_hz = entry.number("velocity_cutoff_hz", {10.0, 5000.0}, 100.0);
  out.velocity.cutoff_hz = out.velocity_cutoff_hz;
}

/// What device, rate and slew limit cannot carry is lowered, not refused: the same session runs on every device.
/// @param steps_per_s Likewise.
void read_coupling(Map& entry, double steps_per_s, HapticConfig& out) {
  auto coupling = entry.map("coupling");
  out.stiffness_requested_n_per_m = rtbus::config::read_coupling_stiffness(coupling);
  out.damping_requested_n_s_per_m = coupling.number("damping_n_s_per_m", {0.0, 1e3}, 0.0);
  coupling.finish();
  const drivers::DeviceInfo& device = out.device->info();
  GainLimits& limits = out.gain_limits;
  limits.stiffness_max_n_per_m = std::min({device.max_stiffness_n_per_m,
                                           kStiffnessPerMassRate2 * device.apparent_mass_kg * out.rate_hz * out.rate_hz,
                                           device.max_slew_n_per_ms * 1e3 / (2.0 * kSlewHandSpeed_m_s)});
  limits.damping_max_n_s_per_m = kCouplingDampingPerMassRate * device.apparent_mass_kg *
                                 std::min(out.rate_hz, 2.0 * std::numbers::pi * out.velocity_cutoff_hz);
  limits.tip_mass_kg = device.apparent_mass_kg;
  const bool rings = find_method(out.method)->counts_world_work && !out.wire.paper;
  limits.set_points_per_s = rings ? steps_per_s : std::numeric_limits<double>::infinity();
  const Gains gains = limits.bearable({out.stiffness_requested_n_per_m, out.damping_requested_n_s_per_m});
  out.stiffness_n_per_m = gains.stiffness_n_per_m;
  out.damping_n_s_per_m = gains.damping_n_s_per_m;
}

/// After the mapping, which has the clutch's button.
void read_buttons(Map& entry, HapticConfig& out) {
  if (entry.has("enable_button")) {
    out.enable_button = static_cast<int>(entry.integer("enable_button", 0, 31, 0));
    if (out.enable_button == out.clutch_button) {
      entry.fail("enable_button", "is also mapping.clutch_button; give them different buttons");
    }
  }
  if (entry.has("estop_button")) {
    out.estop_button = static_cast<int>(entry.integer("estop_button", 0, 31, 0));
    if (out.estop_button == out.clutch_button || out.estop_button == out.enable_button) {
      entry.fail("estop_button", "is also the button of the clutch or of enable; give them different buttons");
    }
  }
}

/// Which gains a running session may change. What `coupling` does not do in a method cannot be adjusted.
void read_adjustable(Map& entry, HapticConfig& out) {
  for (const std::string& key :
       entry.choices("adjustable", {"coupling.stiffness_n_per_m", "coupling.damping_n_s_per_m"})) {
    (key == "coupling.stiffness_n_per_m" ? out.adjustable_stiffness : out.adjustable_damping) = true;
  }
}

/// After the safety limits: a force of an order is one of those that they bound.
void read_extra_force(Map& entry, HapticConfig& out) {
  out.extra_force_max_n = entry.number("extra_force_max_n", {0.0, out.safety.max_force_n}, 0.0);
}

/// After the coupling: beyond its stiffness the energy limit of the ladder would hold the walls back.
void read_workspace_walls(Map& entry, HapticConfig& out) {
  auto map = entry.optional_map("workspace_walls");
  if (!map) return;
  WorkspaceWalls& walls = out.walls;
  const auto at_most = [&](const char* key, double asked, double most) {
    if (asked <= most) return asked;
    out.warnings.push_back(map->sentence(key, "is lowered to " + format_number(most) + ", that of the coupling as " +
                                                  out.device->info().model + " bears it; lower it, or raise coupling." +
                                                  key + " where the device allows"));
    return most;
  };
  walls.stiffness_n_per_m =
      at_most("stiffness_n_per_m", map->number("stiffness_n_per_m", {1.0, 5000.0}, 200.0), out.stiffness_n_per_m);
  walls.damping_n_s_per_m =
      at_most("damping_n_s_per_m", map->number("damping_n_s_per_m", {0.0, 10.0}, 0.0), out.damping_n_s_per_m);
  const double margin_m = map->number("margin_m", {0.0, 0.1}, 0.010);
  const drivers::DeviceInfo& device = out.device->info();
  for (std::size_t i = 0; i < 3; ++i) {
    walls.min_m[i] = device.workspace_min_m[i] + margin_m;
    walls.max_m[i] = device.workspace_max_m[i] - margin_m;
    if (walls.min_m[i] >= walls.max_m[i]) {
      map->fail("margin_m", "leaves no room between the walls of the " +
                                format_number(device.workspace_max_m[i] - device.workspace_min_m[i]) + " m that " +
                                device.model + " has; lower it");
    }
  }
  map->finish();
}

}  // namespace

bool HapticConfig::asks_physics() const noexcept { return find_method(method)->needs_physics; }

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

  read_clock(entry, out);
  read_mapping(entry, out);
  read_method(entry, session, out);
  if (find_method(out.method)->needs_contacts && !out.wire.dds) {
    for (std::size_t i = 0; i < session.haptic.size(); ++i) {
      if (i == index) continue;
      // Of one on another machine the samples come late, and have other stamps.
      if (rtbus::config::read_link_config(session.haptic[i].map).dds) continue;
      out.other_hands.push_back({static_cast<std::uint32_t>(i), session.haptic[i].name});
    }
  }
  const double steps_per_s = session.physics ? rtbus::config::read_step_rate(*session.physics).steps_per_s() : 0.0;
  read_velocity(entry, steps_per_s, out);
  read_coupling(entry, steps_per_s, out);
  if (out.wire.dds) damp_across_network(out, out.wire.round_trip_s);
  read_buttons(entry, out);
  read_adjustable(entry, out);
  read_workspace_walls(entry, out);
  read_safety(entry, out);
  read_extra_force(entry, out);
  read_realtime(entry, out);
  if (auto proxy = entry.optional_map("proxy"))
    out.proxy = rtbus::config::read_proxy_body(*proxy);  // physics reads the rest
  entry.finish();
  for (std::string& warning : config_warnings(out, session, index)) out.warnings.push_back(std::move(warning));
  return out;
}

}  // namespace haptic
