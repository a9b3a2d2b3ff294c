#pragma once
/// @file doorbell.hpp
/// Sleeping on a topic without losing a wake-up. Private to rtbus.
///
///     writer                                   sleeper
///     newest = n          release              sleepers += 1         seq_cst
///     rings += 1          seq_cst              seen = rings          seq_cst
///     sleepers > 0 ?      seq_cst → wake       newest > last ? → done
///                                              futex_wait(rings, seen)
///
/// If the writer sees no sleeper, its look comes before the sleeper's += 1 in the one order of the seq_cst operations;
/// then rings += 1 does too, `seen` is the new value and the newest sample is visible. If it sees one, the ring either
/// changed `rings` before the futex_wait (which then returns at once) or wakes it. A sleeper that is killed leaves
/// `sleepers` too high: later rings cost a system call, nothing else.
#include <linux/futex.h>
#include <sys/syscall.h>
#include <time.h>
#include <unistd.h>

#include <algorithm>
#include <climits>

#include "rtbus/clock.hpp"
#include "rtbus/detail/layout.hpp"

namespace rtbus::detail {

inline constexpr std::uint64_t kPollPeriodNs = 200 * kNsPerUs;
/// Longest single sleep: a damaged doorbell delays a reader by this, it cannot keep it.
inline constexpr std::uint64_t kLongestSleepNs = 100 * kNsPerMs;

inline void ring(Doorbell& bell) noexcept {
  bell.rings.fetch_add(1, std::memory_order_seq_cst);
  if (bell.sleepers.load(std::memory_order_seq_cst) > 0) {
    ::syscall(SYS_futex, &bell.rings, FUTEX_WAKE, INT_MAX, nullptr, nullptr, 0);
  }
}

/// Sleeps until `*newest` passes `sequence` (true) or CLOCK_MONOTONIC passes `deadline_ns` (false). `bell` null: polls.
[[nodiscard]] inline bool wait_newer(const SharedU64& newest, Doorbell* bell, std::uint64_t sequence,
                                     std::uint64_t deadline_ns) noexcept {
  if (newest.load(std::memory_order_acquire) > sequence) return true;
  if (bell == nullptr) {
    for (;;) {
      const std::uint64_t now_ns = monotonic_ns();
      if (now_ns >= deadline_ns) return false;
      sleep_until(std::min(deadline_ns, now_ns + kPollPeriodNs));
      if (newest.load(std::memory_order_acquire) > sequence) return true;
    }
  }
  bell->sleepers.fetch_add(1, std::memory_order_seq_cst);
  bool newer = false;
  for (;;) {
    const std::uint32_t seen = bell->rings.load(std::memory_order_seq_cst);
    newer = newest.load(std::memory_order_acquire) > sequence;
    const std::uint64_t now_ns = monotonic_ns();
    if (newer || now_ns >= deadline_ns) break;
    const std::uint64_t until_ns = std::min(deadline_ns, now_ns + kLongestSleepNs);
    timespec until{};
    until.tv_sec = static_cast<time_t>(until_ns / kNsPerS);
    until.tv_nsec = static_cast<long>(until_ns % kNsPerS);
    // The bitset form takes an absolute CLOCK_MONOTONIC time; not FUTEX_PRIVATE: the word is shared by processes.
    ::syscall(SYS_futex, &bell->rings, FUTEX_WAIT_BITSET, seen, &until, nullptr, FUTEX_BITSET_MATCH_ANY);
  }
  bell->sleepers.fetch_sub(1, std::memory_order_seq_cst);
  return newer;
}

}  // namespace rtbus::detail
