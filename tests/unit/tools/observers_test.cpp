// list, echo, hz, clean and top --once as a user calls them, on a topic whose type no tool was compiled against.
#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <atomic>
#include <nlohmann/json.hpp>
#include <optional>
#include <sstream>
#include <thread>

#include "rtbus/clock.hpp"
#include "rtbus/topic.hpp"
#include "tools/cli/common/command.hpp"

namespace observers {

struct Reading {
  std::array<double, 3> force_n{};
  std::uint64_t count = 0;
};

}  // namespace observers

template <>
struct rtbus::SampleTraits<observers::Reading> {
  static constexpr std::string_view kName = "test/Reading";
  using T = observers::Reading;
  static constexpr std::array kFields{RTBUS_FIELD(T, force_n, "N"), RTBUS_FIELD(T, count, "1")};
};

namespace {

using observers::Reading;
using testing::AllOf;
using testing::HasSubstr;
using testing::Not;

struct Outcome {
  int status = -1;
  std::string out, err;
};

/// Parses `arguments` as `rtbus COMMAND …` does and runs the command in this process.
Outcome call(tools::Action (*add)(rtbus::Command), const std::string& arguments) {
  rtbus::CommandLine line("rtbus", "");
  const tools::Action action = add(line.root());
  Outcome outcome;
  testing::internal::CaptureStdout();
  testing::internal::CaptureStderr();
  outcome.status = line.root().complaint_about(arguments) ? tools::kExitUsage : action();
  std::fflush(stdout);
  outcome.out = testing::internal::GetCapturedStdout();
  outcome.err = testing::internal::GetCapturedStderr();
  return outcome;
}

class Observers : public testing::Test {
 protected:
  Observers() {
    session_.name = "obs-" + std::to_string(::getpid());
    auto writer = rtbus::Writer<Reading>::create(session_, "sensor.reading", {.capacity = 64});
    if (writer) writer_.emplace(std::move(*writer));
  }
  void SetUp() override { ASSERT_TRUE(writer_.has_value()); }
  ~Observers() override {
    stop_ = true;
    if (publisher_.joinable()) publisher_.join();
  }

  void publish(std::uint64_t count) { writer_->publish({{1.5, -2.0, 0.25}, count}, rtbus::monotonic_ns()); }

  /// Publishes about every millisecond until the test ends.
  void keep_publishing() {
    publisher_ = std::thread([this] {
      for (std::uint64_t i = 1; !stop_; ++i) {
        publish(i);
        rtbus::sleep_until(rtbus::monotonic_ns() + rtbus::kNsPerMs);
      }
    });
  }

  [[nodiscard]] std::string with_session(const std::string& rest) const { return rest + " --session " + session_.name; }

  rtbus::Session session_;
  std::optional<rtbus::Writer<Reading>> writer_;
  std::atomic<bool> stop_{false};
  std::thread publisher_;
};

TEST_F(Observers, EchoPrintsTheNewestSampleByTheTopicsOwnFields) {
  publish(1);
  publish(2);
  const Outcome outcome = call(tools::add_echo, with_session("sens -n 1"));
  EXPECT_EQ(outcome.status, 0) << outcome.err;
  EXPECT_THAT(outcome.out, AllOf(HasSubstr("force_n: [1.5, -2, 0.25]  # N\n"), HasSubstr("count: 2\n")));
}

TEST_F(Observers, EchoWritesEverySampleInOrderAsCsv) {
  keep_publishing();
  const Outcome outcome = call(tools::add_echo, with_session("sensor.reading --csv -n 20 --fields count"));
  EXPECT_EQ(outcome.status, 0) << outcome.err;
  std::istringstream lines(outcome.out);
  std::string line;
  std::getline(lines, line);
  EXPECT_EQ(line, "sequence [1],stamp_ns [ns],count [1]");
  std::uint64_t previous = 0;
  int rows = 0;
  while (std::getline(lines, line)) {
    const std::uint64_t count = std::stoull(line.substr(line.rfind(',') + 1));
    EXPECT_GT(count, previous);
    previous = count;
    ++rows;
  }
  EXPECT_EQ(rows, 20);
  EXPECT_THAT(outcome.err, HasSubstr("missed"));
}

// Machine-readable output is every sample in order, unless a rate is asked for.
TEST_F(Observers, EchoAsCsvKeepsToARate) {
  keep_publishing();
  for (const char* format : {"--csv", "--json"}) {
    const std::uint64_t begin_ns = rtbus::monotonic_ns();
    const Outcome outcome = call(tools::add_echo, with_session(std::string("sensor.reading --rate 50 -n 6 ") + format));
    EXPECT_EQ(outcome.status, 0) << outcome.err;
    EXPECT_GE(rtbus::seconds_between(begin_ns, rtbus::monotonic_ns()), 5 * 0.020) << "five pauses between six samples";
    EXPECT_THAT(outcome.err, Not(HasSubstr("missed"))) << "what lies between was not asked for";
  }
  EXPECT_EQ(call(tools::add_echo, with_session("sensor.reading --all --rate 50 -n 1")).status, 2);
}

TEST_F(Observers, EchoFailsWhenNothingComesInTime) {
  EXPECT_EQ(call(tools::add_echo, with_session("sensor.reading --all --timeout 0.05")).status, 1);
}

TEST_F(Observers, EchoSuggestsTheNameThatWasMeant) {
  const Outcome outcome = call(tools::add_echo, with_session("sensor.raeding"));
  EXPECT_EQ(outcome.status, 2);
  EXPECT_THAT(outcome.err, HasSubstr("did you mean sensor.reading"));
}

TEST_F(Observers, HzReportsARateFromTheStamps) {
  keep_publishing();
  const Outcome outcome = call(tools::add_hz, with_session("sensor.reading -n 30 --json"));
  EXPECT_EQ(outcome.status, 0) << outcome.err;
  const auto report = nlohmann::json::parse(outcome.out);
  EXPECT_EQ(report["topic"], "sensor.reading");
  EXPECT_GT(report["rate_hz"], 0.0);
  EXPECT_GE(report["period_us"]["max"], report["period_us"]["min"]);
}

TEST_F(Observers, HzFailsWhenNothingArrives) {
  const Outcome outcome = call(tools::add_hz, with_session("sensor.reading --timeout 0.05"));
  EXPECT_EQ(outcome.status, 1);
  EXPECT_THAT(outcome.err, HasSubstr("nothing arrives"));
}

TEST_F(Observers, ListShowsTypeFieldsAndLivingWriter) {
  publish(1);
  const Outcome text = call(tools::add_list, with_session("--fields"));
  EXPECT_EQ(text.status, 0);
  EXPECT_THAT(text.out,
              AllOf(HasSubstr("test/Reading"), HasSubstr(std::to_string(::getpid()) + " alive"), HasSubstr("force_n")));
  const auto report = nlohmann::json::parse(call(tools::add_list, with_session("--json")).out);
  const auto& topic = report["sessions"][0]["topics"][0];
  EXPECT_EQ(topic["published"], 1);
  EXPECT_EQ(topic["writer"]["alive"], true);
  EXPECT_EQ(topic["fields"][0]["unit"], "N");
}

TEST_F(Observers, ListNamesADamagedSegmentWithTheReason) {
  const std::string name = "/" + rtbus::segment_name(session_.name, "sensor.damaged");
  const int fd = ::shm_open(name.c_str(), O_CREAT | O_RDWR, 0600);
  ASSERT_GE(fd, 0);
  EXPECT_EQ(::ftruncate(fd, 4096), 0);
  ::close(fd);
  const Outcome outcome = call(tools::add_list, with_session(""));
  EXPECT_THAT(outcome.out, HasSubstr("sensor.damaged: "));
  EXPECT_EQ(call(tools::add_clean, with_session("")).status, 0);
  EXPECT_EQ(::access(("/dev/shm" + name).c_str(), F_OK), -1);
}

TEST_F(Observers, CleanRemovesWhatAKilledProcessLeftAndNothingElse) {
  // The child dies without a chance to clean up.
  const pid_t child = ::fork();
  ASSERT_GE(child, 0);
  if (child == 0) {
    auto orphan = rtbus::Writer<Reading>::create(session_, "sensor.orphan");
    ::_exit(orphan.has_value() ? 0 : 1);
  }
  int status = 0;
  ASSERT_EQ(::waitpid(child, &status, 0), child);
  ASSERT_EQ(WEXITSTATUS(status), 0);

  const Outcome dry = call(tools::add_clean, with_session("--dry-run"));
  EXPECT_THAT(dry.out, AllOf(HasSubstr("would remove"), HasSubstr("sensor.orphan")));
  EXPECT_EQ(::access(("/dev/shm/" + rtbus::segment_name(session_.name, "sensor.orphan")).c_str(), F_OK), 0);

  const Outcome outcome = call(tools::add_clean, with_session(""));
  EXPECT_EQ(outcome.status, 0);
  EXPECT_THAT(outcome.out, AllOf(HasSubstr("sensor.orphan\n"), HasSubstr("removed 1 segment"),
                                 HasSubstr("sensor.reading: in use by process " + std::to_string(::getpid()))));
  EXPECT_EQ(::access(("/dev/shm/" + rtbus::segment_name(session_.name, "sensor.orphan")).c_str(), F_OK), -1);
  EXPECT_EQ(::access(("/dev/shm/" + rtbus::segment_name(session_.name, "sensor.reading")).c_str(), F_OK), 0);
}

TEST_F(Observers, TopPrintsASessionOnceForScripts) {
  publish(1);
  const Outcome outcome = call(tools::add_top, with_session("--once --json"));
  EXPECT_EQ(outcome.status, 0) << outcome.err;
  const auto report = nlohmann::json::parse(outcome.out);
  EXPECT_EQ(report["session"], session_.name);
  EXPECT_EQ(report["topics"][0]["name"], "sensor.reading");
}

TEST_F(Observers, AnUnknownSessionIsAUsageErrorEverywhere) {
  for (auto* const add : {&tools::add_echo, &tools::add_hz}) {
    const Outcome outcome = call(add, "sensor.reading --session no-such-session");
    EXPECT_EQ(outcome.status, 2);
    EXPECT_THAT(outcome.err, HasSubstr(session_.name));
  }
}

}  // namespace
