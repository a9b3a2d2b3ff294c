#pragma once
/// @file clock.hpp
/// Time is CLOCK_MONOTONIC in nanoseconds, everywhere. The kernel keeps it common to all processes of one machine,
/// so stamps of different nodes may be subtracted.
#include <time.h>

#include <cerrno>
#include <cmath>
#include <cstdint>

#include "rtbus/realtime.hpp"

namespace rtbus {

inline constexpr std::uint64_t kNsPerUs = 1'000;
inline constexpr std::uint64_t kNsPerMs = 1'000'000;
inline constexpr std::uint64_t kNsPerS = 1'000'000'000;

/// Nanoseconds of CLOCK_MONOTONIC. @realtime Yes: served by the vDSO (about 25 ns), no system call on x86-64 and
/// AArch64.
[[nodiscard]] inline std::uint64_t monotonic_ns() noexcept RTBUS_NONBLOCKING {
  timespec now;
  clock_gettime(CLOCK_MONOTONIC, &now);
  return static_cast<std::uint64_t>(now.tv_sec) * kNsPerS + static_cast<std::uint64_t>(now.tv_nsec);
}

/// Sleeps until `deadline_ns` of CLOCK_MONOTONIC; returns at once if it has passed. A signal does not shorten the
/// sleep.
/// @realtime The one system call that a loop may make per cycle.
inline void sleep_until(std::uint64_t deadline_ns) noexcept {
  timespec until;
  until.tv_sec = static_cast<time_t>(deadline_ns / kNsPerS);
  until.tv_nsec = static_cast<long>(deadline_ns % kNsPerS);
  while (clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &until, nullptr) == EINTR) {
  }
}

/// `seconds` as whole nanoseconds, rounded.
[[nodiscard]] inline std::uint64_t ns_of(double seconds) noexcept {
  return static_cast<std::uint64_t>(std::llround(seconds * 1e9));
}

/// Seconds between two stamps; negative when `to_ns` is earlier.
[[nodiscard]] inline double seconds_between(std::uint64_t from_ns, std::uint64_t to_ns) noexcept {
  return static_cast<double>(static_cast<std::int64_t>(to_ns - from_ns)) * 1e-9;
}

}  // namespace rtbus
