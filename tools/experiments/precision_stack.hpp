#pragma once
/// @file precision_stack.hpp
/// Error against run time where no solution exists: a pile is chaotic, so its motion cannot be compared, but its forces
/// can.
#include <string>
#include <vector>

#include "tools/experiment.hpp"
#include "tools/run_progress.hpp"

namespace tools {

struct PrecisionStackOptions {
  std::string session_file;              ///< stack_125.yaml.
  std::vector<std::string> pile_files;   ///< To be shown: that and its like. With `quick` the first alone.
  std::vector<std::string> assignments;  ///< After the experiment's own.
  bool quick = false;
};

/// Two comparisons, each with a table and a figure:
///  - *shown*: one world for all laws (precision_shown.hpp).
///  - *closed*: each law in its own loop, from ten slightly different starts: mean force, impulse per second and
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

}  // namespace tools
