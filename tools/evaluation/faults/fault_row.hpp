#pragma once
/// @file fault_row.hpp
/// The table of faults: what goes wrong in a running session, and what the hand is promised then. docs/safety.md names
/// every row; a test compares both. The rows are in a file per family: node_faults.cpp, supervisor_faults.cpp, …
#include <cstdint>
#include <functional>
#include <string>
#include <utility>
#include <vector>

namespace tools {

class FaultSession;

/// How `rtbus run` is started; a row may change it.
struct RunCommand {
  std::vector<std::string> arguments;
  std::vector<std::pair<std::string, std::string>> environment;
  std::string preload;  ///< A library for all processes of the session; empty: none.
  std::string limits;   ///< What sh does before, for example "ulimit -v 30000"; empty: nothing.
};

/// What the hand feels meanwhile.
enum class Feels : std::uint8_t {
  kZero,      ///< The force goes to zero in time.
  kNothing,   ///< The force stays: it never falls below half of what it was.
  kAnything,  ///< Either; limit, growth and return are judged.
};

/// What comes afterwards.
enum class Ends : std::uint8_t {
  kComesBack,    ///< The force, by itself.
  kStaysAtZero,  ///< Until the user has acted.
  kWithSession,  ///< The session ends, by itself.
  kMayGoOn,      ///< The session ends by itself, or goes on with its force until it is told to end.
  kNeverStarts,  ///< The session ends before the hand gets any force.
};

struct FaultRow {
  std::string name;
  std::string what;  ///< One line, for --list.
  Feels feels = Feels::kZero;
  double zero_ms = 0.0;  ///< With kZero: after the fault, without pauses of the machine (docs/safety.md).
  Ends ends = Ends::kComesBack;
  int restarts_least = 0, restarts_most = 0;  ///< Nodes that the session starts again; −1: it tells none.
  int exit_status = 0;                        ///< Of `rtbus run`; kAnyFailure: other than 0.
  bool quick = true;                          ///< Also with --quick.
  bool alone = false;                         ///< It takes the machine's CPUs: nothing runs beside it.
  bool own_wakeups = false;                   ///< It delays the haptic loop itself: its wake-ups are not judged …
  bool takes_core = false;             ///< … by taking its CPU, from the witness too: only the plant tells pauses.
  bool own_pauses = false;             ///< It delays the plant too: nothing tells pauses of the machine.
  bool held = false;                   ///< With kZero: the force stays at zero until the fault is over.
  bool counts_ticks = false;           ///< The loop goes on meanwhile, and counts each tick.
  double hold_s = 0.0;                 ///< Longer than other rows by so much, for the time limit.
  bool both_methods = true;            ///< Else once, with the session's own.
  std::string session = {};            ///< A session file beside the usual one; empty: the usual one.
  std::string (*why_not)() = nullptr;  ///< Why it cannot be run here; empty: it can.
  std::function<void(RunCommand&, const FaultSession&)> prepare = {};
  std::function<void(FaultSession&)> happen = {};

  static constexpr int kAnyFailure = -1;
};

/// What the promises of docs/safety.md add up to, with one tick on top [ms].
inline constexpr double kLossZero_ms = 60.0 + 40.0 + 1.0;   ///< No heartbeat, or a wrong sample; then the fade.
inline constexpr double kHangZero_ms = 100.0 + 40.0 + 1.0;  ///< No step, but heartbeats; then the fade.
inline constexpr double kDeviceZero_ms = 20.0 + 1.0;        ///< Nobody writes: the device's own time-out.
inline constexpr double kEstopZero_ms = 100.0;              ///< From the order.

/// All rows, also those that cannot be run here; rows of devices and engines only where these were built.
[[nodiscard]] const std::vector<FaultRow>& fault_rows();
/// nullptr: there is none of that name.
[[nodiscard]] const FaultRow* find_fault_row(const std::string& name);

// The families.
[[nodiscard]] std::vector<FaultRow> node_faults();
[[nodiscard]] std::vector<FaultRow> supervisor_faults();
[[nodiscard]] std::vector<FaultRow> topic_faults();
[[nodiscard]] std::vector<FaultRow> observer_faults();
[[nodiscard]] std::vector<FaultRow> bridge_faults();
[[nodiscard]] std::vector<FaultRow> resource_faults();
[[nodiscard]] std::vector<FaultRow> machine_faults();
[[nodiscard]] std::vector<FaultRow> engine_faults();
[[nodiscard]] std::vector<FaultRow> device_faults();

}  // namespace tools
