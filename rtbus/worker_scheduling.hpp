#pragma once
/// @file worker_scheduling.hpp
/// How a thread is scheduled that works at a rate beside realtime loops, as physics: before ordinary programs, as long
/// as it leaves them something.
#include <sys/types.h>

#include <atomic>
#include <cstdint>
#include <ctime>
#include <string>

namespace rtbus {

/// The nice value of a worker that does not rest enough: it weighs 28 ordinary threads (`sched(7)`), and yet leaves
/// them something when it never sleeps.
inline constexpr int kWorkerNice = -15;

/// The SCHED_FIFO priority of a worker that rests: below every loop and every sign of life (`prefer_on_time`).
inline constexpr int kWorkerPriority = 2;

/// Whether a worker rests for half of its time. It saves up the CPU time that it leaves unused of that half, at most
/// `kMost_s`. One that has saved it all rests; one that has used it up does not. So a single step without end is seen
/// after 2 · `kMost_s`, and a share that wavers about a half does not switch to and fro.
class RestAccount {
 public:
  static constexpr double kShare = 0.5;
  static constexpr double kMost_s = 0.1;

  /// @param wall_s, cpu_s What has passed, and what the worker has computed, since the last call (s).
  void add(double wall_s, double cpu_s) noexcept;
  [[nodiscard]] bool rests() const noexcept { return rests_; }

 private:
  double saved_s_ = 0.0;
  bool rests_ = false;
};

/// Gives the worker `kWorkerPriority` while it rests for half of its time, and `kWorkerNice` else, each as far as this
/// process may (CAP_SYS_NICE; RLIMIT_RTPRIO; RLIMIT_NICE of 35 or more). A refusal is no warning: nothing unsafe
/// follows.
///
/// Two threads: the worker calls enter() and leave(), one that is always on time calls watch().
class WorkerScheduling {
 public:
  /// The calling thread is the worker from now on.
  void enter() noexcept;
  /// The worker ends. The last thing that it does.
  void leave() noexcept { worker_.store(0, std::memory_order_release); }
  /// Looks how much the worker has computed, and switches it. Call it every 20 ms or so.
  void watch() noexcept;
  /// "SCHED_FIFO" or "SCHED_OTHER", as granted. Of the thread that calls watch().
  [[nodiscard]] const char* policy() const noexcept { return fifo_ ? "SCHED_FIFO" : "SCHED_OTHER"; }
  /// One line: "SCHED_FIFO 2", "nice -15", or "no priority". Of the same thread.
  [[nodiscard]] std::string summary() const;

 private:
  std::atomic<pid_t> worker_{0};  // 0: none, or not yet
  clockid_t cpu_clock_{};         // of the worker; this and nice_ are written before worker_
  bool nice_ = false;
  RestAccount account_;
  std::uint64_t seen_ns_ = 0, computed_ns_ = 0;
  bool fifo_ = false;
};

}  // namespace rtbus
