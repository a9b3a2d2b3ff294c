#pragma once
/// @file doctor_checks.hpp
/// The checks of `rtbus doctor`. Pure functions: facts in, judgement out; the measuring is done elsewhere.
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "drivers/driver_module.hpp"
#include "rtbus/topic_directory.hpp"
#include "tools/cli/host/ask_kernel.hpp"
#include "tools/cli/host/ask_logind.hpp"
#include "tools/cli/host/wakeup_probe.hpp"

namespace tools {

enum class Health : std::uint8_t {
  kOk,
  kWarn,  ///< It works, less well than it could.
  kFail,  ///< Forces at 1 kHz will not be on time, or the nodes will not start.
};

/// One line of the doctor (an experiment has its own `Check`).
struct DoctorCheck {
  std::string id;  ///< Stable, for scripts: "sched_fifo".
  Health health = Health::kOk;
  std::string what;      ///< "SCHED_FIFO for this user".
  std::string measured;  ///< What was found, with unit.
  std::string remedy;    ///< What to do, as commands where possible; empty when there is nothing to do.
};

/// Everything the checks look at.
struct DoctorFacts {
  MachineFacts machine;
  RealtimeLimits limits;
  std::optional<MountFacts> shm;  ///< /dev/shm.
  LogindFacts logind;
  double clock_ns = 0.0;  ///< measure_clock_ns().
  WakeupFigures wakeup;
  std::vector<rtbus::TopicInfo> topics;   ///< list_topics().
  bool bridge_is_here = true;             ///< The program rtbus_bridge.
  std::vector<drivers::Finding> vendors;  ///< Of makers' libraries and services, if asked for.
};

/// All checks, in the order in which they are worth repairing.
[[nodiscard]] std::vector<DoctorCheck> judge(const DoctorFacts& facts);

/// "ok", "warn", "fail".
[[nodiscard]] const char* to_string(Health health) noexcept;

/// True when nothing fails.
[[nodiscard]] bool healthy(std::span<const DoctorCheck> checks) noexcept;

}  // namespace tools
