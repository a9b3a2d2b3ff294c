#pragma once
/// @file process.hpp
/// Child processes of a test: started, signalled, and never left behind.
#include <fcntl.h>
#include <signal.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <dirent.h>
#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "rtbus/clock.hpp"

namespace tests {

/// A running program; killed at the latest by the destructor, and by the kernel when the test dies.
class Child {
 public:
  explicit Child(const std::vector<std::string>& command, const std::string& output_file = "") {
    std::vector<char*> arguments;
    for (const std::string& word : command) arguments.push_back(const_cast<char*>(word.c_str()));
    arguments.push_back(nullptr);
    pid_ = fork();
    if (pid_ != 0) return;
    prctl(PR_SET_PDEATHSIG, SIGKILL);
    if (!output_file.empty()) {
      const int out = ::open(output_file.c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0600);
      dup2(out, STDOUT_FILENO);
      dup2(out, STDERR_FILENO);
    }
    execvp(arguments[0], arguments.data());
    _exit(127);
  }
  Child(Child&& other) noexcept : pid_(std::exchange(other.pid_, -1)) {}
  Child& operator=(Child&& other) noexcept {
    std::swap(pid_, other.pid_);
    return *this;
  }
  ~Child() { (void)end(SIGKILL); }

  [[nodiscard]] pid_t pid() const noexcept { return pid_; }
  void signal(int number) const {
    if (pid_ > 0) ::kill(pid_, number);
  }
  /// True once it has ended by itself; `status` is then that of waitpid().
  [[nodiscard]] bool has_ended(int& status) {
    if (pid_ <= 0 || ::waitpid(pid_, &status, WNOHANG) != pid_) return false;
    pid_ = -1;
    return true;
  }

  /// Signals, waits, and gives the status of waitpid().
  int end(int number) {
    if (pid_ <= 0) return 0;
    ::kill(pid_, number);
    if (number == SIGKILL) ::kill(pid_, SIGCONT);
    return wait();
  }
  int wait() {
    int status = 0;
    waitpid(std::exchange(pid_, -1), &status, 0);
    return status;
  }

 private:
  pid_t pid_ = -1;
};

/// Names in /dev/shm that belong to `session`.
inline std::vector<std::string> segments_of(const std::string& session) {
  std::vector<std::string> out;
  const std::string prefix = "rtbus." + session + ".";
  if (DIR* const folder = opendir("/dev/shm")) {
    while (const dirent* const entry = readdir(folder)) {
      if (std::string(entry->d_name).starts_with(prefix)) out.emplace_back(entry->d_name);
    }
    closedir(folder);
  }
  return out;
}

/// Polls `condition` every 5 ms for at most `timeout_s`; false when it never came true.
template <class Condition>
bool eventually(double timeout_s, Condition condition) {
  const std::uint64_t end_ns = rtbus::monotonic_ns() + static_cast<std::uint64_t>(timeout_s * 1e9);
  while (!condition()) {
    if (rtbus::monotonic_ns() > end_ns) return false;
    usleep(5000);
  }
  return true;
}

}  // namespace tests
