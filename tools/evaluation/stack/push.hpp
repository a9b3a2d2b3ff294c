#pragma once
/// @file push.hpp
/// One push of a scripted hand into a scene, for the force profiles of He & Choi (2013), Figs 13, 15 and 16: run under
/// the simulated clock or in real processes, recorded, and put into figures.
#include <optional>
#include <string>
#include <vector>

#include "rtbus/messages.hpp"
#include "tools/cli/host/bare_loop.hpp"
#include "tools/cli/still/still_frame.hpp"
#include "tools/evaluation/shared/force_profile.hpp"
#include "tools/evaluation/shared/machine_load.hpp"
#include "tools/harness/harness.hpp"

namespace tools {

/// One recorded push; the rows of a tick and those of a step apart.
struct PushTrace {
  std::vector<double> time_s;       ///< Of the cycles, since the first.
  std::vector<double> force_n;      ///< On the hand, against the push (+z), as it left.
  std::vector<double> way_mm;       ///< Of the device along the push (−z), from where it began.
  std::vector<double> step_time_s;  ///< When each physics step was published, since the first cycle.
  std::vector<double> step_ms;      ///< Engine time of each; real processes only.
  double rate_hz = 0.0;             ///< Declared, of the loop: the spacing of the samples.

  void append(const rtbus::Telemetry& tick);
  void append(const rtbus::Stamped<rtbus::ProxyState>& step);

 private:
  std::uint64_t first_ns_ = 0;
  double start_m_ = 0.0;
};

struct PushFigures {
  double touched_s = 0.0;  ///< When the device had gone as far as the scene.
  Roughness roughness;     ///< From then on.
  double peak_n = 0.0;
};

/// Pure. All zero when the device never went so far. Not the force tells the touch: remote coupling drags in free air.
/// @param gap_mm Way of the device until its proxy touches the scene.
[[nodiscard]] PushFigures judge_push(const PushTrace& trace, double gap_mm);

struct PushSetup {
  std::string session_file;
  std::vector<std::string> assignments;
  double duration_s = 20.0;
  double gap_mm = 10.0;  ///< As in judge_push().
};

/// Throws rtbus::config::Error. @param end Takes the last instant, for a picture.
[[nodiscard]] PushTrace push_in_harness(const PushSetup& setup, const HarnessOptions& link, StillFrame* end = nullptr);

/// What real processes add: how fast they ran.
struct LivePush {
  PushTrace trace;
  double haptic_hz = 0.0;                       ///< Cycles served over the time in which they were due.
  double simulation_hz = 0.0;                   ///< Steps published per second, while the hand touched.
  double real_time_factor = 0.0;                ///< Simulated time over real time, while the hand touched.
  double step_p50_ms = 0.0, step_p99_ms = 0.0;  ///< While the hand touched.
  double wakeup_p999_us = 0.0;
  double worst_pause_ms = 0.0;  ///< Longest delay of a cycle of the haptic loop or of the bare one.
  BareLoopFigures bare;         ///< In the same seconds, on the same core.
  double bare_hz = 0.0;
  MachineLoad load;            ///< What the machine gave meanwhile.
  MachineLoad load_and_steps;  ///< The same with the steps held against their period.
};

/// The real nodes in a session of their own. nullopt when they could not be run or somebody interrupted; the reason is
/// on stderr. Throws rtbus::config::Error.
[[nodiscard]] std::optional<LivePush> push_for_real(const PushSetup& setup);

}  // namespace tools
