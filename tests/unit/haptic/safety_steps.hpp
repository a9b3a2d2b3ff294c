#pragma once
/// @file safety_steps.hpp
/// A ladder of a PHANToM Desktop, cycle by cycle.
#include <cstdint>

#include <Eigen/Core>

#include "haptic_node/safety.hpp"

namespace safety_steps {

using haptic::SafetyConfig;
using haptic::SafetyInput;
using haptic::SafetyLadder;
using haptic::SafetyOutput;

inline constexpr double kDt_s = 1e-3;

inline SafetyConfig desktop() {
  SafetyConfig config;
  config.max_force_n = 7.9;
  config.continuous_force_n = 1.75;
  config.slew_n_per_ms = 3.0;
  config.start_ramp_s = 0.2;
  config.passivity.energy_cap_j = 0.1;
  config.passivity.damping_max_n_s_per_m = 4.0;
  return config;
}

inline SafetyInput healthy(const Eigen::Vector3d& force_n) {
  SafetyInput input;
  input.force_n = force_n;
  input.dt_s = kDt_s;
  input.enabled = input.link_alive = input.device_ok = true;
  return input;
}

/// One cycle, `ticks` periods after the last one.
inline SafetyOutput step(SafetyLadder& ladder, SafetyInput input, std::uint64_t ticks = 1) {
  static std::uint64_t now_ns = 1'000'000'000;
  now_ns += ticks * 1'000'000;
  input.now_ns = input.sample_time_ns = now_ns;
  return ladder.apply(input);
}

/// A ladder whose start ramp is over.
inline SafetyLadder opened(const SafetyConfig& config = desktop()) {
  SafetyLadder ladder(config);
  for (int k = 0; k < 1000; ++k) (void)step(ladder, healthy(Eigen::Vector3d::Zero()));
  return ladder;
}

}  // namespace safety_steps
