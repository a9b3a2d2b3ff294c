#pragma once
/// @file realtime.hpp
/// What a realtime thread asks of Linux, and what Linux really granted.
#include <sched.h>

#include <cstdint>
#include <string>
#include <vector>

/// Marks a function of the realtime context: it neither allocates, locks, logs, throws nor makes a system call.
/// Checked by the compiler where it can (clang >= 20), and by the traps in tests/realtime everywhere.
#if defined(__clang__) && defined(__has_cpp_attribute)
#if __has_cpp_attribute(clang::nonblocking)
#define RTBUS_NONBLOCKING [[clang::nonblocking]]
#endif
#endif
#ifndef RTBUS_NONBLOCKING
#define RTBUS_NONBLOCKING
#endif

namespace rtbus {

/// What a thread that must be on time asks for.
struct RealtimeRequest {
  int priority = 80;             ///< SCHED_FIFO priority, 1…98; 99 stays with the kernel's own threads.
  int core = -1;                 ///< CPU to stay on; −1 chooses the last core this process may use.
  bool lock_memory = true;       ///< mlockall(current and future).
  bool hold_dma_latency = true;  ///< Keep /dev/cpu_dma_latency at 0 µs: no deep CPU sleep, 6–7 times faster wake-up.
};

/// What was granted, read back from the kernel. Every refusal is a warning with its remedy.
struct RealtimeGrant {
  bool fifo = false;
  int priority = 0;
  int core = -1;  ///< −1 when the thread may wander.
  bool memory_locked = false;
  bool dma_latency_held = false;
  std::vector<std::string> warnings;  ///< One sentence each: what is missing, what it costs, how to get it.

  /// One line for the log: "SCHED_FIFO 80, core 1, memory locked, cpu_dma_latency 0 us".
  [[nodiscard]] std::string summary() const;
  /// "SCHED_FIFO" or "SCHED_OTHER", as the report prints it.
  [[nodiscard]] const char* scheduling() const noexcept { return fifo ? "SCHED_FIFO" : "SCHED_OTHER"; }
};

/// Applies `request` to the calling thread, pre-faults 256 KiB of its stack, and reads back what was granted.
/// Never fails: a refusal is in the grant. @realtime No: call it once, before the loop.
[[nodiscard]] RealtimeGrant enter_realtime(const RealtimeRequest& request);

/// Gives /dev/cpu_dma_latency back. The kernel does the same when the process ends.
void leave_realtime() noexcept;

/// How a thread was scheduled when this was made, for one that is realtime for a while only. Memory and CPU latency are
/// the process's and stay. @realtime No.
class ThreadScheduling {
 public:
  ThreadScheduling() noexcept;    ///< Of the calling thread.
  void restore() const noexcept;  ///< On the same thread: policy, priority and cores.

 private:
  int policy_ = 0;
  int priority_ = 0;
  cpu_set_t cores_{};
  bool cores_known_ = false;
};

/// Gives the calling thread a low SCHED_FIFO priority if this process may have one, so that a busy machine does not
/// delay a sign of life. Nothing else changes; no warning, since nothing unsafe follows from a refusal.
/// @returns whether it was granted. @realtime No.
bool prefer_on_time() noexcept;

/// Keeps the calling thread off CPUs that a realtime loop uses, unless it would have none left. In `cores` −1 stands
/// for the last CPU this thread may use, where a RealtimeRequest with core −1 goes. @returns whether it keeps off them.
/// @realtime No.
bool stay_off_cores(const std::vector<int>& cores) noexcept;

/// Names the calling thread (at most 15 bytes are kept).
void name_this_thread(const char* name) noexcept;

}  // namespace rtbus
