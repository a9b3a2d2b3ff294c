#pragma once
/// @file stability_run.hpp
/// Runs one stability case under the simulated clock and says what became of it.
#include <cstdint>
#include <string>
#include <vector>

#include "rtbus/messages.hpp"
#include "tools/evaluation/stability/stability_case.hpp"

namespace tools {

enum class StabilityOutcome : std::uint8_t {
  kSettled,     ///< At rest: no oscillation beyond a fifth of the bars.
  kMoving,      ///< Neither at rest nor oscillating at the end: creeps, or still dies out.
  kLimitCycle,  ///< A steady oscillation below the bars, or one that direct rendering at 10 kHz has too.
  kDiverged,    ///< A steady or growing oscillation above 0.05 N or two encoder steps; or at the force limit without a
                ///< push.
  kFailed,      ///< A force that is not a number or above the limit, in any tick; or the run itself broke.
};
[[nodiscard]] const char* to_string(StabilityOutcome outcome) noexcept;

/// Bars of the oscillation, peak to peak.
inline constexpr double kSwingBarN = 0.05;
inline constexpr double kSwingBarQuanta = 2.0;
inline constexpr double kNominalQuantumM = 23e-6;  ///< Where the encoder is exact.
inline constexpr double kClampBarS = 0.05;
/// Of the observed energy inside the envelope: −(this + |F|·|Δx| of the worst tick), and above −this again within
/// kDeficitBarS.
inline constexpr double kDeficitBarJ = 0.5e-3;
inline constexpr double kDeficitBarS = 0.05;

/// One run against another of the same hand.
struct TruthError {
  double force_rms_n = 0.0, force_peak_n = 0.0;
  double position_rms_m = 0.0, position_peak_m = 0.0;
  double drift_m = 0.0;         ///< Of the tip at the end.
  double given_j = 0.0;         ///< Most that the hand had received, all in all, at any time.
  double drag_n_s_per_m = 0.0;  ///< Of a move in free air.
};

/// Plain data: it goes through a pipe.
struct StabilityResult {
  std::uint64_t index = 0;
  std::uint64_t seed = 0;
  StabilityOutcome outcome = StabilityOutcome::kFailed;
  bool growing = false;  ///< The oscillation of the last quarter is larger than that of the second, and goes on.
  double rendered_n_per_m = 0.0;  ///< Stiffness after what device and rate allow.
  double rendered_n_s_per_m = 0.0;
  double swing_n = 0.0;      ///< Oscillation of the force at the end, peak to peak, drift taken off.
  double swing_m = 0.0;      ///< Of the tip, as it really moves.
  double reference_n = 0.0;  ///< Of direct rendering at 10 kHz, where it was asked; else negative.
  double reference_m = 0.0;
  double peak_n = 0.0;
  double clamped_s = 0.0;  ///< Longest time at the clamp with nobody pushing.
  double settled_s = 0.0;  ///< After the end of the motion.
  double simulated_s = 0.0;
  double lowest_observed_j = 0.0;
  double worst_tick_j = 0.0;      ///< Largest |F|·|Δx| of a tick.
  double deficit_s = 0.0;         ///< Longest time below −kDeficitBarJ.
  double deficit_growth_j = 0.0;  ///< Second lowest window of the last quarter below all before; positive: grows.
  double plant_work_j = 0.0;      ///< True work of the actuator on the tip.
  double observed_error_j = 0.0;  ///< Largest |work counted by the loop − true work|.
  std::uint64_t nonfinite = 0, above_limit = 0, overspeed = 0, passivity = 0, law_nonfinite = 0;
  double age_p50_s = 0.0, age_max_s = 0.0;  ///< Of the answer in use, from the start of the motion on.
  double stale_s = 0.0;                     ///< Without an answer that counts, likewise.
  TruthError truth;                         ///< Where it was asked for.
  double cpu_s = 0.0;
  char error[256] = {};

  [[nodiscard]] double deficit_bar_j() const noexcept { return -(kDeficitBarJ + worst_tick_j); }
};

/// What of a tick is kept for a plot.
struct StabilityTick {
  double time_s = 0.0, height_m = 0.0, force_n = 0.0, proxy_m = 0.0, observed_j = 0.0, method_n = 0.0, given_j = 0.0;
  /// Along the axis in which the hand of `each` pushes.
  [[nodiscard]] static StabilityTick of(const rtbus::Telemetry& telemetry, const StabilityCase& each,
                                        double time_s) noexcept;
};

/// @param session_file config/wall.yaml. @param extra `--set`, stronger than the case. @param trace Filled if not null.
/// @param reference Ask direct rendering at 10 kHz where the outcome hangs on it.
[[nodiscard]] StabilityResult run_case(const StabilityCase& each, const std::string& session_file,
                                       const std::vector<std::string>& extra, bool reference = true,
                                       std::vector<StabilityTick>* trace = nullptr) noexcept;

}  // namespace tools
