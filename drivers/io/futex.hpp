#pragma once
/// @file futex.hpp
/// Sleeping on a 32-bit word of this process, with an absolute CLOCK_MONOTONIC deadline.
#include <linux/futex.h>
#include <sys/syscall.h>
#include <time.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <climits>
#include <cstdint>

#include "rtbus/clock.hpp"

namespace drivers::io {

/// Sleeps while `word` is `seen`; returns when it was woken, when the word differs, on a signal, or at the deadline.
inline void futex_wait(const std::atomic<std::uint32_t>& word, std::uint32_t seen, std::uint64_t deadline_ns) noexcept {
  timespec until{};
  until.tv_sec = static_cast<time_t>(deadline_ns / rtbus::kNsPerS);
  until.tv_nsec = static_cast<long>(deadline_ns % rtbus::kNsPerS);
  ::syscall(SYS_futex, &word, FUTEX_WAIT_BITSET_PRIVATE, seen, &until, nullptr, FUTEX_BITSET_MATCH_ANY);
}

inline void futex_wake(const std::atomic<std::uint32_t>& word) noexcept {
  ::syscall(SYS_futex, &word, FUTEX_WAKE_PRIVATE, INT_MAX, nullptr, nullptr, 0);
}

}  // namespace drivers::io
