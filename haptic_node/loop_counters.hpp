#pragma once
/// @file loop_counters.hpp
/// Counters of the haptic loop.
#include <atomic>
#include <cstdint>

#include "haptic_node/link_monitor.hpp"
#include "haptic_node/safety.hpp"
#include "rtbus/histogram.hpp"
#include "rtbus/messages.hpp"
#include "rtbus/realtime.hpp"

namespace haptic {

/// Counters of the loop. Written by the loop alone, readable by any thread at any time.
struct LoopCounters {
  std::atomic<std::uint64_t> ticks{0}, ticks_due{0}, overruns{0};
  std::atomic<std::uint64_t> clamped{0}, slew_limited{0}, stale_ticks{0}, nonfinite{0}, overspeed{0},
      thermal_limited{0}, passivity_ticks{0}, device_lost{0}, losses{0}, last_loss_ns{0}, pauses{0};
  std::atomic<double> force_square_sum_n2{0.0}, force_peak_n{0.0}, energy_absorbed_j{0.0}, energy_removed_j{0.0};
  std::atomic<std::uint64_t> corrections{0};
  std::atomic<double> correction_sum_m{0.0}, correction_peak_m{0.0};
  rtbus::Histogram wakeup_ns, compute_ns, device_ns, proxy_age_ns;

  /// One cycle: what the ladder did and sent. Loop's thread. @realtime Yes.
  void count(const SafetyOutput& safe, const Passivity& passivity,
             const LinkMonitor& monitor) noexcept RTBUS_NONBLOCKING;
  /// An answer moved what was touched by that, at the device. Loop's thread. @realtime Yes.
  void count_correction(double correction_m) noexcept RTBUS_NONBLOCKING;
  /// The loop stood for too long, and the force begins anew. Loop's thread. @realtime Yes.
  void count_pause() noexcept RTBUS_NONBLOCKING;
  /// Counts and percentiles since start, without rates. Any thread; not realtime.
  [[nodiscard]] rtbus::LoopStats stats() const;
};

}  // namespace haptic
