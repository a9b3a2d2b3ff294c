#include "physics_node/node_config.hpp"

#include <algorithm>
#include <cmath>
#include <string_view>

#include "physics_node/engine_registry.hpp"
#include "rtbus/config/overlap.hpp"
#include "rtbus/config/vector3.hpp"

namespace physics {
namespace {

using rtbus::config::Map;

/// More parts than this in one step is a slip of a digit: even the cheapest engine would need a tenth of a second.
constexpr double kMaxPartsPerStep = 100'000.0;

/// `realtime.core` of a haptic entry; its own reader says what is wrong with it.
int haptic_core(rtbus::config::HapticEntry& entry) {
  auto realtime = entry.map.optional_map("realtime");
  return realtime ? rtbus::config::read_core(*realtime).value_or(-1) : -1;
}

}  // namespace

int PhysicsConfig::parts_per_step() const noexcept {
  // 1000 / 18 parts are 56, 1000 / 50 are 20: the small allowance keeps rounding from making them 21.
  const double periods = std::max(1.0, std::ceil(rate_hz / steps_per_s() - 1e-9));
  return static_cast<int>(periods) * substeps;
}

double PhysicsConfig::steps_per_s() const noexcept {
  const double wanted = packet_rate_hz.value_or(rate_hz);
  return throttle_hz ? std::min(*throttle_hz, wanted) : wanted;
}

const char* PhysicsConfig::clock() const noexcept {
  if (pace == Pace::kFree) return "free";
  if (packet_rate_hz) return "packets";
  return throttle_hz ? "throttled" : "fixed";
}

PhysicsConfig read_physics_config(Map& map, const rtbus::config::LinkConfig& wire) {
  PhysicsConfig config;
  config.engine = map.choice("engine", engine_names(), config.engine);
  if (map.choice("pace", {"fixed", "free"}, "fixed") == "free") config.pace = Pace::kFree;
  const rtbus::config::StepRateConfig steps = rtbus::config::read_step_rate(map);
  config.rate_hz = steps.rate_hz;
  config.throttle_hz = steps.throttle_hz;
  config.substeps = static_cast<int>(map.integer("substeps", 1, 1000, config.substeps));
  config.solver_iterations = static_cast<int>(map.integer("solver_iterations", 1, 1000, config.solver_iterations));
  config.contacts_always = map.choice("contacts", {"auto", "on"}, "auto") == "on";
  if (map.has("contact_radius_m")) config.contact_radius_m = map.number("contact_radius_m", {1e-6, 10.0});
  config.command = map.texts("command");
  if (!config.command.empty() && config.engine != kExternalEngine) {
    map.fail("command", "starts a physics of your own, which engine: external names; write that, or leave it out");
  }
  if (config.throttle_hz && *config.throttle_hz > config.rate_hz) {
    map.fail("throttle_hz", "is above physics.rate_hz: a throttle slows the steps down; lower it or leave it out");
  }
  if (config.throttle_hz && config.pace == Pace::kFree) {
    map.fail("throttle_hz", "slows the steps down, which pace: free lets run; leave out one of them");
  }
  const bool on_packet = map.choice("step_on", {"clock", "packet"}, wire.paper ? "packet" : "clock") == "packet";
  if (on_packet && config.pace == Pace::kFree) {
    map.fail("pace", "lets steps run back to back, and step_on: packet lets them wait; use step_on: clock with it");
  }
  if (on_packet && !wire.rate_hz) {
    map.fail("step_on", "needs to know how many packets come: give the first haptic entry a link_rate_hz");
  }
  if (wire.pipe && !on_packet) {
    map.fail("step_on", "does not go with link: pipe, at which physics waits for packets; use packet");
  }
  if (on_packet) config.packet_rate_hz = wire.rate_hz;
  const double parts = std::max(1.0, config.rate_hz / config.steps_per_s()) * config.substeps;
  if (parts > kMaxPartsPerStep) {
    map.fail("substeps", "cuts each step into more than 100000 parts; lower substeps or rate_hz");
  }
  map.finish();
  return config;
}

ProxyConfig read_proxy_config(rtbus::config::HapticEntry& entry) {
  ProxyConfig config;
  config.device = entry.name;
  config.wire = rtbus::config::read_link_config(entry.map);
  config.rate_hz = entry.map.number("rate_hz", {500.0, 10000.0}, config.rate_hz);
  bool has_stiffness = false;
  if (auto proxy = entry.map.optional_map("proxy")) {
    const rtbus::config::ProxyBodyConfig body = rtbus::config::read_proxy_body(*proxy);
    config.mass_kg = body.mass_kg;
    config.radius_m = body.radius_m;
    config.friction = proxy->number("friction", {0.0, 10.0}, config.friction);
    has_stiffness = proxy->has("stiffness_n_per_m");
    if (has_stiffness) config.stiffness_n_per_m = proxy->number("stiffness_n_per_m", {0.1, 1e5});
    if (proxy->has("damping_n_s_per_m")) config.damping_n_s_per_m = proxy->number("damping_n_s_per_m", {0.0, 1e4});
    config.lead_steps = proxy->number("lead_steps", {0.0, 2.0}, config.lead_steps);
    config.position_m = rtbus::config::read_vector3(*proxy, "position_m", {-1000.0, 1000.0}, {0.0, 0.0, 0.0});
    proxy->finish();
  }
  if (!has_stiffness) {
    Map coupling = entry.map.map("coupling");
    config.stiffness_n_per_m = rtbus::config::read_coupling_stiffness(coupling);
    if (config.stiffness_n_per_m < 0.1) {
      coupling.fail("stiffness_n_per_m",
                    "would leave the proxy where it is, for proxy.stiffness_n_per_m follows it; "
                    "give the proxy a stiffness of its own, 0.1 N/m or more");
    }
  }
  return config;
}

NodeConfig read_node_config(rtbus::config::SessionConfig& session) {
  if (!session.physics) {
    throw rtbus::config::Error(session.file +
                               ": the session has no physics map, so there is nothing to simulate; add "
                               "'physics: {engine: analytic}' or start the haptic node alone");
  }
  NodeConfig config{session.session, session.scene, {}, {}, {}, session.file, overlap_warnings(session.scene)};
  config.physics = read_physics_config(*session.physics, rtbus::config::read_link_config(session.haptic.at(0).map));
  for (rtbus::config::HapticEntry& entry : session.haptic) {
    config.proxies.push_back(read_proxy_config(entry));
    config.haptic_cores.push_back(haptic_core(entry));
    if (config.proxies.back().wire.pipe != config.proxies.front().wire.pipe) {
      entry.map.fail("link", "differs from that of the first haptic entry; physics serves all by pipe or none");
    }
  }
  return config;
}

}  // namespace physics
