#include "tools/cli/run/supervisor.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <cstdlib>
#include <string>
#include <vector>

#include "rtbus/clock.hpp"

namespace tools {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

class SupervisorTest : public ::testing::Test {
 protected:
  static ChildSpec shell(std::string name, Stage stage, std::string script) {
    return {std::move(name), stage, "/bin/sh", {"-c", std::move(script)}};
  }
  /// Polls until `done` or for ten seconds.
  template <class Done>
  bool poll_until(const Done& done) {
    for (int i = 0; i < 2000; ++i) {
      if (auto end = supervisor_.poll()) ends_.push_back(std::move(*end));
      if (done()) return true;
      rtbus::sleep_until(rtbus::monotonic_ns() + 5 * rtbus::kNsPerMs);
    }
    return false;
  }
  [[nodiscard]] bool heard(const std::string& line) const {
    return std::find(lines_.begin(), lines_.end(), line) != lines_.end();
  }

  std::vector<std::string> lines_;
  std::vector<ChildEnd> ends_;
  Supervisor supervisor_{
      [this](const std::string& child, std::string_view line) { lines_.push_back(child + ": " + std::string(line)); }};
};

TEST_F(SupervisorTest, PassesOnWhatChildrenWrite) {
  ASSERT_TRUE(supervisor_.start(shell("a", Stage::kHaptic, "echo out; echo err >&2; printf unfinished")).has_value());
  ASSERT_TRUE(poll_until([this] { return !ends_.empty(); }));
  EXPECT_THAT(lines_, ElementsAre("a: out", "a: err", "a: unfinished"));
  EXPECT_EQ(ends_[0].how(), "ended with status 0");
}

// A hand waits with an engine that waits for its output to be read.
TEST_F(SupervisorTest, AnEngineMayPrintMuchBeforeAnybodyReads) {
  ChildSpec engine = shell("physics", Stage::kPhysics, "seq 1000001 1120000");
  engine.waits_for_reader = true;
  ASSERT_TRUE(supervisor_.start(engine).has_value());
  const pid_t pid = supervisor_.running().front().pid;
  siginfo_t ended{};
  for (int i = 0; i < 2000 && ended.si_pid == 0; ++i) {
    ASSERT_EQ(::waitid(P_PID, static_cast<id_t>(pid), &ended, WEXITED | WNOHANG | WNOWAIT), 0);
    rtbus::sleep_until(rtbus::monotonic_ns() + 5 * rtbus::kNsPerMs);
  }
  EXPECT_EQ(ended.si_pid, pid) << "it waits for a reader of its 960 kB";
  ASSERT_TRUE(poll_until([this] { return !ends_.empty(); }));
  EXPECT_EQ(lines_.size(), 120000U);
  EXPECT_EQ(lines_.back(), "physics: 1120000");
}

TEST_F(SupervisorTest, CutsALongLineInPieces) {
  ASSERT_TRUE(supervisor_.start(shell("a", Stage::kHaptic, "head -c 10000 /dev/zero | tr '\\0' x; echo")).has_value());
  ASSERT_TRUE(poll_until([this] { return !ends_.empty(); }));
  std::size_t all = 0;
  for (const std::string& line : lines_) {
    EXPECT_LE(line.size(), 3 + 4096U);
    all += line.size() - 3;  // "a: "
  }
  EXPECT_EQ(all, 10000U);
}

TEST_F(SupervisorTest, TellsHowAChildEndedAndItsLastWords) {
  ASSERT_TRUE(supervisor_.start(shell("a", Stage::kHaptic, "echo no device; exit 3")).has_value());
  ASSERT_TRUE(poll_until([this] { return !ends_.empty(); }));
  EXPECT_EQ(ends_[0].name, "a");
  EXPECT_EQ(ends_[0].how(), "ended with status 3");
  EXPECT_THAT(ends_[0].last_words, ElementsAre("no device"));

  ASSERT_TRUE(supervisor_.start(shell("b", Stage::kHaptic, "kill -9 $$")).has_value());
  ASSERT_TRUE(poll_until([this] { return ends_.size() == 2; }));
  EXPECT_THAT(ends_[1].how(), HasSubstr("killed by signal 9"));
}

TEST_F(SupervisorTest, GivesAChildItsVariablesAndKeepsItsOwn) {
  ASSERT_EQ(::setenv("RTBUS_TEST_KEPT", "ours", 1), 0);
  ChildSpec child = shell("a", Stage::kHaptic, "echo $RTBUS_TEST_KEPT $RTBUS_TEST_NEW");
  child.environment = {{"RTBUS_TEST_KEPT", "its own"}, {"RTBUS_TEST_NEW", "new"}};
  ASSERT_TRUE(supervisor_.start(child).has_value());
  EXPECT_STREQ(::getenv("RTBUS_TEST_KEPT"), "ours");
  EXPECT_EQ(::getenv("RTBUS_TEST_NEW"), nullptr);
  ASSERT_TRUE(poll_until([this] { return !ends_.empty(); }));
  EXPECT_THAT(lines_, ElementsAre("a: its own new"));
  ::unsetenv("RTBUS_TEST_KEPT");
}

TEST_F(SupervisorTest, RefusesAProgramThatIsNotThere) {
  const auto started = supervisor_.start({"a", Stage::kHaptic, "/nowhere/haptic_node", {}});
  ASSERT_FALSE(started.has_value());
  EXPECT_THAT(started.error(), HasSubstr("/nowhere/haptic_node"));
  EXPECT_TRUE(supervisor_.running().empty());
}

TEST_F(SupervisorTest, EndsHapticThenPhysicsThenPlant) {
  // Each says when it has set its trap, and again when the signal has come.
  const std::string obey = "trap 'echo over; exit 0' TERM; echo ready; while :; do sleep 0.01; done";
  ASSERT_TRUE(supervisor_.start(shell("plant", Stage::kPlant, obey)).has_value());
  ASSERT_TRUE(supervisor_.start(shell("physics", Stage::kPhysics, obey)).has_value());
  ASSERT_TRUE(supervisor_.start(shell("haptic", Stage::kHaptic, obey)).has_value());
  ASSERT_TRUE(poll_until([this] { return lines_.size() == 3; }));
  lines_.clear();
  EXPECT_TRUE(supervisor_.end_all().empty());
  EXPECT_THAT(lines_, ElementsAre("haptic: over", "physics: over", "plant: over"));
}

TEST_F(SupervisorTest, EndsAChildThatIsStopped) {
  ASSERT_TRUE(
      supervisor_
          .start(shell("a", Stage::kPhysics, "trap 'echo over; exit 0' TERM; echo ready; while :; do sleep 0.01; done"))
          .has_value());
  ASSERT_TRUE(poll_until([this] { return heard("a: ready"); }));
  ASSERT_EQ(::kill(supervisor_.running()[0].pid, SIGSTOP), 0);
  EXPECT_TRUE(supervisor_.end_all().empty());
  EXPECT_TRUE(heard("a: over"));
}

TEST_F(SupervisorTest, KillsAChildThatDoesNotEnd) {
  ASSERT_TRUE(supervisor_.start(shell("a", Stage::kHaptic, "trap '' TERM; echo ready; while :; do sleep 0.01; done"))
                  .has_value());
  ASSERT_TRUE(poll_until([this] { return heard("a: ready"); }));
  const std::vector<ChildEnd> bad = supervisor_.end_all();
  ASSERT_EQ(bad.size(), 1u);
  EXPECT_TRUE(bad[0].killed);
  EXPECT_THAT(bad[0].how(), HasSubstr("did not end within"));
}

TEST_F(SupervisorTest, GivesEachChildAProcessGroupOfItsOwn) {
  ASSERT_TRUE(supervisor_.start(shell("a", Stage::kHaptic, "echo ready; exec sleep 60")).has_value());
  ASSERT_TRUE(poll_until([this] { return heard("a: ready"); }));
  const pid_t pid = supervisor_.running()[0].pid;
  EXPECT_EQ(::getpgid(pid), pid);
  EXPECT_EQ(supervisor_.end_all().size(), 1u);  // sleep dies of SIGTERM: not a status of zero
}

TEST_F(SupervisorTest, LeavesNoChildBehindWhenItsThreadOrProcessDies) {
  // A process of its own supervises; it is killed without a chance to end its child.
  int ends[2];
  ASSERT_EQ(::pipe(ends), 0);
  const pid_t other = ::fork();
  if (other == 0) {
    Supervisor own{nullptr};
    (void)own.start(shell("a", Stage::kHaptic, "exec sleep 60"));
    const pid_t child = own.running()[0].pid;
    (void)!::write(ends[1], &child, sizeof child);
    ::kill(::getpid(), SIGKILL);
  }
  pid_t child = 0;
  ASSERT_EQ(::read(ends[0], &child, sizeof child), static_cast<ssize_t>(sizeof child));
  int status = 0;
  ASSERT_EQ(::waitpid(other, &status, 0), other);
  bool gone = false;
  for (int i = 0; i < 2000 && !gone; ++i) {
    // Nobody may be there to bury it: a zombie is dead enough. Its command line is empty then.
    gone = ::kill(child, 0) != 0 && errno == ESRCH;
    if (!gone) {
      char path[64];
      std::snprintf(path, sizeof path, "/proc/%d/cmdline", child);
      std::FILE* const file = std::fopen(path, "r");
      gone = file == nullptr || std::fgetc(file) == EOF;
      if (file != nullptr) std::fclose(file);
    }
    rtbus::sleep_until(rtbus::monotonic_ns() + 5 * rtbus::kNsPerMs);
  }
  EXPECT_TRUE(gone);
  ::close(ends[0]);
  ::close(ends[1]);
}

}  // namespace
}  // namespace tools
