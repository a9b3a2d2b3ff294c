#pragma once
/// @file precision_stack.hpp
/// Error against run time where no solution exists: a pile is chaotic, so its motion cannot be compared, but its forces
/// can.
#include <string>
#include <vector>

#include "tools/cli/common/run_progress.hpp"
#include "tools/evaluation/shared/experiment.hpp"

namespace tools {

/// The push into a pile, in every comparison of this folder.
inline constexpr double kPileRate_hz = 1000.0;  ///< Of the haptic loop.
inline constexpr double kPilePush_m_s = 0.01, kPilePush_m = 0.045, kPileBegin_s = 0.3;
/// The face of the pile is 15 mm from where the push begins, less the radius of the proxy. A fifth of a second later
/// the force is that of the pile and not of the first touch.
inline constexpr double kPileContact_s = kPileBegin_s + 0.010 / kPilePush_m_s + 0.2;
inline constexpr double kPileEnd_s = kPileBegin_s + kPilePush_m / kPilePush_m_s;
inline constexpr int kPileStarts = 10;  ///< Slightly different ones, for what is chaotic.

struct PrecisionStackOptions {
  std::string session_file;              ///< stack_125.yaml.
  std::vector<std::string> pile_files;   ///< To be shown: that and its like. With `quick` the first alone.
  std::vector<std::string> assignments;  ///< After the experiment's own.
  bool quick = false;
};

/// Two comparisons, each with a table and a figure:
///  - *shown*: one world for all methods (precision_shown.hpp).
///  - *closed*: each method in its own loop, from ten slightly different starts: mean force, impulse per second and
///  vibration
///    above 30 Hz with their 95 % confidence intervals.
/// Throws rtbus::config::Error.
void evaluate_precision_stack(const PrecisionStackOptions& options, Experiment& experiment, RunProgress& progress);

/// Mean and half the width of its 95 % confidence interval (Student's t). With fewer than two values the latter is NaN.
struct MeanInterval {
  double mean = 0.0;
  double half_width = 0.0;
};
[[nodiscard]] MeanInterval mean_interval(const std::vector<double>& values);
/// "1.23 ± 0.045", both times `scale`.
[[nodiscard]] std::string interval_text(const MeanInterval& interval, double scale);

}  // namespace tools
