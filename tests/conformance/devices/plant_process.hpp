#pragma once
/// @file plant_process.hpp
/// A simulated_plant as a child process, and the session file that it and the device under test share.
#include <fcntl.h>
#include <signal.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <atomic>
#include <filesystem>
#include <fstream>
#include <memory>
#include <string>
#include <vector>

#include "drivers/registry/registry.hpp"
#include "rtbus/config/session.hpp"

namespace drivers::testing {

/// A session file with one haptic node, `haptic0`, in a session of its own. Removed on destruction.
class SessionFile {
 public:
  /// `device` is the device's map in YAML flow style.
  explicit SessionFile(const std::string& device) {
    static std::atomic<int> count{0};
    name_ = "devtest-" + std::to_string(::getpid()) + "-" + std::to_string(count++);
    path_ = std::filesystem::temp_directory_path() / (name_ + ".yaml");
    std::ofstream(path_) << "schema: session/1\nsession: " << name_
                         << "\nscene: {schema: scene/1}\nhaptic:\n  - name: haptic0\n    device: " << device << "\n";
  }
  ~SessionFile() { std::filesystem::remove(path_); }
  SessionFile(const SessionFile&) = delete;
  SessionFile& operator=(const SessionFile&) = delete;

  [[nodiscard]] const std::string& name() const { return name_; }
  [[nodiscard]] std::string path() const { return path_.string(); }

  /// The device of the file, as haptic_node would open it.
  [[nodiscard]] std::unique_ptr<Device> open_device() const {
    rtbus::config::SessionConfig session = rtbus::config::load_session(path());
    rtbus::config::Map file = session.haptic.front().map.file_or_map("device");
    const std::unique_ptr<DeviceConfig> config = parse_device(file);
    auto device = config->open({session.session, "haptic0"});
    return device ? std::move(*device) : nullptr;
  }

  /// Topics of the session in /dev/shm.
  [[nodiscard]] std::vector<std::string> segments() const {
    std::vector<std::string> out;
    for (const auto& entry : std::filesystem::directory_iterator("/dev/shm")) {
      const std::string file = entry.path().filename().string();
      if (file.find("rtbus." + name_ + ".") != std::string::npos) out.push_back(file);
    }
    return out;
  }

 private:
  std::string name_;
  std::filesystem::path path_;
};

/// A child process that is ended with the object at the latest.
class PlantProcess {
 public:
  explicit PlantProcess(std::vector<std::string> arguments) {
    arguments.insert(arguments.begin(), std::string(RTBUS_BINARY_DIR) + "/simulated_plant");
    std::vector<char*> argv;
    for (std::string& argument : arguments) argv.push_back(argument.data());
    argv.push_back(nullptr);
    const pid_t parent = ::getpid();
    pid_ = ::fork();
    if (pid_ != 0) return;
    // In the child, where only async-signal-safe calls are allowed. A test that crashes takes its plant along.
    ::prctl(PR_SET_PDEATHSIG, SIGTERM);
    const int nowhere = ::open("/dev/null", O_WRONLY);  // its chatter would only confuse the test's output
    ::dup2(nowhere, STDOUT_FILENO);
    ::dup2(nowhere, STDERR_FILENO);
    if (::getppid() == parent) ::execv(argv[0], argv.data());
    ::_exit(127);
  }
  explicit PlantProcess(const SessionFile& session)
      : PlantProcess(std::vector<std::string>{"--config", session.path(), "--node", "haptic0"}) {}
  ~PlantProcess() { end(SIGTERM); }
  PlantProcess(const PlantProcess&) = delete;
  PlantProcess& operator=(const PlantProcess&) = delete;

  /// Sends `signal` (0: none) and waits. Exit status; minus the signal that killed it; -1000 when it never ran.
  int end(int signal) {
    if (pid_ < 0) return status_;
    if (signal != 0) ::kill(pid_, signal);
    int raw = 0;
    if (::waitpid(pid_, &raw, 0) == pid_) status_ = WIFEXITED(raw) ? WEXITSTATUS(raw) : -WTERMSIG(raw);
    pid_ = -1;
    return status_;
  }

 private:
  pid_t pid_ = -1;
  int status_ = -1000;
};

}  // namespace drivers::testing
