#pragma once
/// @file bare_loop.hpp
/// A loop that does nothing, beside the haptic loop, at the same time. Its overruns are caused by the kernel or the
/// hypervisor, not by the haptic node.
#include <atomic>
#include <cstdint>
#include <string>
#include <thread>

#include "rtbus/histogram.hpp"
#include "rtbus/pacer.hpp"
#include "rtbus/realtime.hpp"

namespace tools {

/// The same loop without any work, beside the haptic loop.
struct BareLoopFigures {
  std::string beside;  ///< "haptic0"
  double rate_hz = 0.0;
  std::string scheduling;  ///< "SCHED_FIFO" or "SCHED_OTHER".
  std::string granted;     ///< RealtimeGrant::summary().
  std::uint64_t ticks = 0, due = 0, overruns = 0;
  double wakeup_p50_us = 0.0, wakeup_p99_us = 0.0, wakeup_p999_us = 0.0, wakeup_max_us = 0.0;
};

struct BareLoopOptions {
  std::uint64_t period_ns = 1'000'000;
  std::uint64_t phase_ns = 0;  ///< A deadline of the haptic loop; ours lie half a period beside it.
  int core = -1;               ///< Where the haptic loop runs; −1: it was not pinned.
  int priority = 79;           ///< One below the haptic loop, so that we never delay it.
};

/// Runs from construction to stop(). One owner thread; the figures are complete after stop().
class BareLoop {
 public:
  explicit BareLoop(const BareLoopOptions& options);
  ~BareLoop() { stop(); }
  BareLoop(const BareLoop&) = delete;
  BareLoop& operator=(const BareLoop&) = delete;

  void stop() noexcept;  ///< Idempotent.

  [[nodiscard]] const rtbus::Pacer& pacer() const noexcept { return pacer_; }
  [[nodiscard]] const rtbus::Histogram& wakeup_ns() const noexcept { return wakeup_ns_; }
  [[nodiscard]] const rtbus::RealtimeGrant& grant() const noexcept { return grant_; }
  /// For a report. @param beside, rate_hz Name and rate of the haptic loop.
  [[nodiscard]] BareLoopFigures figures(const std::string& beside, double rate_hz) const;

 private:
  void run() noexcept;

  BareLoopOptions options_;
  rtbus::Pacer pacer_;
  rtbus::Histogram wakeup_ns_;
  rtbus::RealtimeGrant grant_;
  std::atomic<bool> stop_{false};
  std::thread thread_;
};

}  // namespace tools
