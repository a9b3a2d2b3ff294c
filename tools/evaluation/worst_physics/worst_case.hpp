#pragma once
/// @file worst_case.hpp
/// One hostile physics against the hand, under the simulated clock, and what the ladder promises then. Derivation of
/// the bounds: docs/safety.md, "The worst physics".
#include <cstdint>
#include <span>
#include <string>

#include "haptic_node/node_config.hpp"
#include "tools/evaluation/worst_physics/hostile_physics.hpp"

namespace tools {

/// Length of the windows over which energy is judged. Shorter ones are ruled by the peak force.
inline constexpr double kEnergyWindow_s = 60.0;
/// A case is first tried for so long.
inline constexpr double kTrial_s = 5.0;
/// After this much of honest answers the force must be the honest one.
inline constexpr double kRecovery_s = 1.0;

/// Upper bound of the mean power that the device gives the hand over any window of that length [W]:
/// F_rms·v. F_rms = min(F_peak, F_cont·√((τ + S)/S)) by the thermal budget; v = v_cut + F_peak/m·(τ_f + 2T), the speed
/// that a free tip can have while force acts, by the overspeed cut.
[[nodiscard]] double power_bound_w(const haptic::HapticConfig& config, double window_s);

/// By how much a force has grown from one tick to the next: its distance from all that the one before could have fallen
/// to, min over 0 ≤ s ≤ 1 of |F − s·F_before|. A force that has turned around has grown by all of it.
[[nodiscard]] double growth_n(const Eigen::Vector3d& before_n, const Eigen::Vector3d& now_n);

struct WorstOutcome {
  std::uint64_t answers = 0;      ///< Hostile ones.
  std::uint64_t nonfinite = 0;    ///< Ticks with a force that is no number …
  std::uint64_t above_limit = 0;  ///< … or above the device's limit.
  double peak_n = 0.0;
  double growth_n = 0.0;          ///< Largest growth of a force that is not against the motion, in one tick.
  double growth_bound_n = 0.0;    ///< The slew limit, in one tick.
  double trial_w = 0.0;           ///< Mean power over the second half of kTrial_s, as far as the motors would bear the
                                  ///< force for a minute.
  double power_w = 0.0;           ///< Largest mean power to the hand over a window of kEnergyWindow_s.
  double bound_w = 0.0;           ///< power_bound_w().
  double recovery_error_n = 0.0;  ///< With a hand: RMS difference from what honest physics alone makes of the same
                                  ///< motion of the tip, in the second after kRecovery_s …
  double recovery_bound_n = 0.0;  ///< … and what is allowed.
  std::uint64_t overspeeds = 0;
  std::uint64_t hash = 0;  ///< Of the run.
  [[nodiscard]] bool forces_hold() const noexcept {
    return nonfinite == 0 && above_limit == 0 && growth_n <= growth_bound_n;
  }
  [[nodiscard]] bool holds() const noexcept {
    return forces_hold() && power_w <= bound_w && recovery_error_n <= recovery_bound_n;
  }
};

struct WorstSetup {
  std::string session_file;      ///< config/wall.yaml
  double hostile_s = 61.0;       ///< Then kRecovery_s and one second more of honest answers.
  double give_up_below_w = 0.0;  ///< Ends after kTrial_s when trial_w is below this; 0: never.
};

/// Runs the plan of that lineage. Throws rtbus::config::Error.
[[nodiscard]] WorstOutcome run_worst_case(const std::string& method, std::span<const std::uint64_t> lineage,
                                          const WorstSetup& setup);

}  // namespace tools
