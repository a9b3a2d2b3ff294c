#pragma once
/// @file fault_cells.hpp
/// Faults end to end: a session runs as `rtbus run` starts it, something is killed, stopped, hung or deleted while the
/// hand presses on the wall, or its device fails. What the hand felt is read from the plant, which lives in a process
/// of its own, or from the stand-in for the device.
/// `rtbus evaluate faults` and tests/faults run the same cells.
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "tools/evaluation/faults/device_faults.hpp"
#include "tools/evaluation/faults/python_engine.hpp"

namespace tools {

enum class Fault : std::uint8_t {
  kPhysicsKilled,   ///< SIGKILL to physics_node in mid-push.
  kPhysicsStopped,  ///< SIGSTOP to physics_node, SIGCONT a second later.
  kEngineHung,      ///< The stepping thread alone is stopped for a second; the heartbeat goes on.
  kHapticKilled,    ///< SIGKILL to haptic_node: only the device's own time-out is left.
  kTopicsDeleted,   ///< Every topic's file is removed from /dev/shm, one after the other.
  kDevice,          ///< A row of device_faults.hpp.
  kPython,          ///< A row of python_engine.hpp.
};
/// Those of nodes and topics.
inline constexpr Fault kFaults[] = {Fault::kPhysicsKilled, Fault::kPhysicsStopped, Fault::kEngineHung,
                                    Fault::kHapticKilled, Fault::kTopicsDeleted};
[[nodiscard]] const char* to_string(Fault fault) noexcept;  ///< "physics_killed"

struct FaultSetup {
  Fault fault = Fault::kPhysicsKilled;
  const DeviceFault* device = nullptr;  ///< With kDevice.
  const PythonFault* python = nullptr;  ///< With kPython.
  std::string program = {};             ///< The `rtbus` program; the nodes lie beside it.
  std::string session_file = {};        ///< One device and a hand that pushes: `process: own`, or a stand-in.
  std::string session = {};             ///< Name for this run; must be free.
  std::string report = {};              ///< Where `rtbus run` writes its report.
};

/// The force on the hand at one step of the plant.
struct Felt {
  std::uint64_t time_ns = 0;
  double force_n = 0.0;  ///< Norm of what the actuators apply.
};

/// What happened. Times in ms.
struct FaultOutcome {
  std::string problem;  ///< Why the cell could not be run as meant; the rest is then incomplete.
  double before_n = 0.0;
  double peak_n = 0.0;
  double zero_ms = -1.0;      ///< From the fault to zero force at the hand; −1: it never was zero.
  double lowest_n = 0.0;      ///< From the fault on.
  double after_zero_n = 0.0;  ///< Largest force after the zero.
  double back_ms = -1.0;      ///< From the fault, or its end, until the hand feels half of the peak again; −1: never.
  double growth_per_ms = 0.0;  ///< Fastest growth of the force over one ms, from the fault on, as a share of the peak.
  double pause_ms = 0.0;  ///< Longest pause of the machine: a gap between states of the plant, a late haptic cycle.
  bool device_timed_out = false;
  std::uint64_t beats = 0;             ///< Heartbeats of physics during a hang.
  std::uint64_t ticks = 0, due = 0;    ///< Of the haptic loop, from the fault to the end; 0 when it was the one killed.
  std::uint64_t overruns = 0;          ///< Likewise.
  int topics = 0, topics_back = 0;     ///< Deleted; found again, written by their live owner.
  int exit_status = -1;                ///< Of `rtbus run`.
  int restarts = -1;                   ///< As its report says.
  std::string restarted;               ///< Which node, when it was one.
  std::vector<std::string> left_over;  ///< Segments that the session left behind.
  std::vector<Felt> trace;             ///< From a little before the fault.
  std::uint64_t fault_ns = 0;          ///< On the trace's clock.
};

/// Fills in zero_ms, lowest_n, after_zero_n, back_ms, growth_per_ms, peak_n and pause_ms from the trace. Pure.
/// @param ended_ns When the fault was over: back_ms counts from then.
void judge_trace(std::uint64_t ended_ns, FaultOutcome& outcome);

/// The bar for zero_ms: what safety.md promises, without the pauses of the machine. Only for faults that end in zero.
[[nodiscard]] double promised_zero_ms(const FaultSetup& setup) noexcept;
/// Whether the force goes to zero meanwhile.
[[nodiscard]] bool ends_in_zero(const FaultSetup& setup) noexcept;
/// Whether the session starts a node anew.
[[nodiscard]] bool restarts_a_node(const FaultSetup& setup) noexcept;
/// Whether the force comes back by itself when the fault is over.
[[nodiscard]] bool comes_back(const FaultSetup& setup) noexcept;
[[nodiscard]] const char* name_of(const FaultSetup& setup) noexcept;

/// Runs one cell: about five seconds, `kTopicsDeleted` ten.
[[nodiscard]] FaultOutcome run_fault_cell(const FaultSetup& setup);

}  // namespace tools
