#pragma once
/// @file fall.hpp
/// One free fall of the benchmark of He & Choi (2013), section IV: run under the simulated clock or in real processes,
/// recorded, and judged.
#include <optional>
#include <string>
#include <vector>

#include "rtbus/messages.hpp"
#include "tools/evaluation/shared/machine_load.hpp"
#include "tools/harness/harness.hpp"

namespace tools {

/// One recorded fall.
struct FallTrace {
  std::vector<double> time_s;      ///< Of the device samples, since the first.
  std::vector<double> height_m;    ///< p_DT, y.
  std::vector<double> force_n;     ///< On the hand, y, as it left.
  std::vector<double> rendered_n;  ///< Of the method, before the safety ladder, y.
  std::vector<bool> overspeed;     ///< The ladder cut the force in this tick.
  double max_force_n = 0.0;        ///< Of the device: the ladder's clamp.
  double worst_pause_ms = 0.0;     ///< Longest delay of a cycle, or of physics beyond its period, since the release.
  double step_s = 0.0;             ///< Declared period of physics; 0: none.
  MachineLoad load;                ///< Real processes: what the machine gave.

  void append(const rtbus::Telemetry& tick);

 private:
  std::uint64_t first_ns_ = 0;
};

enum class Outcome : std::uint8_t {
  kNoFall,       ///< The tip never left its start, or the trace is too short to tell.
  kSettled,      ///< Came to rest and stayed.
  kOscillating,  ///< Neither at rest at the end of the trace, nor diverged.
  kDiverged,     ///< The method asked for more than the device can give, or the tip ran away.
};
[[nodiscard]] const char* to_string(Outcome outcome) noexcept;

/// What counts as what. Times count from the release.
struct FallLimits {
  double force_band_n = 0.05;  ///< At rest: from then on the force stays within this of its final mean.
  double height_band_m = 0.0;  ///< Above 0: the height within this instead (the paper's Fig. 8 shows heights).
  double run_away_m = 0.06;    ///< Diverged: farther from the wall than this, up or down.
};

struct FallFigures {
  Outcome outcome = Outcome::kNoFall;
  double settling_s = 0.0;    ///< Settled: how long it took.
  double diverged_s = 0.0;    ///< Diverged: when.
  double rest_m = 0.0;        ///< Mean height of the last 0.5 s.
  double swing_n = 0.0;       ///< Peak to peak of the force in the last 0.5 s.
  double peak_force_n = 0.0;  ///< Of the method.
};

/// Pure. Diverged is judged by what the method asked for, before the ladder, which cannot be switched off: beyond the
/// device's peak force, or an overspeed cut, or a tip that ran away. What the ladder makes of the rest of such a run
/// says nothing about the method, so the first such instant decides.
[[nodiscard]] FallFigures judge_fall(const FallTrace& trace, const FallLimits& limits);

/// Index of the last sample at the start height.
[[nodiscard]] std::size_t release_index(const FallTrace& trace);

struct FallSetup {
  std::string session_file;
  std::vector<std::string> assignments;
  double duration_s = 6.0;  ///< Since the start; the device file says when it is let go.
};

/// Throws rtbus::config::Error.
[[nodiscard]] FallTrace fall_in_harness(const FallSetup& setup, const HarnessOptions& link);

/// The real nodes, observed over the bus, in a session of their own. nullopt when they could not be run or somebody
/// interrupted; the reason is on stderr. Throws rtbus::config::Error.
[[nodiscard]] std::optional<FallTrace> fall_for_real(const FallSetup& setup);

}  // namespace tools
