#pragma once
/// @file stopped_thread.hpp
/// One thread of another process, stopped while the others go on: a hung engine whose process still says that it lives.
#include <sys/types.h>

#include <string>

#include "rtbus/result.hpp"

namespace tools {

/// Goes on when this object is gone. By ptrace(2): the process must be a descendant of this one, and the one thread
/// that stops it must be the one that lets it go. SIGSTOP would not do: it stops all threads.
class StoppedThread {
 public:
  /// @param thread_name As the kernel knows it: "physics_step". The error is one sentence.
  [[nodiscard]] static rtbus::Result<StoppedThread, std::string> stop(pid_t pid, const std::string& thread_name);
  StoppedThread(StoppedThread&& other) noexcept : thread_(other.thread_) { other.thread_ = 0; }
  StoppedThread& operator=(StoppedThread&&) = delete;
  ~StoppedThread();

 private:
  explicit StoppedThread(pid_t thread) : thread_(thread) {}
  pid_t thread_ = 0;
};

}  // namespace tools
