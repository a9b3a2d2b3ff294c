/// The realtime thread makes no system call but its one sleep: strace looks at the real haptic_node while it touches
/// something, answers physics and is being observed.
#include <gtest/gtest.h>
#include <signal.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <map>
#include <ostream>
#include <regex>
#include <set>
#include <string>
#include <thread>
#include <vector>

#include "rtbus/messages.hpp"
#include "rtbus/subscription.hpp"
#include "tests/support/process.hpp"

#if !defined(RTBUS_SANITIZED)
namespace {

using namespace std::chrono_literals;

bool strace_works() { return std::system("strace -o /dev/null true 2>/dev/null") == 0; }

std::vector<std::string> under_strace(const std::string& trace, std::vector<std::string> command) {
  command.insert(command.begin(), {"strace", "-f", "-qq", "-o", trace});
  return command;
}

/// What the loop's thread asked of the kernel in its cycles.
struct LoopCalls {
  bool thread_seen = false;
  bool seen_before_cycles = false;  ///< Taking priority and core needs system calls: strace must have seen them.
  long sleeps = 0;
  std::set<std::string> bells;  ///< Addresses of the futexes by which it meets the device that paces it.
  std::map<std::string, int> others;
};

/// The loop's thread is the one that takes the name haptic_loop; its cycles begin with its first sleep and end with the
/// last one. `paced`: by its device; it then sleeps on a futex, and wakes the device's thread by another.
LoopCalls calls_of_the_loop(const std::string& trace, bool paced = false) {
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
  LoopCalls out;
  out.thread_seen = !thread.empty();
  const auto has = [](const std::string& call, const char* text) { return call.find(text) != std::string::npos; };
  const auto is_sleep = [&](const std::string& call) {
    return has(call, "clock_nanosleep") || (paced && has(call, "FUTEX_WAIT_BITSET"));
  };
  const auto first = std::find_if(calls.begin(), calls.end(), is_sleep);
  const auto last = std::find_if(calls.rbegin(), calls.rend(), is_sleep).base();
  out.seen_before_cycles = first != calls.begin();
  const std::regex on_futex(R"(^ *futex\((0x[0-9a-f]+))");
  for (auto call = first; call < last; ++call) {
    std::smatch futex;
    if (paced && std::regex_search(*call, futex, on_futex)) out.bells.insert(futex[1]);
    if (is_sleep(*call))
      ++out.sleeps;
    else if (!paced || !has(*call, "futex"))
      ++out.others[call->substr(call->find_first_not_of(' '), 60)];
  }
  return out;
}

TEST(LoopTrace, ShowsASystemCallThatDoesNotBelongThere) {
  if (!strace_works()) GTEST_SKIP() << "strace is not there or may not trace here";
  const std::string trace = testing::TempDir() + "planted" + std::to_string(getpid()) + ".txt";
  tests::Child planted(under_strace(trace, {std::string(RTBUS_BINARY_DIR) + "/planted_call"}), "/dev/null");
  EXPECT_EQ(planted.wait(), 0);
  const LoopCalls calls = calls_of_the_loop(trace);
  EXPECT_TRUE(calls.thread_seen);
  EXPECT_EQ(calls.sleeps, 20);
  ASSERT_EQ(calls.others.size(), 1u);
  EXPECT_EQ(calls.others.begin()->first.substr(0, 8), "getppid(");
  std::filesystem::remove(trace);
}

struct TracedSession {
  const char* name;
  const char* file;
  std::vector<std::string> settings;
  bool paced = false;
  std::uint64_t ticks = 2500;
};
void PrintTo(const TracedSession& session, std::ostream* out) { *out << session.name; }

class HapticLoop : public testing::TestWithParam<TracedSession> {};

TEST_P(HapticLoop, MakesNoSystemCallButItsSleep) {
  if (!strace_works()) GTEST_SKIP() << "strace is not there or may not trace here";
  const std::string session = "strace" + std::to_string(getpid());
  const std::string trace = testing::TempDir() + session + ".txt";
  const auto node = [&](const char* program) {
    std::vector<std::string> out{std::string(RTBUS_BINARY_DIR) + "/" + program, "--config",
                                 std::string(RTBUS_SOURCE_DIR) + "/config/" + GetParam().file, "--set",
                                 "session=" + session};
    for (const std::string& text : GetParam().settings) out.insert(out.end(), {"--set", text});
    return out;
  };
  tests::Child physics(node("physics_node"), "/dev/null");
  tests::Child haptic(under_strace(trace, node("haptic_node")), "/dev/null");

  // Somebody looks at the telemetry, so that publishing it is part of what is traced.
  rtbus::Session bus;
  bus.name = session;
  double peak_n = 0.0;
  std::uint64_t ticks = 0;
  bool deleted = false;
  std::uint64_t renewed = 0;
  {
    rtbus::Subscription<rtbus::Telemetry> reader(bus, "haptic0.telemetry", {.presence = true});
    const auto end = std::chrono::steady_clock::now() + 30s;
    while (std::chrono::steady_clock::now() < end && !(ticks > GetParam().ticks && peak_n > 0.1)) {
      std::this_thread::sleep_for(20ms);
      reader.maintain();
      rtbus::Stamped<rtbus::Telemetry> sample;
      while (reader.read_next(sample) == rtbus::ReadStatus::kFresh) {
        ticks = sample.value.tick;
        const rtbus::Vec3& force_n = sample.value.force_n;
        peak_n = std::max(peak_n, std::hypot(force_n[0], force_n[1], force_n[2]));
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
  EXPECT_GT(peak_n, 0.1) << "the run must have touched something";
  EXPECT_TRUE(deleted);
  EXPECT_EQ(renewed, 2u) << "the telemetry came back in a new segment";

  const LoopCalls calls = calls_of_the_loop(trace, GetParam().paced);
  ASSERT_TRUE(calls.thread_seen);
  ASSERT_TRUE(calls.seen_before_cycles);
  EXPECT_LE(calls.bells.size(), 2u) << "a third futex would be a lock";
  for (const auto& [call, count] : calls.others) ADD_FAILURE() << count << " x " << call;
  EXPECT_GT(calls.sleeps, 1000);
  std::printf("%ld sleeps and %zu other system calls of haptic_loop, peak force %.2f N\n", calls.sleeps,
              calls.others.size(), peak_n);
  std::filesystem::remove(trace);
}

std::vector<TracedSession> traced_sessions() {
  std::vector<TracedSession> out{{"wall", "wall.yaml", {}}};
  const std::vector<std::string> soon{"physics={engine: analytic, rate_hz: 1000}",
                                      "haptic.0.device.virtual.hand.start_s=0.1",
                                      "haptic.0.device.virtual.hand.speed_m_s=0.1"};
  out.push_back({"force_dimension", "wall_virtual_omega.yaml", soon, true, 1200});
  out.push_back({"openhaptics", "wall_virtual_touch.yaml", soon, true, 1200});
#if RTBUS_WITH_HAPLY
  out.push_back({"haply", "wall_virtual_inverse3.yaml", soon, true, 1200});
#endif
#if RTBUS_WITH_BULLET
  std::vector<std::string> push{"haptic.0.method=local_contact", "haptic.0.device.hand.start_m=[0, 0, 0.008]",
                                "haptic.0.device.hand.speed_m_s=0.02"};
  out.push_back({"free_block", "free_block.yaml", push});
  out.push_back({"stack_125", "stack_125.yaml", push});
#endif
  return out;
}

INSTANTIATE_TEST_SUITE_P(Sessions, HapticLoop, testing::ValuesIn(traced_sessions()),
                         [](const auto& session) { return std::string(session.param.name); });

}  // namespace
#endif
