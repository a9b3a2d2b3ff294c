#pragma once
/// @file drop.hpp
/// The free-fall benchmark of He & Choi (2013), section IV, Fig. 8: the tip is let go 20 mm above a wall.
#include <string>
#include <vector>

#include "tools/experiment.hpp"

namespace tools {

struct DropOptions {
  std::string session_file;              ///< config/drop.yaml
  std::vector<std::string> assignments;  ///< `--set`
  int real_runs = 3;                     ///< With the real process, besides the one under the simulated clock.
};

/// One recorded fall.
struct DropTrace {
  std::vector<double> time_s;    ///< Of the device samples, since the first.
  std::vector<double> height_m;  ///< p_DT, y.
  std::vector<double> force_n;   ///< y.
  double worst_wakeup_ms = 0.0;  ///< Longest delay of a cycle: a pause of the machine shows here.
};

/// What is said of a fall. Times count from the release.
struct DropOutcome {
  bool fell = false;        ///< The tip left its start and came to rest within the trace.
  double settling_s = 0.0;  ///< From then on the height stays within 0.2 mm of its final mean (facts of the fit).
  double rest_m = 0.0;      ///< Mean of the last 0.5 s.
  double peak_force_n = 0.0;
};

/// Pure. @param trace At least one second, evenly sampled or not.
[[nodiscard]] DropOutcome judge_drop(const DropTrace& trace);

/// Runs the fall in the harness and in real processes, draws it, and checks it against the published outcome.
void evaluate_drop(const DropOptions& options, Experiment& experiment);

}  // namespace tools
