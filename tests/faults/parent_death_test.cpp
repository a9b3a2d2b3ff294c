/// The parent-death signal of a program with file capabilities, which is how ordinary users get realtime rights: the
/// kernel forgets what the supervisor asked for on its behalf (prctl(2), PR_SET_PDEATHSIG), so the program asks again.
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/prctl.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include "rtbus/parent_death.hpp"
#include "tests/support/process.hpp"

namespace {

namespace fs = std::filesystem;

constexpr uid_t kNobody = 65534;

/// Neither gone nor a zombie.
bool runs(pid_t pid) {
  std::ifstream file("/proc/" + std::to_string(pid) + "/stat");
  std::string text;
  if (!std::getline(file, text)) return false;
  const char state = text[text.rfind(')') + 2];
  return state != 'Z' && state != 'X';
}

class ParentDeath : public testing::Test {
 protected:
  void SetUp() override {
    if (::geteuid() != 0) GTEST_SKIP() << "only root can give a program capabilities and become somebody else";
    fs::create_directories(folder_);
    ::chmod(folder_.c_str(), 0755);
  }
  void TearDown() override { fs::remove_all(folder_); }

  /// A copy with CAP_IPC_LOCK; "" where the file system or this container does not allow it.
  std::string with_capability(const std::string& program) {
    const fs::path copy = folder_ / fs::path(program).filename();
    fs::copy_file(program, copy, fs::copy_options::overwrite_existing);
    ::chmod(copy.c_str(), 0755);
    const std::string command = "setcap cap_ipc_lock+ep " + copy.string() + " 2>/dev/null";
    return std::system(command.c_str()) == 0 ? copy.string() : "";
  }

  /// An ordinary user's supervisor starts `command` with the parent-death signal, and is killed once `ready(pid)` is
  /// true. @returns the pid of the command.
  template <class Ready>
  static pid_t start_and_kill_supervisor(const std::vector<std::string>& command, Ready ready) {
    int ends[2];
    EXPECT_EQ(::pipe(ends), 0);
    const pid_t supervisor = ::fork();
    if (supervisor == 0) {
      if (::setresgid(kNobody, kNobody, kNobody) != 0 || ::setresuid(kNobody, kNobody, kNobody) != 0) ::_exit(1);
      ::setenv(rtbus::kSupervisorVariable, std::to_string(::getpid()).c_str(), 1);
      const pid_t child = ::fork();
      if (child == 0) {
        ::prctl(PR_SET_PDEATHSIG, SIGTERM);
        std::vector<char*> arguments;
        for (const std::string& word : command) arguments.push_back(const_cast<char*>(word.c_str()));
        arguments.push_back(nullptr);
        (void)!std::freopen("/dev/null", "w", stderr);
        ::execv(arguments[0], arguments.data());
        ::_exit(127);
      }
      (void)!::write(ends[1], &child, sizeof child);
      for (;;) ::pause();
    }
    ::close(ends[1]);
    pid_t child = -1;
    EXPECT_EQ(::read(ends[0], &child, sizeof child), static_cast<ssize_t>(sizeof child));
    ::close(ends[0]);
    EXPECT_TRUE(tests::eventually(15.0, [&] { return ready(child); }));
    ::kill(supervisor, SIGKILL);
    ::waitpid(supervisor, nullptr, 0);
    return child;
  }

  fs::path folder_ = fs::path("/tmp") / ("rtbus-parent-death-" + std::to_string(getpid()));
};

TEST_F(ParentDeath, EndsANodeWithFileCapabilities) {
  const std::string node = with_capability(std::string(RTBUS_BINARY_DIR) + "/physics_node");
  const std::string sleep = with_capability("/bin/sleep");
  if (node.empty() || sleep.empty()) GTEST_SKIP() << "setcap does not work here";

  // The control: a program that does not ask again survives, so the kernel does forget.
  const pid_t other = start_and_kill_supervisor({sleep, "60"}, [](pid_t pid) {
    std::error_code none;
    return fs::read_symlink("/proc/" + std::to_string(pid) + "/exe", none).filename() == "sleep";
  });
  ASSERT_GT(other, 1);
  usleep(500'000);
  const bool forgotten = runs(other);
  ::kill(other, SIGKILL);
  if (!forgotten) GTEST_SKIP() << "this kernel keeps the request: nothing to see";

  const std::string session = "pdeath" + std::to_string(getpid());
  const std::string config = (folder_ / "config").string();  // where nobody may read it
  fs::copy(std::string(RTBUS_SOURCE_DIR) + "/config", config, fs::copy_options::recursive);
  const pid_t child =
      start_and_kill_supervisor({node, "--config", config + "/wall.yaml", "--set", "session=" + session},
                                [&](pid_t) { return tests::segments_of(session).size() >= 4; });
  ASSERT_GT(child, 1);
  EXPECT_TRUE(tests::eventually(10.0, [&] { return !runs(child); })) << "nobody's node was left behind";
  if (runs(child)) ::kill(child, SIGKILL);
  EXPECT_EQ(tests::segments_of(session), std::vector<std::string>{}) << "and it ended its own way";
}

}  // namespace
