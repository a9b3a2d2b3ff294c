/// `rtbus run` as supervisor of real nodes: restarts, giving up, ending.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "rtbus/clock.hpp"
#include "tests/support/nodes.hpp"

namespace {

using namespace tests;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::Not;

class Supervision : public testing::Test {
 protected:
  Supervision() {
    bus_.name = "sv" + std::to_string(getpid()) + "-" + std::to_string(++count_);
    base_ = testing::TempDir() + bus_.name;
    report_ = base_ + ".json";
    output_ = base_ + ".txt";
  }
  ~Supervision() override {
    run_.reset();
    for (const std::string& file : {report_, output_}) std::filesystem::remove(file);
  }
  void start(const std::vector<std::string>& more = {}, std::string session_file = "") {
    if (session_file.empty()) session_file = std::string(RTBUS_SOURCE_DIR) + "/config/wall.yaml";
    std::vector<std::string> command{std::string(RTBUS_BINARY_DIR) + "/rtbus",
                                     "run",
                                     session_file,
                                     "--set",
                                     "session=" + bus_.name,
                                     "--report",
                                     report_,
                                     "--no-plots",
                                     "--no-bare-loop"};
    command.insert(command.end(), more.begin(), more.end());
    run_.emplace(command, output_);
  }
  /// The process that beats under that name now, other than `not_pid`; 0: none came in time.
  pid_t node(const std::string& name, pid_t not_pid = 0) {
    pid_t pid = 0;
    eventually(25.0, [&] {
      auto reader = Reader<rtbus::Heartbeat>::open(bus_, name + ".heartbeat");
      Stamped<rtbus::Heartbeat> beat;
      if (!reader || !reader->writer_alive() || reader->read_latest(beat) != ReadStatus::kFresh) return false;
      if (beat.value.state != static_cast<std::uint32_t>(rtbus::NodeState::kRunning)) return false;
      pid = static_cast<pid_t>(beat.value.pid);
      return pid != not_pid && ::kill(pid, 0) == 0;
    });
    return pid == not_pid ? 0 : pid;
  }
  /// Signals the process that beats under that name; fails the test when there is none.
  void signal_node(const std::string& name, int number, pid_t not_pid = 0) {
    const pid_t pid = node(name, not_pid);
    ASSERT_GT(pid, 1) << name << " does not run";  // kill(0) and kill(-1) would hit others
    ASSERT_EQ(::kill(pid, number), 0);
  }
  /// Once `rtbus run` follows the session: a crash before that is no reason to restart anything.
  void wait_until_followed() {
    ASSERT_NE(node("physics"), 0);
    ASSERT_NE(node("haptic0"), 0);
    usleep(500'000);
  }
  /// Status of `rtbus run` once it has ended by itself; −1: it did not.
  int ended_by_itself(double timeout_s = 20.0) {
    int status = -1;
    if (!eventually(timeout_s, [&] { return run_->has_ended(status); })) return -1;
    return WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
  }
  [[nodiscard]] static std::string text(const std::string& file) {
    std::ifstream in(file);
    return {std::istreambuf_iterator<char>(in), {}};
  }
  [[nodiscard]] nlohmann::json report() const { return nlohmann::json::parse(text(report_), nullptr, false); }

  static inline int count_ = 0;
  rtbus::Session bus_;
  std::string base_, report_, output_;
  std::optional<Child> run_;
};

TEST_F(Supervision, RestartsACrashedNodeAndReportsIt) {
  start();
  wait_until_followed();
  const pid_t first = node("physics"), haptic = node("haptic0");
  signal_node("physics", SIGSEGV);
  const pid_t second = node("physics", first);
  ASSERT_NE(second, 0);
  EXPECT_EQ(node("haptic0"), haptic) << "the other one went on";
  usleep(300'000);
  EXPECT_EQ(run_->end(SIGINT), 0) << text(output_);
  EXPECT_THAT(segments_of(bus_.name), IsEmpty());
  const auto json = report();
  ASSERT_EQ(json["restarts"].size(), 1u);
  const auto& restart = json["restarts"][0];
  EXPECT_EQ(restart["node"], "physics");
  EXPECT_EQ(restart["signal"], SIGSEGV);
  EXPECT_TRUE(restart["exit_status"].is_null());
  EXPECT_DOUBLE_EQ(restart["delay_s"].get<double>(), 0.25);
  EXPECT_GT(restart["at_s"].get<double>(), 0.0);
  EXPECT_EQ(json["physics"]["restarts"], 1);
  EXPECT_EQ(json["haptic"][0]["restarts"], 0);
  EXPECT_GT(json["physics"]["cpu_s_per_s"].get<double>(), 0.0) << "the dead process counts too";
  EXPECT_THAT(json["faults"], IsEmpty());
  EXPECT_THAT(text(output_), HasSubstr("started again in 0.25 s"));
}

TEST_F(Supervision, GivesUpAfterTooManyCrashesAndEndsTheOthersCleanly) {
  start({"--set", "supervise.restarts=1", "--set", "supervise.first_delay_s=0.1"});
  wait_until_followed();
  const pid_t first = node("physics");
  signal_node("physics", SIGKILL);
  signal_node("physics", SIGKILL, first);
  EXPECT_EQ(ended_by_itself(), 1);
  EXPECT_THAT(text(output_), HasSubstr("given up"));
  EXPECT_THAT(text(output_), HasSubstr("ended at zero force")) << "the haptic node ended its own way";
  EXPECT_THAT(segments_of(bus_.name), IsEmpty());
  EXPECT_EQ(report()["ended"], "failure");
  EXPECT_EQ(report()["restarts"].size(), 1u);
  EXPECT_EQ(report()["faults"].size(), 1u);
}

TEST_F(Supervision, RestartsNothingWithNoRestart) {
  start({"--no-restart"});
  wait_until_followed();
  signal_node("physics", SIGKILL);
  EXPECT_EQ(ended_by_itself(), 1);
  EXPECT_THAT(text(output_), HasSubstr("restarts are switched off"));
  EXPECT_THAT(segments_of(bus_.name), IsEmpty());
}

TEST_F(Supervision, DoesNotRepeatAStartWithAWrongConfiguration) {
  // The file is damaged while the session runs; the successor refuses it, and nothing is tried again.
  const std::string folder = base_ + ".config", file = folder + "/wall.yaml";
  std::filesystem::copy(std::string(RTBUS_SOURCE_DIR) + "/config", folder, std::filesystem::copy_options::recursive);
  start({}, file);
  wait_until_followed();
  std::ofstream(file, std::ios::app) << "nonsense: 1\n";
  signal_node("physics", SIGKILL);
  EXPECT_EQ(ended_by_itself(), 1);
  EXPECT_THAT(text(output_), HasSubstr("status 2, which another start would not change"));
  EXPECT_THAT(text(output_), HasSubstr("nonsense is not a known key")) << "the node's own words";
  EXPECT_THAT(segments_of(bus_.name), IsEmpty());
  EXPECT_EQ(report()["restarts"].size(), 1u);
  std::filesystem::remove_all(folder);
}

TEST_F(Supervision, EndsWhenANodeWasEndedBySomebodyElse) {
  start();
  wait_until_followed();
  signal_node("physics", SIGTERM);
  EXPECT_EQ(ended_by_itself(), 1);
  EXPECT_THAT(text(output_), HasSubstr("which was not requested"));
  EXPECT_THAT(segments_of(bus_.name), IsEmpty());
}

TEST_F(Supervision, EndsCleanlyByEachSignalAlsoDuringABackOff) {
  for (const int signal : {SIGTERM, SIGHUP}) {
    start();
    wait_until_followed();
    EXPECT_EQ(run_->end(signal), 0) << text(output_);
    EXPECT_THAT(segments_of(bus_.name), IsEmpty());
  }
  start({"--set", "supervise.first_delay_s=30", "--set", "supervise.longest_delay_s=30"});
  wait_until_followed();
  signal_node("physics", SIGKILL);
  usleep(300'000);
  EXPECT_EQ(WEXITSTATUS(run_->end(SIGINT)), 1) << "one node was still away";
  EXPECT_THAT(text(output_), HasSubstr("was not back when the session ended"));
  EXPECT_THAT(segments_of(bus_.name), IsEmpty());
}

TEST_F(Supervision, EndsAStoppedNodeToo) {
  start();
  wait_until_followed();
  signal_node("haptic0", SIGSTOP);
  EXPECT_EQ(run_->end(SIGTERM), 0) << text(output_);
  EXPECT_THAT(segments_of(bus_.name), IsEmpty());
}

/// A pipe that takes nothing any more and that nobody reads.
class FullPipe {
 public:
  FullPipe() {
    EXPECT_EQ(::pipe2(ends_, O_CLOEXEC), 0);
    ::fcntl(ends_[1], F_SETFL, O_NONBLOCK);
    const std::string block(4096, 'x');
    while (::write(ends_[1], block.data(), block.size()) > 0) {
    }
    while (::write(ends_[1], "x", 1) > 0) {
    }
    ::fcntl(ends_[1], F_SETFL, 0);  // the nodes get an ordinary pipe, that blocks
  }
  ~FullPipe() {
    ::close(ends_[0]);
    ::close(ends_[1]);
  }
  [[nodiscard]] std::string path() const {
    return "/proc/" + std::to_string(getpid()) + "/fd/" + std::to_string(ends_[1]);
  }

 private:
  int ends_[2] = {-1, -1};
};

TEST_F(Nodes, EndInTimeWhenNobodyTakesTheirWords) {
  const FullPipe full;
  session_file_ = "wall_own_plant.yaml";
  Child plant(command("simulated_plant", {"--node", "haptic0"}), full.path());
  Child physics(command("physics_node"), full.path());
  Child haptic(command("haptic_node"), full.path());
  auto ticks = reader<Telemetry>("haptic0.telemetry");
  ASSERT_TRUE(ticks);
  ASSERT_TRUE(follow(*ticks, 15.0, [](const auto& tick) { return norm(tick.value.force_n) > 0.3; }));
  // Something to say: physics is lost, and comes back.
  physics.signal(SIGSTOP);
  usleep(300'000);
  physics.signal(SIGCONT);
  ASSERT_TRUE(follow(*ticks, 15.0, [](const auto& tick) { return norm(tick.value.force_n) > 0.3; }));
  for (Child* const child : {&haptic, &physics, &plant}) {
    child->signal(SIGTERM);
    int status = -1;
    EXPECT_TRUE(eventually(10.0, [&] { return child->has_ended(status); }));
    EXPECT_EQ(status, 0);
  }
  EXPECT_THAT(segments_of(bus_.name), IsEmpty());
}

}  // namespace
