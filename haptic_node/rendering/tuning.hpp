#pragma once
/// @file tuning.hpp
/// The values of local_contact that were found by trying, and that its force depends on in common scenes. Constants in
/// its code besides these bound what is rare, each with its reason beside it.
#include <algorithm>
#include <array>
#include <string_view>

namespace haptic {

/// Units are in the table below.
struct Tuning {
  double blend_periods = 0.3;
  double blend_floor_s = 0.01;
  double yielding_blend_periods = 0.45;
  double slow_blend_periods = 2.4;
  double noise_s = 0.03;
  double recovery_m_s = 0.2;
  double least_proxy_m = 0.25e-3;
  double support_softness = 0.02;
  double pile_own_speed_m_s = 5e-3;
  double pile_mobility_s = 0.2e-3;
  double sweeps = 12.0;
  double row_budget = 100.0;
  double parts = 8.0;
  double longest_part_s = 1e-3;
  double good_periods = 2.0;
  double good_besides_s = 3e-3;
  double way_out_s = 0.5;
  double same_contact_cosine = 0.5;
  double same_plane_cosine = 0.95;
  double fast_look_m_s = 1.0;

  /// Answers are at most one period older than they are good for: so far back the hand impulses are known.
  [[nodiscard]] constexpr double history_periods() const noexcept { return good_periods + 1.0; }
  /// As long as anything is remembered, and then as long as an answer is good.
  [[nodiscard]] constexpr double way_out_periods() const noexcept { return history_periods() + good_periods; }
  /// Contacts that the proxy misses by more take no part in a step: others push it by less in one tick of 1 ms.
  [[nodiscard]] constexpr double reach_m() const noexcept { return recovery_m_s * 1e-3; }
  /// A hand that is slower rests: no faster than a pile that slips under it.
  [[nodiscard]] constexpr double resting_hand_m_s() const noexcept { return pile_own_speed_m_s; }
  /// A proxy without a size is deep in a body from here on.
  [[nodiscard]] constexpr double deep_m() const noexcept { return 4.0 * least_proxy_m; }
  /// What rests wavers more slowly than what is noise in a moving hand.
  [[nodiscard]] constexpr double resting_mean_s() const noexcept { return 10.0 * noise_s; }
  /// What answers change in it under a hand at rest is brought in three times as fast.
  [[nodiscard]] constexpr double resting_blend_s() const noexcept { return resting_mean_s() / 3.0; }
  [[nodiscard]] constexpr int most_sweeps() const noexcept { return static_cast<int>(sweeps); }
  /// Of bodies that push each other, and of a part of a re-simulation.
  [[nodiscard]] constexpr int together_sweeps() const noexcept { return 2 * most_sweeps(); }
  /// Of bodies that push each other, rows times parts at most; and sweeps of each part, as many as the same time
  /// allows. A row of six needs short parts, in which friction is found where it moves on; a stack of three needs the
  /// sweeps.
  [[nodiscard]] constexpr int together_budget() const noexcept { return 2 * static_cast<int>(row_budget); }
  [[nodiscard]] constexpr int replay_sweeps(int rows_times_parts) const noexcept {
    return std::clamp(most_sweeps() * together_budget() / rows_times_parts, most_sweeps(), together_sweeps());
  }
  [[nodiscard]] constexpr int fewest_sweeps() const noexcept { return static_cast<int>(sweeps) / 3; }
};

/// One row of the table: from `least` to `most` the method works
/// (tests/unit/haptic/tuning_test.cpp).
struct TunedValue {
  std::string_view name;
  double Tuning::*value;
  double least, most;
  std::string_view unit;
  std::string_view why;
  std::string_view source;  ///< A decision, a formula, or what measured it.
};

inline constexpr std::array<TunedValue, 20> kTunedValues{{
    {"blend_periods", &Tuning::blend_periods, 0.15, 0.6, "periods of physics",
     "what an answer changes is brought in before the next one comes, and not at once", "decision 0008, Nothing jumps"},
    {"blend_floor_s", &Tuning::blend_floor_s, 5e-3, 15e-3, "s",
     "where answers come in every tick their noise is averaged; without answers bodies come to rest in three times "
     "that",
     "decision 0008, Nothing jumps"},
    {"yielding_blend_periods", &Tuning::yielding_blend_periods, 0.3, 0.7, "periods of physics",
     "what an answer changes in the force of what yields, which no surface brings in", "decision 0008, Nothing jumps"},
    {"slow_blend_periods", &Tuning::slow_blend_periods, 1.5, 4.0, "periods of physics",
     "of what an answer says of a pile, or of a body on an edge, most is noise", "decision 0008, Piles; Calm"},
    {"noise_s", &Tuning::noise_s, 0.02, 0.05, "s",
     "time over which noise is averaged: the least blend of what rocks, and the mean velocity of the hand",
     "decision 0008, Calm"},
    {"recovery_m_s", &Tuning::recovery_m_s, 0.1, 0.3, "m/s",
     "a surface comes at the hand no faster than that by blending; at least so far it is looked for surfaces",
     "decision 0008, Nothing jumps"},
    {"least_proxy_m", &Tuning::least_proxy_m, 0.1e-3, 0.5e-3, "m",
     "a smaller proxy is held by planes as they are told: ten steps of an encoder of 23 um", "decision 0008, meshes"},
    {"support_softness", &Tuning::support_softness, 0.005, 0.1, "1 (of the body's inverse mass)",
     "supports that face each other must not contradict each other", "decision 0008, Rejected"},
    {"pile_own_speed_m_s", &Tuning::pile_own_speed_m_s, 2e-3, 10e-3, "m/s",
     "a speed of a pile that the hand does not share is a slip that is over by the time it is told",
     "decision 0008, Piles"},
    {"pile_mobility_s", &Tuning::pile_mobility_s, 0.1e-3, 0.3e-3, "s (over a mass: m/s per N)",
     "a pile goes faster by that for more push; with 0.4 and 0.8 ms it is 2 to 4 times as rough",
     "decision 0008, Piles"},
    {"sweeps", &Tuning::sweeps, 8.0, 20.0, "1", "sweeps of a step at most; a third of that at least",
     "decision 0008, Cost"},
    {"row_budget", &Tuning::row_budget, 60.0, 200.0, "rows times sweeps, or times parts", "bounds the time of a tick",
     "decision 0008, Cost"},
    {"parts", &Tuning::parts, 6.0, 16.0, "1",
     "in which a body goes from the answered instant to now, and the proxy along a long way; with one for each 7 ms "
     "alone a third more of the cases oscillate a little",
     "decision 0008, Cost"},
    {"longest_part_s", &Tuning::longest_part_s, 0.5e-3, 2e-3, "s",
     "in more parts where a body leans, or an answer is old: a box on its edge falls over, and what a part misses of "
     "that grows",
     "decision 0008, What swings under a hand that rests"},
    {"good_periods", &Tuning::good_periods, 1.5, 2.5, "periods of physics",
     "so long an answer is good: one that is lost is nothing, the one after it is due by then",
     "decision 0008, Nothing jumps"},
    {"good_besides_s", &Tuning::good_besides_s, 1e-3, 10e-3, "s", "and so much longer, for the scheduler of physics",
     "decision 0008, Nothing jumps"},
    {"way_out_s", &Tuning::way_out_s, 0.25, 1.0, "s",
     "a way out of a body, once begun, is kept for so long beyond the last answer that named it",
     "decision 0008, Calm"},
    {"same_contact_cosine", &Tuning::same_contact_cosine, 0.3, 0.7, "1",
     "planes of one body that are told with nearer normals in two answers are one contact", "60 degrees"},
    {"same_plane_cosine", &Tuning::same_plane_cosine, 0.9, 0.99, "1",
     "nearer normals belong to one plane: of a surface, of supports", "18 degrees"},
    {"fast_look_m_s", &Tuning::fast_look_m_s, 0.5, 2.0, "m/s",
     "it is looked for surfaces as far as twice the proxy's speed, but no farther than this", "decision 0008, meshes"},
}};

}  // namespace haptic
