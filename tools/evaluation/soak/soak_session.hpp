#pragma once
/// @file soak_session.hpp
/// A real session that lives through faults at random times, one after the other, each only when the hand feels the
/// wall again.
#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "tools/evaluation/soak/process_watch.hpp"

namespace tools {

/// What may happen. The names are those of the table.
enum class SoakEvent : std::uint8_t {
  kPhysicsKilled,
  kPhysicsStopped,
  kHapticKilled,
  kHapticStopped,
  kPlantKilled,   ///< The device is gone,
  kPlantStopped,  ///< or stalls.
  kTopicsDeleted,
  kObservers,
  kObserverKilled,
  kEstop,
  kDeviceFails,  ///< As its `faults` say.
};
inline constexpr int kSoakEvents = 11;
[[nodiscard]] const char* to_string(SoakEvent event) noexcept;

struct SoakSetup {
  std::string program;  ///< The `rtbus` program.
  std::string session_file;
  std::vector<std::string> assignments;
  std::string name;          ///< Of the session; must be free.
  std::string trigger = {};  ///< The device fails while this file is there; empty: it has a plant of its own.
  double seconds = 60.0;
  std::uint64_t seed = 1;
};

struct SoakOutcome {
  std::string problem;                      ///< Why it could not go on; empty: it ran to its end.
  std::map<std::string, int> events;        ///< How often each happened.
  std::map<std::string, UseGrowth> growth;  ///< Per program.
  double slowest_return_s = 0.0;            ///< From the end of an event until the hand feels the wall again.
  std::string slowest_after;                ///< Which event.
  double peak_n = 0.0;
  std::uint64_t above_limit = 0;                   ///< Samples.
  std::uint64_t ticks = 0, due = 0, overruns = 0;  ///< Of all lives of the haptic loop, as last told by each.
  double ticks_not_told = 0.0;       ///< In a life: periods that passed, against ticks served and overruns. The worst.
  double least_absorbed_j = 0.0;     ///< Least energy that the hand had put in so far; negative: it got some.
  double least_since_event_j = 0.0;  ///< The same since an event began.
  int segments_more = 0;             ///< At quiet moments, than at the first.
  int left_over = 0;                 ///< Segments after the end.
  int exit_status = -1;
};

/// Runs it. A signal ends it early.
[[nodiscard]] SoakOutcome run_soak_session(const SoakSetup& setup);

}  // namespace tools
