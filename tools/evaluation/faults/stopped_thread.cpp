#include "tools/evaluation/faults/stopped_thread.hpp"

#include <string.h>
#include <sys/ptrace.h>
#include <sys/wait.h>

#include <cerrno>
#include <charconv>
#include <filesystem>
#include <fstream>
#include <system_error>

namespace tools {

namespace {

/// The thread of that name; 0: none.
pid_t find_thread(pid_t pid, const std::string& name) {
  std::error_code gone;
  for (const auto& entry : std::filesystem::directory_iterator("/proc/" + std::to_string(pid) + "/task", gone)) {
    std::ifstream file(entry.path() / "comm");
    std::string found;
    if (!std::getline(file, found) || found != name) continue;
    const std::string number = entry.path().filename().string();
    pid_t thread = 0;
    std::from_chars(number.data(), number.data() + number.size(), thread);
    return thread;
  }
  return 0;
}

}  // namespace

rtbus::Result<StoppedThread, std::string> StoppedThread::stop(pid_t pid, const std::string& thread_name) {
  const pid_t thread = find_thread(pid, thread_name);
  const std::string who = "thread " + thread_name + " of process " + std::to_string(pid);
  if (thread == 0) return rtbus::Failure{who + " is not there"};
  if (::ptrace(PTRACE_SEIZE, thread, nullptr, nullptr) != 0) {
    return rtbus::Failure{who + " may not be traced: " + ::strerror(errno)};
  }
  int status = 0;
  if (::ptrace(PTRACE_INTERRUPT, thread, nullptr, nullptr) != 0 || ::waitpid(thread, &status, __WALL) != thread) {
    return rtbus::Failure{who + " did not stop: " + ::strerror(errno)};
  }
  return StoppedThread(thread);
}

StoppedThread::~StoppedThread() {
  if (thread_ != 0) ::ptrace(PTRACE_DETACH, thread_, nullptr, nullptr);
}

}  // namespace tools
