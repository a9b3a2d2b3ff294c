// Orders to a running session: E-stop and gains, from the command to the force on the hand.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <iterator>

#include "rtbus/order_client.hpp"
#include "rtbus/order_messages.hpp"
#include "rtbus/parent_death.hpp"
#include "tests/support/nodes.hpp"

namespace {

using namespace tests;
using testing::HasSubstr;

/// `rtbus run` of the wall with a hand that presses and stays.
class Ordered : public Nodes {
 protected:
  void SetUp() override {
    Nodes::SetUp();
    folder_ = testing::TempDir() + bus_.name;
    std::filesystem::create_directory(folder_);
    write_device("", "");
  }
  void write_device(const std::string& keys, const std::string& of_hand) {
    std::ofstream(folder_ + "/device.yaml")
        << "schema: device/1\ndriver: simulated\nmodel: phantom_desktop\nmechanics: {coulomb_n: 0}\n"
        << keys << "hand: {type: push, impedance: normal, start_m: [0, 0.020, 0], direction: [0, -1, 0], "
        << "distance_m: 0.025, speed_m_s: 0.05, start_s: 0.2" << of_hand << "}\n";
  }
  void TearDown() override {
    if (run_) run_->end(SIGINT);  // killed, it would leave its nodes to end by themselves
    Nodes::TearDown();
    std::filesystem::remove_all(folder_);
  }
  void start(std::vector<std::string> more = {}) {
    std::vector<std::string> words{
        binary("rtbus"),        "run",   std::string(RTBUS_SOURCE_DIR) + "/config/wall.yaml", "--set",
        "session=" + bus_.name, "--set", "haptic.0.device=" + folder_ + "/device.yaml"};
    words.insert(words.end(), more.begin(), more.end());
    run_.emplace(words, folder_ + "/run.txt");
    ticks_ = reader<Telemetry>("haptic0.telemetry");
    ASSERT_TRUE(ticks_);
    ASSERT_TRUE(follow(*ticks_, 10.0, [](const auto& tick) { return norm(tick.value.force_n) > 0.5; }));
  }
  int rtbus(std::vector<std::string> words) {
    words.insert(words.begin(), binary("rtbus"));
    words.insert(words.end(), {"-s", bus_.name});
    const int status = Child(words, folder_ + "/said.txt").wait();
    return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
  }
  [[nodiscard]] std::string order(const std::string& json) const {
    const auto answer = rtbus::send_order_text(bus_.name, json, 1.0);
    return answer ? *answer : answer.error().sentence;
  }
  [[nodiscard]] std::string said() const {
    std::ifstream in(folder_ + "/said.txt");
    return {std::istreambuf_iterator<char>(in), {}};
  }
  /// Largest force of the ticks that come within `duration_s` [N].
  double peak_n(double duration_s) {
    double peak = 0.0;
    Stamped<Telemetry> tick;
    while (ticks_->read_next(tick) == ReadStatus::kFresh) {
    }
    (void)follow(*ticks_, duration_s, [&](const auto& each) {
      peak = std::max(peak, norm(each.value.force_n));
      return false;
    });
    return peak;
  }

  /// Kills the haptic node, and waits for its successor.
  void crash_haptic() {
    auto beats = reader<rtbus::Heartbeat>("haptic0.heartbeat");
    Stamped<rtbus::Heartbeat> beat;
    ASSERT_TRUE(beats && beats->read_latest(beat) == ReadStatus::kFresh);
    ASSERT_EQ(::kill(static_cast<pid_t>(beat.value.pid), SIGKILL), 0);
    ASSERT_TRUE(eventually(5.0, [&] { return !ticks_->writer_alive(); }));
    ASSERT_TRUE(eventually(5.0, [&] { return ticks_->writer_alive(); }));
  }

  std::string folder_;
  std::optional<Child> run_;
  std::optional<Reader<Telemetry>> ticks_;
};

TEST_F(Ordered, EstopIsZeroWithin100MsHeldOverARestartAndEndsWhenRearmed) {
  start();
  auto orders = reader<rtbus::Orders>("haptic0.orders");
  ASSERT_TRUE(orders);
  const std::uint64_t ordered_ns = rtbus::monotonic_ns();
  ASSERT_EQ(rtbus({"estop", "--reason", "test"}), 0) << said();
  std::uint64_t zero_ns = 0;
  ASSERT_TRUE(follow(*ticks_, 2.0, [&](const auto& tick) {
    zero_ns = tick.stamp_ns;
    return tick.stamp_ns > ordered_ns && norm(tick.value.force_n) == 0.0;
  }));
  Stamped<rtbus::Orders> order;
  while (order.value.estop == 0) ASSERT_EQ(orders->read_next(order), ReadStatus::kFresh);
  // The promise is 100 ms from the order; how long a busy machine takes to start the command is its own affair.
  std::printf("zero %.1f ms after the command was started, %.1f ms after its order\n",
              static_cast<double>(zero_ns - ordered_ns) * 1e-6,
              (static_cast<double>(zero_ns) - static_cast<double>(order.stamp_ns)) * 1e-6);
  ASSERT_GE(zero_ns, order.stamp_ns);
  EXPECT_LE(zero_ns - order.stamp_ns, 100 * rtbus::kNsPerMs);
  EXPECT_EQ(peak_n(0.5), 0.0);
  // A node that is started again obeys what was ordered before.
  ASSERT_NO_FATAL_FAILURE(crash_haptic());
  EXPECT_EQ(peak_n(1.0), 0.0);
  ASSERT_EQ(rtbus({"estop", "--rearm"}), 0) << said();
  EXPECT_TRUE(follow(*ticks_, 3.0, [](const auto& tick) { return norm(tick.value.force_n) > 0.5; }));
}

TEST_F(Ordered, EstopByAButtonOfTheDeviceIsHeldOverARestartOfItsNode) {
  // The device has a process of its own: its button is not pressed again when the node is started again.
  write_device("process: own\n", ", buttons: [{time_s: 5, button: 1}, {time_s: 5.2, button: 1, pressed: false}]");
  start({"--set", "haptic.0.estop_button=1"});
  ASSERT_TRUE(follow(*ticks_, 20.0, [](const auto& tick) { return (tick.value.buttons & 2u) != 0; }));
  ASSERT_TRUE(follow(*ticks_, 5.0, [](const auto& tick) {
    return (tick.value.buttons & 2u) == 0 && norm(tick.value.force_n) == 0.0;
  }));
  ASSERT_NO_FATAL_FAILURE(crash_haptic());
  EXPECT_EQ(peak_n(1.5), 0.0);
  EXPECT_THAT(order(R"({"order": "state"})"), HasSubstr("button of haptic0"));
  ASSERT_EQ(rtbus({"estop", "--rearm"}), 0) << said();
  EXPECT_TRUE(follow(*ticks_, 5.0, [](const auto& tick) { return norm(tick.value.force_n) > 0.5; }));
  EXPECT_THAT(order(R"({"order": "state"})"), HasSubstr("\"estop\":false")) << "one press is one E-stop";
}

/// Without a supervisor; the test orders.
TEST_F(Nodes, BeginUnderAnEstopThatWasOrderedBeforeTheirFirstCycle) {
  auto orders = rtbus::Writer<rtbus::Orders>::create(bus_, "haptic0.orders", {.capacity = 4});
  ASSERT_TRUE(orders);
  rtbus::Orders estop;
  estop.estop = 1;
  orders->publish(estop, rtbus::monotonic_ns());
  ASSERT_EQ(::setenv(rtbus::kSupervisorVariable, std::to_string(::getpid()).c_str(), 1), 0);
  // `direct` waits for nobody: its force would come with the first cycle.
  haptic_.emplace(command("haptic_node", {"--telemetry", "--set", "haptic.0.method=direct"}), "/dev/null");
  ::unsetenv(rtbus::kSupervisorVariable);
  std::optional<Reader<Telemetry>> ticks;
  ASSERT_TRUE(eventually(10.0, [&] {
    auto opened = Reader<Telemetry>::open(bus_, "haptic0.telemetry", {.presence = true, .from_oldest = true});
    if (opened) ticks.emplace(std::move(*opened));
    return ticks.has_value();
  }));
  constexpr std::uint32_t kEstopBit = 1u << 10;  // haptic::kEstop, as docs/safety.md lists the bits
  std::uint64_t seen = 0, with_estop = 0, first = 0;
  (void)follow(*ticks, 10.0, [&](const auto& tick) {
    if (seen++ == 0) first = tick.value.tick;
    if ((tick.value.safety & kEstopBit) != 0) ++with_estop;
    return seen == 200;
  });
  EXPECT_EQ(first, 1u) << "the first cycle";
  EXPECT_EQ(seen, 200u);
  EXPECT_EQ(with_estop, seen);
}

TEST_F(Ordered, GainsChangeOnlyWhereTheSessionAllowsAndWithoutAStep) {
  start({"--set", "haptic.0.adjustable=[coupling.stiffness_n_per_m]"});
  EXPECT_EQ(rtbus({"adjust", "haptic0.coupling.damping_n_s_per_m=1"}), 1);
  EXPECT_THAT(said(), HasSubstr("adjustable are: haptic0.coupling.stiffness_n_per_m"));
  EXPECT_EQ(rtbus({"adjust", "haptic0.coupling.stiffness_n_per_m=1e6"}), 1);
  EXPECT_THAT(said(), HasSubstr("what the device bears"));
  EXPECT_EQ(rtbus({"adjust", "haptic0.coupling.stiffness_n_per_m=stiff"}), 2);
  const double before_n = peak_n(0.3);
  ASSERT_EQ(rtbus({"adjust", "haptic0.coupling.stiffness_n_per_m=400"}), 0) << said();
  double last_n = 0.0, largest_step_n = 0.0;
  (void)follow(*ticks_, 1.5, [&](const auto& tick) {
    const double now_n = norm(tick.value.force_n);
    if (last_n > 0.0) largest_step_n = std::max(largest_step_n, std::abs(now_n - last_n));
    last_n = now_n;
    return false;
  });
  EXPECT_GT(last_n, 1.05 * before_n);
  EXPECT_LT(largest_step_n, 0.05) << "N per tick";
  EXPECT_EQ(rtbus({"adjust"}), 0);
  EXPECT_THAT(said(), HasSubstr("haptic0.coupling.stiffness_n_per_m = 400 N/m"));
}

TEST_F(Ordered, ForceBesidesThatOfTheMethodEndsWithTheSilenceOfWhoOrdersIt) {
  start({"--set", "haptic.0.extra_force_max_n=0.4"});
  const double pressed_n = peak_n(0.3);
  EXPECT_THAT(order(R"({"order": "extra_force", "node": "haptic7"})"), HasSubstr("haptic7"));
  EXPECT_THAT(order(R"({"order": "extra_force", "node": "haptic0", "force_n": [0, 1]})"), HasSubstr("three numbers"));
  EXPECT_THAT(order(R"({"order": "extra_force", "node": "haptic0", "force_n": [0, 1, 0], "for_s": 5})"),
              HasSubstr("0 to 1 s"));
  // Upwards, as the floor pushes: 3 N are shortened to 0.4 N.
  const std::uint64_t ordered_ns = rtbus::monotonic_ns();
  EXPECT_THAT(order(R"({"order": "extra_force", "node": "haptic0", "force_n": [0, 3, 0], "for_s": 1})"),
              HasSubstr("\"ok\":true"));
  double most_n = 0.0;
  EXPECT_TRUE(follow(*ticks_, 5.0, [&](const auto& tick) {
    const double n = tick.value.force_n[1] - tick.value.rendered_force_n[1];
    if (tick.stamp_ns > ordered_ns) most_n = std::max(most_n, n);
    return tick.stamp_ns > ordered_ns + 2 * rtbus::kNsPerS && n < 1e-9;
  }));
  EXPECT_NEAR(most_n, 0.4, 0.02);
  EXPECT_NEAR(peak_n(0.3), pressed_n, 0.1);
  EXPECT_THAT(order(R"({"order": "clutch", "node": "haptic0", "for_s": 1})"), HasSubstr("\"ok\":true"));
  EXPECT_TRUE(follow(*ticks_, 5.0, [](const auto& tick) { return norm(tick.value.force_n) == 0.0; }));
  EXPECT_THAT(order(R"({"order": "clutch", "node": "haptic0", "for_s": 0})"), HasSubstr("\"ok\":true"));
}

TEST_F(Ordered, AProgramTakesBackItsOwnEstopAlone) {
  start();
  auto orders = reader<rtbus::Orders>("haptic0.orders");
  ASSERT_TRUE(orders);
  const auto stopped = [&] {
    Stamped<rtbus::Orders> newest;
    (void)orders->read_latest(newest);
    return newest.value.estop == 1;
  };
  EXPECT_THAT(order(R"({"order": "estop", "source": "a node"})"), HasSubstr("a node"));
  ASSERT_EQ(rtbus({"estop"}), 0) << said();
  EXPECT_THAT(order(R"({"order": "rearm", "source": "another"})"), HasSubstr("holds no E-stop"));
  EXPECT_THAT(order(R"({"order": "rearm", "source": "a node"})"), HasSubstr("of the user still holds"));
  EXPECT_TRUE(stopped());
  ASSERT_EQ(rtbus({"estop", "--rearm"}), 0) << said();
  EXPECT_FALSE(stopped());
  EXPECT_THAT(order(R"({"order": "estop", "source": "a node"})"), HasSubstr("\"ok\":true"));
  EXPECT_TRUE(stopped());
  EXPECT_THAT(order(R"({"order": "rearm", "source": "a node"})"), HasSubstr("\"ok\":true"));
  EXPECT_FALSE(stopped());
  // Who watches and falls silent stops the session, and a gain that he ordered is the file's again.
  EXPECT_THAT(order(R"({"order": "watch", "source": "a node", "for_s": 0.2})"), HasSubstr("\"ok\":true"));
  EXPECT_TRUE(tests::eventually(10.0, stopped));
  EXPECT_THAT(order(R"({"order": "state"})"), HasSubstr("a node has ended or hangs"));
}

TEST_F(Ordered, ForceBesidesThatOfTheMethodNeedsTheLeaveOfTheSession) {
  start();
  EXPECT_THAT(order(R"({"order": "extra_force", "node": "haptic0", "force_n": [0, 1, 0], "for_s": 0.5})"),
              HasSubstr("extra_force_max_n"));
}

TEST_F(Ordered, EstopReachesTheHandAlsoWhenTheSupervisorIsStopped) {
  start({"--no-restart"});
  run_->signal(SIGSTOP);
  ASSERT_EQ(rtbus({"estop"}), 0) << said();
  EXPECT_THAT(said(), HasSubstr("ended 1 haptic node"));
  EXPECT_TRUE(eventually(2.0, [&] { return !ticks_->writer_alive(); }));
  run_->signal(SIGCONT);
  run_->wait();
}

TEST_F(Ordered, WithoutASessionSaysSo) {
  EXPECT_NE(rtbus({"estop"}), 0);
  EXPECT_THAT(said(), HasSubstr("rtbus estop: "));
}

/// The plate of config/moving_plate.yaml, moved by orders.
class OrderedPlate : public Ordered {
 protected:
  void start_plate() {
    run_.emplace(
        std::vector<std::string>{binary("rtbus"), "run", std::string(RTBUS_SOURCE_DIR) + "/config/moving_plate.yaml",
                                 "--set", "session=" + bus_.name, "--set",
                                 "scene.bodies.1.motion={target: {max_speed_m_s: 0.05, reach_m: 0.02}}"},
        folder_ + "/run.txt");
    ASSERT_TRUE(
        tests::eventually(30.0, [&] { return order(R"({"order": "state"})").find("true") != std::string::npos; }));
  }
  /// Height of the plate [m]; 0: not known yet.
  [[nodiscard]] double height_m() {
    if (!poses_) {
      if (auto opened = Reader<rtbus::BodyPoses>::open(bus_, "physics.body_poses", {.presence = true})) {
        poses_.emplace(std::move(*opened));
      }
    }
    if (poses_) (void)poses_->read_latest(newest_);
    return newest_.value.position_m[1][1];
  }
  std::optional<Reader<rtbus::BodyPoses>> poses_;
  Stamped<rtbus::BodyPoses> newest_{};
};

TEST_F(OrderedPlate, GoesWhereItIsSentWhileTheOrderIsRepeated) {
  start_plate();
  EXPECT_THAT(order(R"({"order": "target", "body": "rock", "position_m": [0, 0, 0], "for_s": 1})"),
              HasSubstr("those are plate"));
  EXPECT_THAT(order(R"({"order": "target", "body": "plate", "for_s": 1})"), HasSubstr("three numbers"));
  double begin_m = 0.0;
  ASSERT_TRUE(tests::eventually(30.0, [&] { return (begin_m = height_m()) != 0.0; }));
  const std::string up = R"({"order": "target", "body": "plate", "velocity_m_s": [0, 0.01, 0], "for_s": 0.5})";
  EXPECT_THAT(order(up), HasSubstr("\"ok\":true"));
  // One order of 0.01 m/s for half a second is 5 mm at most, then it stays.
  EXPECT_TRUE(tests::eventually(30.0, [&] { return height_m() > begin_m + 0.003; }));
  usleep(700'000);
  const double stopped_m = height_m();
  EXPECT_LT(stopped_m, begin_m + 0.0055);
  usleep(200'000);
  EXPECT_EQ(height_m(), stopped_m);
  // Repeated, it goes on to the end of its reach.
  const std::string away = R"({"order": "target", "body": "plate", "position_m": [0, 1, 0], "for_s": 0.5})";
  double highest_m = stopped_m;
  EXPECT_TRUE(tests::eventually(30.0, [&] {
    (void)order(away);
    highest_m = std::max(highest_m, height_m());
    return highest_m > stopped_m + 0.005;
  }));
  EXPECT_LE(highest_m, begin_m + 0.0201);
}

}  // namespace
