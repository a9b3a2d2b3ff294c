/// The nodes as processes, and what the hand feels when one of them is stopped or killed. Times are the machine's own:
/// where it paused (a late wake-up of the haptic loop), the bound grows by that pause and by nothing else.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <fstream>
#include <optional>
#include <string>

#include "rtbus/messages.hpp"
#include "rtbus/topic.hpp"
#include "tests/support/process.hpp"

namespace {

using rtbus::kNsPerMs;
using rtbus::Reader;
using rtbus::ReadStatus;
using rtbus::Stamped;
using rtbus::Telemetry;
using tests::Child;
using tests::eventually;

constexpr std::uint32_t kStaleBit = 1u << 5;  // haptic::kStale, as docs/safety.md lists the bits

double norm(const rtbus::Vec3& v) { return std::hypot(v[0], v[1], v[2]); }

/// One session with nodes of this build, observed.
class Nodes : public testing::Test {
 protected:
  void SetUp() override {
    const auto* const test = testing::UnitTest::GetInstance()->current_test_info();
    bus_.name = std::string(test->name()).substr(0, 20) + std::to_string(getpid());
    std::transform(bus_.name.begin(), bus_.name.end(), bus_.name.begin(), ::tolower);
  }
  void TearDown() override {
    haptic_.reset();
    physics_.reset();
    plant_.reset();
    Child clean({binary("rtbus"), "clean", "--session", bus_.name}, "/dev/null");
    clean.wait();
    EXPECT_EQ(tests::segments_of(bus_.name), std::vector<std::string>{});
  }

  static std::string binary(const std::string& name) { return std::string(RTBUS_BINARY_DIR) + "/" + name; }
  std::vector<std::string> command(const std::string& program, std::vector<std::string> more = {}) {
    std::vector<std::string> out{binary(program), "--config",
                                 std::string(RTBUS_SOURCE_DIR) + "/config/" + session_file_, "--set",
                                 "session=" + bus_.name};
    out.insert(out.end(), more.begin(), more.end());
    return out;
  }
  void start_physics() { physics_.emplace(command("physics_node"), "/dev/null"); }
  void start_haptic() { haptic_.emplace(command("haptic_node"), "/dev/null"); }
  void start_plant() { plant_.emplace(command("simulated_plant", {"--node", "haptic0"}), "/dev/null"); }

  template <class T>
  std::optional<Reader<T>> reader(const std::string& topic) {
    std::optional<Reader<T>> out;
    eventually(5.0, [&] {
      auto opened = Reader<T>::open(bus_, topic, {.presence = true});
      if (opened) out.emplace(std::move(*opened));
      return out.has_value() && out->writer_alive();
    });
    return out;
  }

  /// Follows the telemetry until `condition(tick)`; false after `timeout_s`.
  template <class Condition>
  bool follow(Reader<Telemetry>& ticks, double timeout_s, Condition condition) {
    bool met = false;
    return eventually(timeout_s, [&] {
      Stamped<Telemetry> tick;
      while (!met && ticks.read_next(tick) == ReadStatus::kFresh) met = condition(tick);
      return met;
    });
  }

  rtbus::Session bus_;
  std::string session_file_ = "wall.yaml";
  std::optional<Child> physics_, haptic_, plant_;
};

/// What a loss looked like in the telemetry.
struct Loss {
  double declared_ms = -1.0;  ///< After the fault.
  double zero_ms = -1.0;      ///< Force at zero, after the declaration.
  double worst_wakeup_ms = 0.0;
};

Loss watch_loss(Reader<Telemetry>& ticks, std::uint64_t fault_ns, double watch_s) {
  Loss out;
  std::uint64_t declared_ns = 0;
  const std::uint64_t end_ns = rtbus::monotonic_ns() + static_cast<std::uint64_t>(watch_s * 1e9);
  while (rtbus::monotonic_ns() < end_ns) {
    Stamped<Telemetry> tick;
    while (ticks.read_next(tick) == ReadStatus::kFresh) {
      if (tick.stamp_ns < fault_ns) continue;
      if (out.zero_ms < 0.0) out.worst_wakeup_ms = std::max(out.worst_wakeup_ms, tick.value.wakeup_us * 1e-3);
      if (declared_ns == 0 && (tick.value.safety & kStaleBit) != 0) {
        declared_ns = tick.stamp_ns;
        out.declared_ms = static_cast<double>(tick.stamp_ns - fault_ns) * 1e-6;
      }
      if (declared_ns != 0 && out.zero_ms < 0.0 && norm(tick.value.force_n) == 0.0) {
        out.zero_ms = static_cast<double>(tick.stamp_ns - declared_ns) * 1e-6;
      }
    }
    usleep(5000);
  }
  return out;
}

TEST_F(Nodes, FadeToZeroWhilePhysicsIsStoppedAndResumeSlewLimited) {
  start_physics();
  start_haptic();
  auto ticks = reader<Telemetry>("haptic0.telemetry");
  ASSERT_TRUE(ticks);
  ASSERT_TRUE(follow(*ticks, 8.0, [](const auto& t) { return t.value.gate >= 1.0 && norm(t.value.force_n) > 0.2; }))
      << "the tip should rest on the wall";

  physics_->signal(SIGSTOP);
  const std::uint64_t stopped_ns = rtbus::monotonic_ns();
  Stamped<rtbus::LoopStats> before;
  Stamped<rtbus::LoopStats> after;
  auto stats = reader<rtbus::LoopStats>("haptic0.loop_stats");
  ASSERT_TRUE(stats);
  (void)stats->read_latest(before);
  const Loss loss = watch_loss(*ticks, stopped_ns, 5.0);
  (void)stats->read_latest(after);
  const double seconds = static_cast<double>(after.stamp_ns - before.stamp_ns) * 1e-9;
  const double served = static_cast<double>(after.value.ticks - before.value.ticks) / seconds;
  const double due = static_cast<double>(after.value.ticks_due - before.value.ticks_due) / seconds;
  std::printf(
      "stopped 5 s: lost after %.1f ms, zero %.1f ms later, worst wake-up %.2f ms, %.1f ticks/s served of %.1f due\n",
      loss.declared_ms, loss.zero_ms, loss.worst_wakeup_ms, served, due);
  EXPECT_GT(loss.declared_ms, 0.0);
  EXPECT_LE(loss.declared_ms, 60.0 + loss.worst_wakeup_ms);
  EXPECT_GE(loss.zero_ms, 0.0);
  EXPECT_LE(loss.zero_ms, 41.0 + loss.worst_wakeup_ms);
  EXPECT_NEAR(due, 1000.0, 5.0) << "the loop keeps its rate whether physics lives or not";

  // Resumption: never faster than the slew limit of the device, 3 N/ms.
  physics_->signal(SIGCONT);
  Stamped<Telemetry> last;
  double steepest_n_per_ms = 0.0;
  ASSERT_TRUE(follow(*ticks, 5.0, [&](const Stamped<Telemetry>& tick) {
    if (last.sequence + 1 == tick.sequence) {
      const double elapsed_ms = std::max(1.0, static_cast<double>(tick.value.due_ns - last.value.due_ns) * 1e-6);
      steepest_n_per_ms =
          std::max(steepest_n_per_ms, (norm(tick.value.force_n) - norm(last.value.force_n)) / elapsed_ms);
    }
    last = tick;
    return tick.value.gate >= 1.0;
  }));
  std::printf("resumed: steepest growth %.3f N/ms\n", steepest_n_per_ms);
  EXPECT_LE(steepest_n_per_ms, 3.0 + 1e-9);
}

TEST_F(Nodes, SurvivePhysicsBeingKilledAndTakeItsSuccessor) {
  start_physics();
  start_haptic();
  auto ticks = reader<Telemetry>("haptic0.telemetry");
  ASSERT_TRUE(ticks);
  ASSERT_TRUE(follow(*ticks, 8.0, [](const auto& t) { return t.value.gate >= 1.0 && norm(t.value.force_n) > 0.2; }));
  physics_->signal(SIGKILL);
  const std::uint64_t killed_ns = rtbus::monotonic_ns();
  physics_->wait();
  const Loss loss = watch_loss(*ticks, killed_ns, 0.3);
  std::printf("killed: lost after %.1f ms, zero %.1f ms later, worst wake-up %.2f ms\n", loss.declared_ms, loss.zero_ms,
              loss.worst_wakeup_ms);
  EXPECT_GT(loss.declared_ms, 0.0);
  EXPECT_LE(loss.declared_ms, 60.0 + loss.worst_wakeup_ms);
  EXPECT_GE(loss.zero_ms, 0.0);
  EXPECT_LE(loss.zero_ms, 41.0 + loss.worst_wakeup_ms);

  start_physics();
  EXPECT_TRUE(follow(*ticks, 5.0, [](const auto& t) { return t.value.gate >= 1.0 && norm(t.value.force_n) > 0.1; }))
      << "the successor takes the topics over and the force comes back";
}

TEST_F(Nodes, LeaveTheHandWithoutForceWhenTheHapticNodeIsKilled) {
  session_file_ = "wall_own_plant.yaml";
  start_plant();
  start_physics();
  start_haptic();
  auto plant = reader<rtbus::PlantState>("haptic0.plant_state");
  auto steps = reader<rtbus::ProxyState>("physics.proxy_state.haptic0");
  ASSERT_TRUE(plant && steps);
  Stamped<rtbus::PlantState> felt;
  ASSERT_TRUE(eventually(8.0, [&] {
    return plant->read_latest(felt) == ReadStatus::kFresh && norm(felt.value.applied_force_n) > 0.3;
  })) << "the hand should press on the wall";

  haptic_->signal(SIGKILL);
  const std::uint64_t killed_ns = rtbus::monotonic_ns();
  haptic_->wait();
  double zero_ms = -1.0;
  double worst_gap_ms = 0.0;  // pauses of the plant itself
  std::uint64_t last_ns = killed_ns;
  ASSERT_TRUE(eventually(2.0, [&] {
    while (plant->read_next(felt) == ReadStatus::kFresh) {
      if (felt.stamp_ns < killed_ns) continue;
      worst_gap_ms = std::max(worst_gap_ms, static_cast<double>(felt.stamp_ns - last_ns) * 1e-6);
      last_ns = felt.stamp_ns;
      if (norm(felt.value.applied_force_n) == 0.0) {
        zero_ms = static_cast<double>(felt.stamp_ns - killed_ns) * 1e-6;
        return true;
      }
    }
    return false;
  }));
  std::printf(
      "haptic_node killed: zero at the hand after %.1f ms (the plant's time-out is 20 ms), longest pause %.2f ms\n",
      zero_ms, worst_gap_ms);
  EXPECT_LE(zero_ms, 20.0 + 1.0 + worst_gap_ms);
  EXPECT_NE(felt.value.timed_out, 0u);

  // Physics goes on.
  Stamped<rtbus::ProxyState> step;
  (void)steps->read_latest(step);
  const std::uint64_t steps_before = step.value.step_index;
  usleep(300'000);
  (void)steps->read_latest(step);
  EXPECT_GT(step.value.step_index, steps_before + 100);

  // And a new haptic node finds plant, physics and its own topics.
  start_haptic();
  EXPECT_TRUE(eventually(
      8.0, [&] { return plant->read_latest(felt) == ReadStatus::kFresh && norm(felt.value.applied_force_n) > 0.3; }));
}

TEST_F(Nodes, LeaveTheHandWithoutForceWhileTheHapticNodeIsStarved) {
  session_file_ = "wall_own_plant.yaml";
  start_plant();
  start_physics();
  start_haptic();
  auto plant = reader<rtbus::PlantState>("haptic0.plant_state");
  ASSERT_TRUE(plant);
  Stamped<rtbus::PlantState> felt;
  ASSERT_TRUE(eventually(
      8.0, [&] { return plant->read_latest(felt) == ReadStatus::kFresh && norm(felt.value.applied_force_n) > 0.3; }));
  haptic_->signal(SIGSTOP);
  usleep(200'000);
  (void)plant->read_latest(felt);
  EXPECT_EQ(norm(felt.value.applied_force_n), 0.0) << "the plant's own time-out";
  EXPECT_NE(felt.value.timed_out, 0u);
  haptic_->signal(SIGCONT);
  EXPECT_TRUE(eventually(5.0, [&] {
    return plant->read_latest(felt) == ReadStatus::kFresh && norm(felt.value.applied_force_n) > 0.3;
  })) << "and the force comes back";
}

TEST_F(Nodes, MapNeitherBulletNorLibusbForTheWall) {
  start_physics();
  start_haptic();
  auto ticks = reader<Telemetry>("haptic0.telemetry");
  ASSERT_TRUE(ticks);
  for (const pid_t pid : {physics_->pid(), haptic_->pid()}) {
    std::ifstream maps("/proc/" + std::to_string(pid) + "/maps");
    std::string line;
    int lines = 0;
    while (std::getline(maps, line)) {
      ++lines;
      EXPECT_EQ(line.find("Bullet"), std::string::npos) << line;
      EXPECT_EQ(line.find("physics_bullet"), std::string::npos) << line;
      EXPECT_EQ(line.find("libusb"), std::string::npos) << line;
      EXPECT_EQ(line.find("drivers_usb"), std::string::npos) << line;
    }
    EXPECT_GT(lines, 10);
  }
}

TEST(Devices, AreListedAlsoWhereThereIsNoUsb) {
  const std::string out = testing::TempDir() + "devices" + std::to_string(getpid()) + ".json";
  Child devices({std::string(RTBUS_BINARY_DIR) + "/rtbus", "devices", "--json"}, out);
  EXPECT_EQ(devices.wait(), 0);
  std::ifstream file(out);
  const std::string text((std::istreambuf_iterator<char>(file)), {});
  EXPECT_NE(text.find("\"schema\": \"rtbus-devices/1\""), std::string::npos) << text;
}

TEST_F(Nodes, LeaveNothingInSharedMemoryAfterSigintAndSigterm) {
  for (const int signal : {SIGINT, SIGTERM}) {
    start_physics();
    start_haptic();
    ASSERT_TRUE(reader<Telemetry>("haptic0.telemetry"));
    ASSERT_TRUE(reader<rtbus::Heartbeat>("physics.heartbeat"));
    EXPECT_FALSE(tests::segments_of(bus_.name).empty());
    EXPECT_EQ(haptic_->end(signal), 0);
    EXPECT_EQ(physics_->end(signal), 0);
    EXPECT_EQ(tests::segments_of(bus_.name), std::vector<std::string>{});
  }
}

TEST_F(Nodes, AreCleanedUpAfterEverythingWasKilled) {
  start_physics();
  start_haptic();
  ASSERT_TRUE(reader<Telemetry>("haptic0.telemetry"));
  haptic_->end(SIGKILL);
  physics_->end(SIGKILL);
  EXPECT_FALSE(tests::segments_of(bus_.name).empty());
  Child clean({binary("rtbus"), "clean", "--session", bus_.name}, "/dev/null");
  EXPECT_EQ(clean.wait(), 0);
  EXPECT_EQ(tests::segments_of(bus_.name), std::vector<std::string>{});
}

TEST_F(Nodes, AreEndedByCtrlCOfTheRunCommandWithNothingLeft) {
  const std::string report = testing::TempDir() + bus_.name + ".json";
  Child run({binary("rtbus"), "run", std::string(RTBUS_SOURCE_DIR) + "/config/wall.yaml", "--set",
             "session=" + bus_.name, "--report", report, "--plots", testing::TempDir() + bus_.name},
            "/dev/null");
  ASSERT_TRUE(reader<Telemetry>("haptic0.telemetry"));
  usleep(700'000);
  EXPECT_EQ(run.end(SIGINT), 0) << "Ctrl-C is a good end";
  EXPECT_EQ(tests::segments_of(bus_.name), std::vector<std::string>{});
  std::ifstream file(report);
  std::string text((std::istreambuf_iterator<char>(file)), {});
  EXPECT_NE(text.find("rtbus-report/1"), std::string::npos);
}

}  // namespace
