/// The realtime thread makes no system call but its one sleep: strace looks at the real haptic_node while it touches
/// the wall, answers physics and is being observed.
#include <gtest/gtest.h>
#include <signal.h>
#include <unistd.h>

#include <chrono>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <map>
#include <regex>
#include <string>
#include <thread>

#include "rtbus/messages.hpp"
#include "rtbus/subscription.hpp"
#include "tests/support/process.hpp"

#if !defined(RTBUS_SANITIZED)
namespace {

using namespace std::chrono_literals;

TEST(HapticLoop, MakesNoSystemCallButItsSleep) {
  if (std::system("strace -o /dev/null true 2>/dev/null") != 0) {
    GTEST_SKIP() << "strace is not there or may not trace here";
  }
  const std::string session = "strace" + std::to_string(getpid());
  const std::string trace = testing::TempDir() + session + ".txt";
  const std::string binaries = RTBUS_BINARY_DIR;
  const std::string config = std::string(RTBUS_SOURCE_DIR) + "/config/wall.yaml";
  const std::string rename = "session=" + session;
  tests::Child physics({binaries + "/physics_node", "--config", config, "--set", rename}, "/dev/null");
  tests::Child haptic(
      {"strace", "-f", "-qq", "-o", trace, binaries + "/haptic_node", "--config", config, "--set", rename},
      "/dev/null");

  // Somebody looks at the telemetry, so that publishing it is part of what is traced.
  rtbus::Session bus;
  bus.name = session;
  double peak_n = 0.0;
  std::uint64_t ticks = 0;
  bool deleted = false;
  std::uint64_t renewed = 0;
  {
    rtbus::Subscription<rtbus::Telemetry> reader(bus, "haptic0.telemetry", {.presence = true});
    const auto end = std::chrono::steady_clock::now() + 15s;
    while (std::chrono::steady_clock::now() < end && !(ticks > 2500 && peak_n > 0.1)) {
      std::this_thread::sleep_for(20ms);
      reader.maintain();
      rtbus::Stamped<rtbus::Telemetry> sample;
      while (reader.read_next(sample) == rtbus::ReadStatus::kFresh) {
        ticks = sample.value.tick;
        peak_n = std::max(peak_n, sample.value.force_n[1]);
      }
      // In the middle somebody deletes what the loop writes to; the hand-over is part of what is traced.
      if (!deleted && ticks > 500) {
        for (const char* topic : {"haptic0.telemetry", "haptic0.device_state"}) {
          deleted = unlink(("/dev/shm/" + rtbus::segment_name(session, topic)).c_str()) == 0;
        }
      }
      renewed = reader.attachments();
    }
  }
  // SIGTERM goes to the node itself, which names itself in its heartbeat; strace ends with it.
  auto heartbeat = rtbus::Reader<rtbus::Heartbeat>::open(bus, "haptic0.heartbeat");
  ASSERT_TRUE(heartbeat);
  rtbus::Stamped<rtbus::Heartbeat> beat;
  ASSERT_EQ(heartbeat->read_latest(beat), rtbus::ReadStatus::kFresh);
  kill(static_cast<pid_t>(beat.value.pid), SIGTERM);
  haptic.wait();
  physics.end(SIGTERM);
  ASSERT_GT(ticks, 1000u);
  EXPECT_GT(peak_n, 0.1) << "the run must have touched the wall";
  EXPECT_TRUE(deleted);
  EXPECT_EQ(renewed, 2u) << "the telemetry came back in a new segment";

  // The loop's thread is the one that takes the name haptic_loop; its cycles begin with its first sleep and end with
  // the last one. In between strace may show nothing else.
  std::ifstream in(trace);
  std::string line;
  std::string thread;
  std::vector<std::string> calls;
  const std::regex named(R"(^(\d+) +prctl\(PR_SET_NAME, "haptic_loop")");
  while (std::getline(in, line)) {
    std::smatch match;
    if (std::regex_search(line, match, named))
      thread = match[1];
    else if (!thread.empty() && line.compare(0, thread.size() + 1, thread + " ") == 0)
      calls.push_back(line.substr(thread.size() + 1));
  }
  ASSERT_FALSE(thread.empty());
  const auto is_sleep = [](const std::string& call) { return call.find("clock_nanosleep") != std::string::npos; };
  const auto first = std::find_if(calls.begin(), calls.end(), is_sleep);
  const auto last = std::find_if(calls.rbegin(), calls.rend(), is_sleep).base();
  ASSERT_NE(first, calls.begin()) << "taking priority and core needs system calls: strace must have seen them";
  std::map<std::string, int> others;
  long sleeps = 0;
  for (auto call = first; call < last; ++call) {
    if (is_sleep(*call))
      ++sleeps;
    else
      ++others[call->substr(call->find_first_not_of(' '), 60)];
  }
  for (const auto& [call, count] : others) ADD_FAILURE() << count << " x " << call;
  EXPECT_GT(sleeps, 1000);
  std::printf("%ld sleeps and %zu other system calls of haptic_loop, peak force %.2f N\n", sleeps, others.size(),
              peak_n);
  std::filesystem::remove(trace);
}

}  // namespace
#endif
