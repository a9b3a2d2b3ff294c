#pragma once
/// @file parent_death.hpp
/// A node that `rtbus run` started ends when its supervisor dies, however that happens.
#include <signal.h>
#include <sys/prctl.h>
#include <unistd.h>

#include <cstdio>
#include <cstdlib>
#include <string>

namespace rtbus {

/// Carries the supervisor's process number to its children.
inline constexpr const char* kSupervisorVariable = "RTBUS_SUPERVISOR_PID";

/// Asks the kernel for SIGTERM at the supervisor's death. The supervisor asks the same before it executes us, but the
/// kernel forgets that when the program has file capabilities (prctl(2)), which is how ordinary users get realtime
/// rights. Without a supervisor: nothing. Call it first in main(). @returns false when the supervisor is gone already.
[[nodiscard]] inline bool end_with_supervisor() {
  const char* const text = std::getenv(kSupervisorVariable);
  if (text == nullptr) return true;
  ::prctl(PR_SET_PDEATHSIG, SIGTERM);
  if (std::to_string(::getppid()) == text) return true;
  std::fprintf(
      stderr,
      "%s names process %s, which is not the parent of this one: its supervisor is gone. Unset it to run alone.\n",
      kSupervisorVariable, text);
  return false;
}

}  // namespace rtbus
