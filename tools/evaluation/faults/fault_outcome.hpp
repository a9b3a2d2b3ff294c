#pragma once
/// @file fault_outcome.hpp
/// What happened in one run of one row, and how a trace of the force is judged.
#include <cstdint>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

namespace tools {

/// The force on the hand at one step of the plant.
struct Felt {
  std::uint64_t time_ns = 0;
  double force_n = 0.0;  ///< Norm of what the actuators apply.
};

/// Times in ms.
struct FaultOutcome {
  std::string problem;    ///< Why the cell could not be run as meant; the rest is then incomplete.
  double before_n = 0.0;  ///< At the fault.
  double peak_n = 0.0;
  double limit_n = 0.0;       ///< As the haptic node tells it.
  double zero_ms = -1.0;      ///< From the fault to zero force at the hand; −1: it never was zero.
  double lowest_n = 0.0;      ///< From the fault on.
  double after_zero_n = 0.0;  ///< Largest force after the zero.
  /// Last force that was felt while there should be none, from the beginning of that time; 0: none. The worst of all
  /// such times.
  double felt_until_ms = 0.0;
  double back_ms = -1.0;  ///< From the fault, or its end, until the hand feels half of the peak again; −1: never.
  double growth_per_ms = 0.0;  ///< Fastest growth of the force over one ms, from the fault on, as a share of the peak.
  double pause_ms = 0.0;       ///< Longest pause of the machine: a gap between states of the plant, a late witness.
  double wakeup_ms = 0.0;      ///< Latest wake-up of the haptic loop.
  bool device_timed_out = false;
  std::uint64_t ticks = 0, due = 0;    ///< Of the haptic loop, from the fault to the end; 0 when it was started anew.
  std::uint64_t overruns = 0;          ///< Likewise.
  double elapsed_s = 0.0;              ///< Between the two samples that tell of these ticks.
  double rate_hz = 0.0;                ///< Declared.
  int topics = 0, topics_back = 0;     ///< Deleted; found again, written by their live owner.
  int exit_status = -1;                ///< Of `rtbus run`.
  bool went_on = false;                ///< With Ends::kMayGoOn: the session did not end by itself.
  int restarts = -1;                   ///< As its report says; −1: it wrote none.
  int processes_left = 0;              ///< That outlived the session, and were killed.
  std::string restarted;               ///< Which node, when it was one.
  std::vector<std::string> left_over;  ///< Segments that the session left behind.
  std::vector<Felt> trace;             ///< From a little before the fault.
  std::uint64_t fault_ns = 0;          ///< On the trace's clock.
};

/// From one time to another, on the trace's clock.
struct Span {
  std::uint64_t from_ns = 0, to_ns = 0;
};

/// Fills in before_n, zero_ms, lowest_n, after_zero_n, felt_until_ms, back_ms, growth_per_ms, peak_n and pause_ms from
/// the trace. Pure.
/// @param ended_ns When the fault was over: back_ms counts from then.
/// @param without_force When there should be none; felt_until_ms counts from the beginning of each.
void judge_trace(std::uint64_t ended_ns, FaultOutcome& outcome, const std::vector<Span>& without_force = {});

/// All but the trace, for the way from one process to another.
void to_json(nlohmann::json& out, const FaultOutcome& outcome);
void from_json(const nlohmann::json& in, FaultOutcome& outcome);

}  // namespace tools
