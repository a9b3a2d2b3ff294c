#pragma once
/// @file bare_loops.hpp
/// Empty loops beside a test, one on each CPU. They tell a machine that paused from a defect.
#include <pthread.h>
#include <sched.h>

#include <algorithm>
#include <atomic>
#include <cstdint>
#include <cstdio>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include "rtbus/clock.hpp"

namespace tests {

/// How the empty loops are scheduled: as what they stand for.
enum class BareScheduling {
  kOrdinary,  ///< As physics, viewers and tools.
  kRealtime,  ///< Above the haptic loop, which they then cannot take for a pause. Ordinary where that is not allowed.
};

/// Runs from construction on. Each loop wants to wake every millisecond and notes when it was woken late.
class BareLoops {
 public:
  /// @param late_ms A wake-up that is later counts as a pause.
  BareLoops(BareScheduling scheduling, double late_ms)
      : scheduling_(scheduling), late_ns_(static_cast<std::uint64_t>(late_ms * 1e6)), begin_ns_(rtbus::monotonic_ns()) {
    cpu_set_t mine;
    CPU_ZERO(&mine);
    (void)::sched_getaffinity(0, sizeof mine, &mine);
    for (int cpu = 0; cpu < CPU_SETSIZE; ++cpu) {
      if (CPU_ISSET(cpu, &mine)) loops_.emplace_back([this, cpu] { run(cpu); });
    }
  }
  ~BareLoops() {
    stop_ = true;
    for (std::thread& loop : loops_) loop.join();
  }
  BareLoops(const BareLoops&) = delete;
  BareLoops& operator=(const BareLoops&) = delete;

  [[nodiscard]] std::size_t pauses() const {
    const std::lock_guard lock(mutex_);
    return pauses_.size();
  }
  /// The longest time up to now without a pause on any CPU, in s.
  [[nodiscard]] double longest_quiet_s() const {
    const std::lock_guard lock(mutex_);
    std::vector<Pause> pauses = pauses_;
    std::sort(pauses.begin(), pauses.end(), [](const Pause& a, const Pause& b) { return a.from_ns < b.from_ns; });
    std::uint64_t quiet_from_ns = begin_ns_, longest_ns = 0;
    for (const Pause& pause : pauses) {
      if (pause.from_ns > quiet_from_ns) longest_ns = std::max(longest_ns, pause.from_ns - quiet_from_ns);
      quiet_from_ns = std::max(quiet_from_ns, pause.to_ns);
    }
    const std::uint64_t now_ns = rtbus::monotonic_ns();
    return 1e-9 * static_cast<double>(std::max(longest_ns, now_ns - std::min(now_ns, quiet_from_ns)));
  }
  /// For whoever reads why a test was not judged.
  [[nodiscard]] std::string text() const {
    const double quiet_s = longest_quiet_s();
    const std::lock_guard lock(mutex_);
    std::uint64_t longest_ns = 0;
    for (const Pause& pause : pauses_) longest_ns = std::max(longest_ns, pause.to_ns - pause.from_ns);
    char out[160];
    std::snprintf(out, sizeof out,
                  "machine too busy: bare loops woke late %zu times, up to %.0f ms; longest quiet time %.2f s",
                  pauses_.size(), 1e-6 * static_cast<double>(longest_ns), quiet_s);
    return out;
  }

 private:
  struct Pause {
    std::uint64_t from_ns, to_ns;
  };

  void run(int cpu) {
    cpu_set_t one;
    CPU_ZERO(&one);
    CPU_SET(cpu, &one);
    (void)::pthread_setaffinity_np(::pthread_self(), sizeof one, &one);
    constexpr sched_param kAboveTheLoop{.sched_priority = 90};
    if (scheduling_ == BareScheduling::kRealtime)
      (void)::pthread_setschedparam(::pthread_self(), SCHED_FIFO, &kAboveTheLoop);
    while (!stop_) {
      const std::uint64_t due_ns = rtbus::monotonic_ns() + rtbus::kNsPerMs;
      rtbus::sleep_until(due_ns);
      const std::uint64_t now_ns = rtbus::monotonic_ns();
      if (now_ns <= due_ns + late_ns_) continue;
      const std::lock_guard lock(mutex_);
      pauses_.push_back({due_ns, now_ns});
    }
  }

  BareScheduling scheduling_;
  std::uint64_t late_ns_, begin_ns_;
  mutable std::mutex mutex_;
  std::vector<Pause> pauses_;
  std::atomic<bool> stop_{false};
  std::vector<std::thread> loops_;
};

/// What a measurement says that a pause of the machine can spoil.
enum class Judged {
  kHolds,
  kFails,
  kPaused,  ///< The machine paused in each of the tries.
};

/// Measures until the figure holds, or until it does not although the machine did not pause meanwhile.
/// @param holds One measurement; whether its figure is as wanted. @param machine Gets what is to be said of kPaused.
template <class Holds>
[[nodiscard]] Judged judge_when_quiet(BareScheduling scheduling, double late_ms, int tries, std::string& machine,
                                      Holds&& holds) {
  for (int i = 0; i < tries; ++i) {
    const BareLoops bare(scheduling, late_ms);
    if (holds()) return Judged::kHolds;
    if (bare.pauses() == 0) return Judged::kFails;
    machine = bare.text();
  }
  return Judged::kPaused;
}

}  // namespace tests
