#pragma once
/// @file precision_run.hpp
/// One cell of `rtbus evaluate work-precision`: a session in the harness, its error against a reference, and its cost.
#include <functional>
#include <string>
#include <vector>

#include "tools/harness/harness.hpp"

namespace tools {

/// What is varied. Everything else is the session's.
struct PrecisionCell {
  std::string method;          ///< Or kLeadingCoupling (method_settings.hpp).
  double physics_hz = 1000.0;  ///< Results per second; each arrives one such period late.
  double haptic_hz = 1000.0;
  double engine_hz = 1000.0;    ///< Parts of a result's step; never below physics_hz.
  int solver_iterations = 0;    ///< 0: the engine's own.
  bool one_period_late = true;  ///< False: a result is there at once, which only a reference may have.
};

/// One run of a device along one axis.
struct PrecisionTrace {
  std::vector<double> time_s;      ///< Simulated, since the start of the run.
  std::vector<double> position_m;  ///< Of the tip, along the axis.
  std::vector<double> force_n;     ///< On the hand, as it left, along the axis.
  double absorbed_j = 0.0;         ///< By the device's port over the whole run.
  double wanted_peak_n = 0.0;      ///< Of the method, before the ladder.
  double limit_n = 0.0;            ///< Of the device.
  double cycle_ns = 0.0;           ///< Median of a haptic cycle, without the simulated device.
  double cycle_p99_ns = 0.0;       ///< Its 99th percentile.
  double step_ms = 0.0;            ///< Mean CPU time per result of physics.
  double cpu_s_per_s = 0.0;        ///< CPU time of cycles and steps per simulated second.
  double heap_kib = 0.0;           ///< That the two nodes' cores keep.

  [[nodiscard]] bool diverged() const noexcept { return wanted_peak_n > limit_n; }
};

/// A scene of the experiment.
struct PrecisionScene {
  std::string name;
  std::string session_file;
  std::vector<std::string> assignments;  ///< As for --set: device, hand, gains.
  int axis = 1;                          ///< Along which device and force are looked at: 0 x, 1 y, 2 z.
  double from_s = 0.0;                   ///< Errors count from here …
  double until_s = 1.0;                  ///< … to here, the end of the run.
  bool at_rest = true;                   ///< Nothing moves or gives way: methods without physics can render it.
  std::vector<double> engine_hz = {100, 200, 500, 5000};  ///< Tried besides 1000, at 100 results per second.
  std::vector<int> iterations = {};                       ///< Of the solver, likewise.
};

/// Position [m] and force [N] along the axis at a time [s].
struct ReferencePoint {
  double position_m = 0.0;
  double force_n = 0.0;
};
using Reference = std::function<ReferencePoint(double time_s)>;

struct PrecisionError {
  double force_rms_n = 0.0;
  double force_peak_n = 0.0;
  double position_rms_m = 0.0;
  double position_peak_m = 0.0;
  double spurious_j =
      0.0;  ///< What the hand received beyond the reference's, over the window: −∫F dx against −∫F_ref dx_ref.
};

/// The session's assignments for one cell, the scene's own included.
[[nodiscard]] std::vector<std::string> assignments_of(const PrecisionScene& scene, const PrecisionCell& cell);

/// HarnessOptions::around_world.
using AroundWorld = decltype(HarnessOptions::around_world);

/// Throws rtbus::config::Error.
[[nodiscard]] PrecisionTrace run_precisely(const PrecisionScene& scene, const PrecisionCell& cell,
                                           const AroundWorld& around_world = {});

/// Pure. Both are looked at when the trace's cycles begin: the force is the one that is held from then on.
[[nodiscard]] PrecisionError error_of(const PrecisionTrace& trace, const PrecisionScene& scene,
                                      const Reference& reference);

/// A trace as a reference: straight lines between its cycles. The trace must outlive it.
[[nodiscard]] Reference reference_of(const PrecisionTrace& trace);

}  // namespace tools
