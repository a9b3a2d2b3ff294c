#pragma once
/// @file helpers.hpp
/// Processes that a fault needs: hogs of CPUs, forks without end. They end with the object, with the process that made
/// it, and after a time of their own.
#include <sys/types.h>

#include <cstdint>
#include <vector>

namespace tools {

/// Processes that compute without pause.
class CpuHogs {
 public:
  /// @param core To stay on; −1: any. @param fifo_priority 0: an ordinary process. @param seconds They end by then.
  CpuHogs(int count, int core, int fifo_priority, double seconds);
  ~CpuHogs();
  CpuHogs(const CpuHogs&) = delete;
  CpuHogs& operator=(const CpuHogs&) = delete;
  [[nodiscard]] bool run() const noexcept { return ok_; }
  /// When the first of them began; CLOCK_MONOTONIC.
  [[nodiscard]] std::uint64_t began_ns() const noexcept { return began_ns_; }

 private:
  std::vector<pid_t> pids_;
  std::uint64_t began_ns_ = 0;
  bool ok_ = true;
};

/// Two hogs per CPU.
[[nodiscard]] int hogs_of_a_busy_machine();

/// Forks as fast as it can, in a process group of its own, until `most` processes of that group exist; those that end
/// are replaced. It counts them itself and has a limit of CPU time, so that the machine bears it.
class ForkStorm {
 public:
  ForkStorm(int most, double seconds);
  ~ForkStorm();
  ForkStorm(const ForkStorm&) = delete;
  ForkStorm& operator=(const ForkStorm&) = delete;
  [[nodiscard]] bool run() const noexcept { return pid_ > 0; }

 private:
  pid_t pid_ = 0;
};

}  // namespace tools
