#include "rtbus/config/shared_keys.hpp"

#include <string>

namespace rtbus::config {

LinkConfig read_link_config(Map& entry) {
  LinkConfig out;
  out.paper = entry.choice("form", {"improved", "paper"}, "improved") == "paper";
  const std::string link = entry.choice("link", {"bus", "pipe", "dds"}, "bus");
  out.pipe = link == "pipe";
  out.dds = link == "dds";
  if (out.paper) out.rate_hz = kPaperLinkRate_hz;
  // The lower bound keeps a packet younger than the silence after which physics gives a hand up (100 ms).
  if (entry.has("link_rate_hz")) out.rate_hz = entry.number("link_rate_hz", {15.0, 10000.0});
  if (out.dds) {
    out.round_trip_s = entry.number("link_round_trip_ms", {1e3 * LinkConfig::kLeastRoundTrip_s, 2000.0}, 200.0) * 1e-3;
  }
  if (!out.dds && entry.has("link_round_trip_ms")) {
    entry.fail("link_round_trip_ms", "is for link: dds, where physics is on another machine; leave it out");
  }
  if (out.pipe && !out.rate_hz) {
    entry.fail("link", "needs link_rate_hz: a pipe is fed by a thread of its own, so many times a second; add it");
  }
  return out;
}

StepRateConfig read_step_rate(Map& physics) {
  StepRateConfig out;
  out.rate_hz = physics.number("rate_hz", {1.0, 20000.0}, out.rate_hz);
  if (physics.has("throttle_hz")) out.throttle_hz = physics.number("throttle_hz", {0.5, 1000.0});
  return out;
}

bool simulates_the_scene(Map& physics) { return physics.text("engine", "") != "external"; }

double read_coupling_stiffness(Map& coupling) { return coupling.number("stiffness_n_per_m", {0.0, 1e5}); }

ProxyBodyConfig read_proxy_body(Map& proxy) {
  ProxyBodyConfig out;
  out.mass_kg = proxy.number("mass_kg", {0.001, 100.0}, out.mass_kg);
  out.radius_m = proxy.number("radius_m", {0.0, 1.0}, out.radius_m);
  return out;
}

std::optional<int> read_core(Map& realtime) {
  if (!realtime.has("core")) return -1;
  const std::string core = realtime.text("core");
  if (core == "auto") return -1;
  if (core.empty() || core.size() > 4 || core.find_first_not_of("0123456789") != std::string::npos) return std::nullopt;
  return std::stoi(core);
}

}  // namespace rtbus::config
