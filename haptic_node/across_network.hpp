#pragma once
/// @file across_network.hpp
/// What a haptic node changes when its physics is at the other end of a network.
#include <algorithm>
#include <cmath>

#include "haptic_node/link_monitor.hpp"
#include "haptic_node/node_config.hpp"

namespace haptic {

/// Where the set-point comes from physics, damping as with slow physics (decision 0011), however fast its steps are:
/// what the tip does on its spring is answered a round trip later. And the set-point lags (echo.hpp). @param
/// round_trip_s The longest of the network.
inline void damp_across_network(HapticConfig& config, double round_trip_s) {
  config.wire.round_trip_s = round_trip_s;
  GainLimits& limits = config.gain_limits;
  if (round_trip_s <= 0.0 || !std::isfinite(limits.set_points_per_s)) return;
  limits.set_points_per_s = std::min(limits.set_points_per_s, 1.0 / round_trip_s);
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

}  // namespace haptic
