#pragma once
/// @file blend.hpp
/// How what an answer changes is brought in: not at once.
#include <algorithm>
#include <cmath>

#include "haptic_node/rendering/tuning.hpp"

namespace haptic {

/// One body's blend: what is left of a difference after `seconds` is 1/e of it; of one in the velocity of a surface,
/// after `velocity_s`.
struct Blend {
  double seconds = 0.0;
  double velocity_s = seconds;

  /// What comes of an answer of a period of `step_s`. A velocity is there when the next one comes: what ticks make of
  /// it and each answer takes back would add up, and drag the hand along.
  [[nodiscard]] static Blend of(const Tuning& tuning, double step_s) noexcept {
    const double seconds = std::max(tuning.blend_floor_s, tuning.blend_periods * step_s);
    return {seconds, std::min(step_s, seconds)};
  }
  /// What an answer changes in the force of what yields, which no surface brings in. What a light body rattles is
  /// averaged where the hand rests.
  [[nodiscard]] static Blend of_yielding(const Tuning& tuning, double step_s, bool hand_rests) noexcept {
    const double least_s = hand_rests ? tuning.resting_blend_s() : tuning.blend_floor_s;
    return {std::max(least_s, tuning.yielding_blend_periods * step_s)};
  }
  /// What an answer moves in a pile is a prediction put right.
  [[nodiscard]] static Blend of_pile(const Tuning& tuning, double step_s) noexcept {
    return {std::max(tuning.blend_floor_s, tuning.slow_blend_periods * step_s)};
  }
  /// So it is with what rocks on an edge.
  [[nodiscard]] static Blend of_rocking(const Tuning& tuning, double step_s) noexcept {
    return {std::max(tuning.noise_s, tuning.slow_blend_periods * step_s)};
  }
  /// What is lighter than the proxy in a tick swings on the hand's spring faster than answers come: what they say of an
  /// instant is noise.
  [[nodiscard]] static Blend of_light_at_rest(const Tuning& tuning, double step_s) noexcept {
    return {std::max(tuning.noise_s, tuning.blend_periods * step_s)};
  }
  /// Over a network, with a body that the hand pushes. Jitter makes the world take the hand's impulses unevenly, so a
  /// body is now a little ahead and now a little behind; what the hand does about it comes back a round trip later.
  /// @param age_s Of the answer.
  [[nodiscard]] Blend over_network(double age_s) const noexcept { return {std::max(seconds, kNetworkAges * age_s)}; }
  static constexpr double kNetworkAges = 3.0;

  /// What is brought in within a step, as a share of what is left.
  [[nodiscard]] double share(double h) const noexcept { return -std::expm1(-h / seconds); }
  /// What is left of a difference in velocity after a step.
  [[nodiscard]] double velocity_left(double h) const noexcept { return std::exp(-h / velocity_s); }
};

}  // namespace haptic
