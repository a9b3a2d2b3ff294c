#pragma once
/// @file wakeup_probe.hpp
/// A bare loop that does nothing but wake up on time: what this machine can give, before any haptics.
#include <cstdint>
#include <functional>

#include "rtbus/realtime.hpp"

namespace tools {

struct WakeupOptions {
  double rate_hz = 1000.0;
  double duration_s = 2.0;
  rtbus::RealtimeRequest request{};  ///< As a haptic node asks.
};

struct WakeupFigures {
  rtbus::RealtimeGrant grant;                                      ///< What the loop's thread was given.
  std::uint64_t due = 0;                                           ///< Periods that passed.
  std::uint64_t served = 0;                                        ///< Cycles that ran.
  std::uint64_t overruns = 0;                                      ///< Periods skipped; due = served + overruns.
  double p50_us = 0.0, p99_us = 0.0, p999_us = 0.0, max_us = 0.0;  ///< Wake-up after the deadline.
};

/// Runs the loop in a thread of its own (`wakeup_probe`), paced as the haptic loop is; memory is unlocked and
/// /dev/cpu_dma_latency given back afterwards. Ends early when a signal comes (see interrupt.hpp).
/// @param progress Called from the calling thread about ten times a second with 0…1; may be empty.
[[nodiscard]] WakeupFigures probe_wakeup(const WakeupOptions& options, const std::function<void(double)>& progress);

}  // namespace tools
