#pragma once
/// @file soft_stroke.hpp
/// One stroke over a soft body (config/devices/stroke_soft.csv), recorded and judged, and two methods at equal mean
/// force.
#include <string>
#include <vector>

#include "tools/cli/still/still_frame.hpp"
#include "tools/evaluation/shared/force_profile.hpp"
#include "tools/evaluation/shared/machine_load.hpp"
#include "tools/evaluation/soft/soft.hpp"
#include "tools/harness/harness.hpp"

namespace tools {

/// How fast physics is, and how stiff the coupling.
struct SoftMachine {
  const char* id;
  const char* what;
  double throttle_hz;  ///< 0: none.
  double stiffness_n_per_m;
  bool compared;  ///< Interpolation vibrates here: which is smoother is checked.
};

/// One stroke, as the hand felt it.
struct SoftStroke {
  std::vector<double> time_s;
  std::vector<double> up_n;  ///< Upwards, as it left.
  std::vector<double> norm_n;
  std::vector<double> step_ms;  ///< Real processes: engine time.
  double rate_hz = 1000.0;
  double haptic_hz = 0.0, bare_hz = 0.0, wakeup_p999_us = 0.0;  ///< Real processes.
  MachineLoad load;                                             ///< Likewise: what the machine gave.
  double absorbed_j = 0.0;                                      ///< By the device's port so far.

  void append(const rtbus::Telemetry& tick);

 private:
  std::uint64_t first_ns_ = 0;
};

/// While the script holds still, pressed in, and strokes.
struct StrokeFigures {
  double depth_m = 0.0;  ///< What the hand wanted beyond the script, for the sake of equal means.
  double held = 0.0;     ///< Share of the ticks with a force.
  double peak_n = 0.0;   ///< Of the whole stroke.
  Roughness roughness;   ///< Of the force upwards.
};
[[nodiscard]] StrokeFigures judge_stroke(const SoftStroke& stroke);

/// Means this near count as equal.
inline constexpr double kEqualStrokes = 0.10;

/// @param depth_m How much deeper than the script says the hand wants to be.
[[nodiscard]] std::vector<std::string> stroke_settings(const SoftOptions& options, const SoftMachine& machine,
                                                       const char* method, double depth_m);

[[nodiscard]] rtbus::config::SessionConfig load_stroke(const SoftOptions& options,
                                                       const std::vector<std::string>& assignments);

/// @param picture Gets the frame in the middle of the stroke, unless null.
[[nodiscard]] SoftStroke stroke_in_harness(const SoftOptions& options, const std::vector<std::string>& assignments,
                                           StillFrame* picture);

/// The stroke whose mean force is `mean_n` within kEqualStrokes: the hand wants to be the deeper or less deep, for a
/// few tries.
struct StrokeAtMean {
  SoftStroke stroke;
  StrokeFigures figures;
};
[[nodiscard]] StrokeAtMean stroke_at_mean(const SoftOptions& options, const SoftMachine& machine, const char* method,
                                          double mean_n, StillFrame* picture);

}  // namespace tools
