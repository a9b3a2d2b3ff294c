#pragma once
/// @file plant_state.hpp
/// What a plant tells of its mechanics.
#include <cstdint>

#include "drivers/simulated/mechanics.hpp"
#include "rtbus/eigen.hpp"
#include "rtbus/messages.hpp"

namespace drivers::simulated {

/// As the simulated plant tells it.
[[nodiscard]] inline rtbus::PlantState state_of(const Mechanics& mechanics, std::uint64_t now_ns) {
  rtbus::PlantState out;
  out.position_m = out.true_position_m = rtbus::array_of(mechanics.position_m());
  out.true_velocity_m_s = rtbus::array_of(mechanics.velocity_m_s());
  out.applied_force_n = rtbus::array_of(mechanics.applied_force_n());
  out.hand_force_n = rtbus::array_of(mechanics.hand_force_n());
  out.sample_time_ns = now_ns;
  out.buttons = mechanics.buttons();
  out.timed_out = mechanics.timed_out() ? 1 : 0;
  return out;
}

}  // namespace drivers::simulated
