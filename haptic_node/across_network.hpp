#pragma once
/// @file across_network.hpp
/// What a haptic node changes when its physics is at the other end of a network.
#include <algorithm>
#include <cmath>

#include "haptic_node/link_monitor.hpp"
#include "haptic_node/node_config.hpp"
#include "haptic_node/rendering/registry.hpp"

namespace haptic {

/// Where the set-point comes from physics, damping as with slow physics (decision 0011), however fast its steps are:
/// what the tip does on its spring is answered a round trip later. And the set-point lags (echo.hpp). @param
/// round_trip_s The longest of the network.
inline void damp_across_network(HapticConfig& config, double round_trip_s) {
  config.wire.round_trip_s = round_trip_s;
  GainLimits& limits = config.gain_limits;
  if (!config.wire.over_network() || !std::isfinite(limits.set_points_per_s)) return;
  constexpr double kSteps = 2.0;  // half of one that is waited for, one, and half of the line to what it said
  config.set_point_delay_s = round_trip_s + kSteps / limits.set_points_per_s;
  // Damped wherever it lags at all: from 0.93·√(m/K) of delay on, where the proxy is light.
  constexpr double kEcho = 4.5;
  limits.set_points_per_s = std::min(limits.set_points_per_s, 1.0 / (kEcho * config.set_point_delay_s));
  limits.least_damping_ratio = GainLimits::kEchoDampingRatio;
  const Gains gains = limits.bearable({config.stiffness_requested_n_per_m, config.damping_requested_n_s_per_m});
  config.stiffness_n_per_m = gains.stiffness_n_per_m;
  config.damping_n_s_per_m = gains.damping_n_s_per_m;
}

/// The same, and limits of age that know the round trip.
inline void put_across_network(HapticConfig& config, double round_trip_s) {
  config.link = across_network(config.link, round_trip_s);
  damp_across_network(config, round_trip_s);
}

/// Two hands at one body with a method that simulates it where the hand is: each hears of the other a round trip late,
/// and meanwhile both push a body that nobody holds (decision 0021).
[[nodiscard]] inline bool refused_across_network(const MethodEntry& method, std::size_t hands) noexcept {
  return method.needs_contacts && hands > 1;
}

}  // namespace haptic
