// Sessions with `bridge:` under `rtbus run`: supervision, orders from ROS 2, and what others feel of it.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sched.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <sstream>
#include <string>
#include <vector>

#include "rtbus/clock.hpp"
#include "rtbus/messages.hpp"
#include "rtbus/order_client.hpp"
#include "rtbus/order_messages.hpp"
#include "rtbus/topic.hpp"
#include "tests/bridge/fast_peer.hpp"
#include "tests/support/process.hpp"
#include "tests/support/temporary_file.hpp"

namespace {

namespace fs = std::filesystem;
using tests::Bytes;
using tests::Child;
using tests::eventually;
using tests::FastPeer;

std::string text_of(const fs::path& file) {
  std::ostringstream out;
  out << std::ifstream(file).rdbuf();
  return out.str();
}

/// The process of that name among the children of `parent`; 0: none.
pid_t child_of(pid_t parent, const std::string& name) {
  for (const auto& entry : fs::directory_iterator("/proc")) {
    const std::string pid = entry.path().filename();
    if (pid.find_first_not_of("0123456789") != std::string::npos) continue;
    const std::string stat = text_of(entry.path() / "stat");
    const std::size_t close = stat.rfind(')');
    if (close == std::string::npos || stat.find("(" + name + ")") == std::string::npos) continue;
    if (stat.size() > close + 4 && std::atoi(stat.c_str() + close + 4) == parent) return std::atoi(pid.c_str());
  }
  return 0;
}

Bytes boolean(bool value) { return {0, 1, 0, 0, static_cast<std::uint8_t>(value ? 1 : 0)}; }
Bytes number(double value) {
  Bytes out{0, 1, 0, 0};
  std::uint8_t bytes[sizeof value];
  std::memcpy(bytes, &value, sizeof value);
  out.insert(out.end(), std::begin(bytes), std::end(bytes));
  return out;
}

/// Header without a stamp, then the numbers.
Bytes stamped(const std::string& frame, std::initializer_list<double> values) {
  Bytes out{0, 1, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, static_cast<std::uint8_t>(frame.size() + 1), 0, 0, 0};
  out.insert(out.end(), frame.begin(), frame.end());
  out.push_back(0);
  while ((out.size() - 4) % 8 != 0) out.push_back(0);
  for (const double each : values) {
    const Bytes bytes = number(each);
    out.insert(out.end(), bytes.begin() + 4, bytes.end());
  }
  return out;
}

class BridgeSession : public testing::Test {
 protected:
  void SetUp() override { bus_.name = "bridge" + std::to_string(getpid()) + "_" + std::to_string(++runs_); }
  void TearDown() override {
    run_.reset();
    EXPECT_EQ(tests::segments_of(bus_.name), std::vector<std::string>{});
  }

  /// `rtbus run` of a session of config/; of the wall, with a hand at rest on it.
  void start(const std::vector<std::string>& assignments, const std::string& session = "wall") {
    std::vector<std::string> words{std::string(RTBUS_BINARY_DIR) + "/rtbus",
                                   "run",
                                   std::string(RTBUS_SOURCE_DIR) + "/config/" + session + ".yaml",
                                   "--no-bare-loop",
                                   "--no-plots",
                                   "--report",
                                   report(),
                                   "--set",
                                   "session=" + bus_.name};
    for (const std::string& each : assignments) words.insert(words.end(), {"--set", each});
    run_ = std::make_unique<Child>(words, log());
    ASSERT_TRUE(eventually(60.0, [&] {
      auto opened = rtbus::Reader<rtbus::Telemetry>::open(bus_, "haptic0.telemetry", {.presence = true});
      if (opened && !ticks_) ticks_.emplace(std::move(*opened));
      return ticks_.has_value() && text_of(log()).find("runs until Ctrl-C") != std::string::npos;
    })) << text_of(log());
  }
  /// Ends it. @returns its exit status.
  int finish() {
    run_->signal(SIGINT);
    const int status = run_->wait();
    run_.reset();
    return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
  }
  [[nodiscard]] pid_t bridge() const { return child_of(run_->pid(), "rtbus_bridge"); }
  [[nodiscard]] bool await_bridge() {
    return eventually(60.0, [&] { return bridge() != 0; });
  }
  [[nodiscard]] std::string log() const { return folder_.path().string() + "/log"; }
  [[nodiscard]] std::string report() const { return folder_.path().string() + "/report.json"; }

  /// Writes `payload` again and again, as a node that beats, until `condition` holds.
  template <class Condition>
  [[nodiscard]] static bool beat_until(FastPeer& peer, std::size_t writer, const Bytes& payload, Condition condition) {
    std::uint64_t next_ns = 0;
    return eventually(30.0, [&] {
      if (rtbus::monotonic_ns() >= next_ns) {
        next_ns = rtbus::monotonic_ns() + 50 * rtbus::kNsPerMs;
        peer.write(writer, payload);
      }
      return condition();
    });
  }
  [[nodiscard]] std::string reason() { return std::string(rtbus::text_of(orders().reason)); }
  struct Ticks {
    double spread_n = 0.0;  ///< Largest less smallest vertical force.
  };
  /// All ticks since the last call, the last of then among them.
  Ticks follow_ticks() {
    double low = newest_tick_.force_n[1], high = low;
    if (newest_tick_.tick == 0) {
      low = 1e9;
      high = -1e9;
    }
    rtbus::Stamped<rtbus::Telemetry> tick;
    while (ticks_->read_next(tick) == rtbus::ReadStatus::kFresh) {
      newest_tick_ = tick.value;
      low = std::min(low, newest_tick_.force_n[1]);
      high = std::max(high, newest_tick_.force_n[1]);
    }
    return {high - low};
  }
  [[nodiscard]] rtbus::Orders orders() {
    if (!orders_) {
      auto opened = rtbus::Reader<rtbus::Orders>::open(bus_, "haptic0.orders");
      if (!opened) return {};
      orders_.emplace(std::move(*opened));
    }
    (void)orders_->read_latest(newest_orders_);
    return newest_orders_.value;
  }

  static inline int runs_ = 0;
  rtbus::Session bus_;
  tests::TemporaryFolder folder_;
  std::unique_ptr<Child> run_;
  std::optional<rtbus::Reader<rtbus::Telemetry>> ticks_;
  rtbus::Telemetry newest_tick_{};
  std::optional<rtbus::Reader<rtbus::Orders>> orders_;
  rtbus::Stamped<rtbus::Orders> newest_orders_{};
};

TEST_F(BridgeSession, WithoutBridgeNobodyMapsDds) {
  start({});
  int looked = 0;
  for (const char* program : {"haptic_node", "physics_node"}) {
    const pid_t pid = child_of(run_->pid(), program);
    if (pid == 0) continue;
    ++looked;
    const std::string maps = text_of("/proc/" + std::to_string(pid) + "/maps");
    EXPECT_THAT(maps, testing::HasSubstr("libc")) << program;
    EXPECT_THAT(maps, testing::Not(testing::HasSubstr("ddsc"))) << program;
  }
  EXPECT_EQ(looked, 2);
  const std::string maps = text_of("/proc/" + std::to_string(run_->pid()) + "/maps");
  EXPECT_THAT(maps, testing::Not(testing::HasSubstr("ddsc"))) << "rtbus run";
  EXPECT_EQ(bridge(), 0);
  EXPECT_EQ(finish(), 0) << text_of(log());
}

TEST_F(BridgeSession, ItsDeathIsFeltByNobodyAndItComesBack) {
  start({"bridge.publish.pose.rate_hz=1000", "haptic.0.device.hand.release_s=0"});
  ASSERT_TRUE(await_bridge()) << text_of(log());
  FastPeer peer;
  peer.listen("rt/haptic0/pose", "geometry_msgs::msg::dds_::PoseStamped_");
  ASSERT_TRUE(eventually(30.0, [&] { return peer.received("rt/haptic0/pose") > 0; })) << text_of(log());
  const pid_t first = bridge();

  // The bridge and all its threads keep off the loop's core, where there is another.
  auto info = rtbus::Reader<rtbus::NodeInfo>::open(bus_, "haptic0.node_info");
  ASSERT_TRUE(info);
  rtbus::Stamped<rtbus::NodeInfo> node;
  (void)info->read_latest(node);
  const auto core = static_cast<int>(node.value.core);
  int threads = 0;
  for (const auto& task : fs::directory_iterator("/proc/" + std::to_string(first) + "/task")) {
    cpu_set_t mask;
    CPU_ZERO(&mask);
    if (sched_getaffinity(std::stoi(task.path().filename()), sizeof mask, &mask) != 0) continue;
    ++threads;
    if (core >= 0 && sysconf(_SC_NPROCESSORS_ONLN) > 1) {
      EXPECT_FALSE(CPU_ISSET(static_cast<unsigned>(core), &mask)) << task.path();
    }
  }
  EXPECT_GT(threads, 2);

  // The hand has fallen on the wall and lies there. No tick feels that the bridge dies and comes back.
  const auto lies = [&] { return follow_ticks().spread_n < 0.01 && newest_tick_.force_n[1] > 0.05; };
  ASSERT_TRUE(eventually(60.0, [&] {
    usleep(200000);
    return lies();
  })) << newest_tick_.force_n[1];
  const std::uint64_t tick_before = newest_tick_.tick;
  ::kill(first, SIGKILL);
  double spread_n = 0.0;
  ASSERT_TRUE(eventually(30.0, [&] {
    spread_n = std::max(spread_n, follow_ticks().spread_n);
    return bridge() != 0 && bridge() != first;
  })) << text_of(log());
  ASSERT_TRUE(eventually(30.0, [&] {
    spread_n = std::max(spread_n, follow_ticks().spread_n);
    return newest_tick_.tick > tick_before + 500;
  }));
  EXPECT_LT(spread_n, 0.02);
  EXPECT_EQ(newest_tick_.gate, 1.0);
  const std::uint64_t so_far = peer.received("rt/haptic0/pose");
  EXPECT_TRUE(eventually(30.0, [&] { return peer.received("rt/haptic0/pose") > so_far; }));

  EXPECT_EQ(finish(), 0) << text_of(log());
  const nlohmann::json report = nlohmann::json::parse(text_of(this->report()), nullptr, false);
  ASSERT_TRUE(report.is_object());
  ASSERT_EQ(report["restarts"].size(), 1u);
  EXPECT_EQ(report["restarts"][0]["node"], "bridge");
}

TEST_F(BridgeSession, WithoutItsNetworkTheSessionGoesOnAndSaysSoAtTheEnd) {
  start({"bridge.network=nosuch0", "supervise.restarts=1", "supervise.first_delay_s=0.1"});
  EXPECT_TRUE(eventually(60.0, [&] { return text_of(log()).find("given up") != std::string::npos; })) << text_of(log());
  rtbus::Stamped<rtbus::Telemetry> tick;
  (void)ticks_->read_latest(tick);
  const std::uint64_t then = tick.value.tick;
  EXPECT_TRUE(eventually(10.0, [&] {
    (void)ticks_->read_latest(tick);
    return tick.value.tick > then + 100;
  }));
  EXPECT_EQ(finish(), 1);
  EXPECT_THAT(text_of(log()), testing::HasSubstr("DDS does not begin on network 'nosuch0'"));
}

TEST_F(BridgeSession, OrdersAreOffUnlessNamed) {
  start({"bridge.publish.pose.rate_hz=100"});
  ASSERT_TRUE(await_bridge());
  FastPeer peer;
  peer.listen("rt/haptic0/pose", "geometry_msgs::msg::dds_::PoseStamped_");
  const std::size_t stop = peer.announce("rt/estop", "std_msgs::msg::dds_::Bool_");
  ASSERT_TRUE(eventually(30.0, [&] { return peer.received("rt/haptic0/pose") > 100; })) << text_of(log());
  EXPECT_FALSE(peer.matched(stop));
  EXPECT_EQ(orders().estops, 0u);
  EXPECT_EQ(finish(), 0) << text_of(log());
}

TEST_F(BridgeSession, GainsAreClampedAndEndWithTheirOwnersSilence) {
  start({"bridge.publish.pose.rate_hz=100", "haptic.0.adjustable=[coupling.stiffness_n_per_m]",
         "bridge.orders.adjust=[{key: haptic0.coupling.stiffness_n_per_m, least: 100, most: 250, timeout_s: 1}]"});
  ASSERT_TRUE(await_bridge()) << text_of(log());
  FastPeer peer;
  const std::size_t gain =
      peer.announce("rt/adjust/haptic0/coupling/stiffness_n_per_m", "std_msgs::msg::dds_::Float64_");
  ASSERT_TRUE(eventually(30.0, [&] { return peer.matched(gain); })) << text_of(log());
  const double configured = [&] {
    auto info = rtbus::Reader<rtbus::NodeInfo>::open(bus_, "haptic0.node_info");
    rtbus::Stamped<rtbus::NodeInfo> node;
    if (info) (void)info->read_latest(node);
    return node.value.stiffness_rendered_n_per_m;
  }();
  EXPECT_TRUE(beat_until(peer, gain, number(1e6), [&] { return orders().stiffness_n_per_m == 250.0; }))
      << text_of(log());
  EXPECT_TRUE(beat_until(peer, gain, number(1.0), [&] { return orders().stiffness_n_per_m == 100.0; }));
  EXPECT_TRUE(eventually(30.0, [&] { return orders().stiffness_n_per_m == configured; })) << configured;

  // So does a gain whose bridge dies: `rtbus run` holds it only for as long as it is renewed.
  EXPECT_TRUE(beat_until(peer, gain, number(1.0), [&] { return orders().stiffness_n_per_m == 100.0; }));
  ::kill(bridge(), SIGKILL);
  EXPECT_TRUE(eventually(30.0, [&] { return orders().stiffness_n_per_m != 100.0; })) << text_of(log());
  EXPECT_EQ(orders().estops, 0u);
  EXPECT_EQ(finish(), 0) << text_of(log());
}

TEST_F(BridgeSession, EnableStopsBySilenceAndTakesBackItsOwnStopAlone) {
  start({"bridge.publish.diagnostics.rate_hz=10", "bridge.orders.enable.timeout_s=1"});
  ASSERT_TRUE(await_bridge()) << text_of(log());
  FastPeer peer;
  peer.listen("rt/diagnostics", "diagnostic_msgs::msg::dds_::DiagnosticArray_");
  const std::size_t enable = peer.announce("rt/enable", "std_msgs::msg::dds_::Bool_");
  const std::size_t other = peer.announce("rt/enable", "std_msgs::msg::dds_::Bool_");
  ASSERT_TRUE(eventually(30.0, [&] { return peer.matched(enable) && peer.matched(other); })) << text_of(log());

  // The owner begins with false, which stops; true takes it back. A second writer is refused.
  EXPECT_TRUE(beat_until(peer, enable, boolean(false), [&] { return orders().estop == 1; })) << text_of(log());
  EXPECT_TRUE(beat_until(peer, enable, boolean(false), [&] {
    const Bytes told = peer.newest("rt/diagnostics").value_or(Bytes{});
    return std::string(told.begin(), told.end()).find("E-stop: ROS 2 topic enable") != std::string::npos;
  }));
  EXPECT_TRUE(beat_until(peer, enable, boolean(true), [&] { return orders().estop == 0; })) << text_of(log());
  for (int i = 0; i < 5; ++i) peer.write(other, boolean(false));
  // The owner falls silent, and that is the reason.
  EXPECT_TRUE(eventually(30.0, [&] { return orders().estop == 1; })) << text_of(log());
  EXPECT_THAT(reason(), testing::HasSubstr("owner is silent"));

  // What the user has stopped, no beat and no step from false to true undoes.
  EXPECT_TRUE(beat_until(peer, enable, boolean(false), [&] { return orders().estop == 1; }));
  EXPECT_TRUE(beat_until(peer, enable, boolean(true), [&] { return orders().estop == 0; })) << text_of(log());
  ASSERT_TRUE(rtbus::send_order_text(bus_.name, R"({"order": "estop", "reason": "by hand"})", 1.0));
  int beats = 0;
  EXPECT_TRUE(beat_until(peer, enable, boolean(false), [&] { return ++beats > 40; }));
  beats = 0;
  EXPECT_TRUE(beat_until(peer, enable, boolean(true), [&] { return ++beats > 40; }));
  EXPECT_EQ(orders().estop, 1u);
  EXPECT_EQ(finish(), 0) << text_of(log());
}

TEST_F(BridgeSession, ABridgeThatDiesWhileSomebodyWatchesStopsTheSession) {
  start({"bridge.publish.pose.rate_hz=100", "bridge.orders.enable.timeout_s=1", "supervise.restart=false"});
  ASSERT_TRUE(await_bridge()) << text_of(log());
  FastPeer peer;
  const std::size_t enable = peer.announce("rt/enable", "std_msgs::msg::dds_::Bool_");
  ASSERT_TRUE(eventually(30.0, [&] { return peer.matched(enable); })) << text_of(log());
  EXPECT_TRUE(beat_until(peer, enable, boolean(false), [&] { return orders().estop == 1; })) << text_of(log());
  EXPECT_TRUE(beat_until(peer, enable, boolean(true), [&] { return orders().estop == 0; })) << text_of(log());
  ::kill(bridge(), SIGKILL);
  EXPECT_TRUE(beat_until(peer, enable, boolean(true), [&] { return orders().estop == 1; })) << text_of(log());
  EXPECT_THAT(reason(), testing::HasSubstr("has ended or hangs"));
  EXPECT_EQ(finish(), 1) << text_of(log());
}

TEST_F(BridgeSession, EstopIsOrderedByAnybodyAndMarksReachTheRecording) {
  start({"bridge.publish.pose.rate_hz=100", "bridge.orders.estop.timeout_s=60", "bridge.orders.mark.per_s=5"});
  ASSERT_TRUE(await_bridge()) << text_of(log());
  FastPeer peer;
  const std::size_t stop = peer.announce("rt/estop", "std_msgs::msg::dds_::Bool_");
  const std::size_t mark = peer.announce("rt/mark", "std_msgs::msg::dds_::String_");
  ASSERT_TRUE(eventually(30.0, [&] { return peer.matched(stop) && peer.matched(mark); })) << text_of(log());
  const std::string file = folder_.path().string() + "/marked.h5";
  const auto recording = rtbus::send_order_text(bus_.name, R"({"order": "record", "file": ")" + file + R"("})", 5.0);
  if (recording && recording->find("\"ok\":true") != std::string::npos) {  // a build without HDF5 records nothing
    Bytes text{0, 1, 0, 0, 7, 0, 0, 0, 't', 'o', 'u', 'c', 'h', '!', 0};
    EXPECT_TRUE(beat_until(peer, mark, text, [&] { return std::system(("grep -q 'touch!' " + file).c_str()) == 0; }))
        << text_of(log());
  }
  EXPECT_TRUE(beat_until(peer, stop, boolean(true), [&] { return orders().estop == 1; })) << text_of(log());
  EXPECT_EQ(reason(), "ROS 2 topic estop");
  EXPECT_EQ(finish(), 0) << text_of(log());
}

TEST_F(BridgeSession, ClutchAndExtraWrenchActWhileTheyAreRepeated) {
  start({"bridge.publish.pose.rate_hz=100", "bridge.orders.clutch.timeout_s=0.5",
         "bridge.orders.extra_wrench.timeout_s=0.5", "haptic.0.extra_force_max_n=0.5"});
  ASSERT_TRUE(await_bridge()) << text_of(log());
  FastPeer peer;
  const std::size_t clutch = peer.announce("rt/haptic0/clutch", "std_msgs::msg::dds_::Bool_");
  const std::size_t push = peer.announce("rt/haptic0/extra_wrench", "geometry_msgs::msg::dds_::WrenchStamped_");
  ASSERT_TRUE(eventually(30.0, [&] { return peer.matched(clutch) && peer.matched(push); })) << text_of(log());
  const auto wrench = [](const std::string& frame, double x_n) {
    return stamped(frame, {x_n, 0.0, 0.0, 0.0, 0.0, 0.0});
  };
  const auto now = [&] {
    (void)follow_ticks();
    return newest_tick_;
  };
  int beats = 0;
  EXPECT_TRUE(beat_until(peer, push, wrench("world", 3.0), [&] { return ++beats > 40; }));
  EXPECT_EQ(orders().extra_force_until_ns, 0u) << "in another frame it would push elsewhere";
  EXPECT_TRUE(beat_until(peer, push, wrench("haptic0_base", 3.0), [&] {
    const rtbus::Telemetry tick = now();
    return std::abs(tick.force_n[0] - tick.rendered_force_n[0] - 0.5) < 1e-6;
  })) << newest_tick_.force_n[0];
  EXPECT_TRUE(eventually(30.0, [&] {
    const rtbus::Telemetry tick = now();
    return std::abs(tick.force_n[0] - tick.rendered_force_n[0]) < 1e-9;
  })) << newest_tick_.force_n[0];
  EXPECT_TRUE(beat_until(peer, clutch, boolean(true), [&] { return now().gate == 0.0; }));
  EXPECT_TRUE(eventually(30.0, [&] { return now().gate == 1.0; }));
  EXPECT_EQ(finish(), 0) << text_of(log());
}

TEST_F(BridgeSession, ATargetPoseMovesABodyWithinItsReach) {
  start({"bridge.publish.pose.rate_hz=100", "bridge.orders.target=[{body: plate, timeout_s: 0.5}]",
         "scene.bodies.1.motion={target: {max_speed_m_s: 0.2, reach_m: 0.01}}"},
        "moving_plate");
  ASSERT_TRUE(await_bridge()) << text_of(log());
  FastPeer peer;
  const std::size_t target = peer.announce("rt/body/plate/target_pose", "geometry_msgs::msg::dds_::PoseStamped_");
  ASSERT_TRUE(eventually(30.0, [&] { return peer.matched(target); })) << text_of(log());
  auto poses = rtbus::Reader<rtbus::BodyPoses>::open(bus_, "physics.body_poses", {.presence = true});
  ASSERT_TRUE(poses);
  rtbus::Stamped<rtbus::BodyPoses> newest{};
  const auto height_m = [&] {
    (void)poses->read_latest(newest);
    return newest.value.position_m[1][1];
  };
  int beats = 0;
  const std::initializer_list<double> pose{0.0, 5.0, 0.0, 0.0, 0.0, 0.0, 1.0};
  EXPECT_TRUE(beat_until(peer, target, stamped("world", pose), [&] { return ++beats > 40; }));
  EXPECT_EQ(height_m(), -0.01) << "numbers in the frame of REP 103 would go elsewhere";
  EXPECT_TRUE(beat_until(peer, target, stamped("rtbus_world", pose), [&] { return height_m() > -1e-6; }));
  EXPECT_NEAR(height_m(), 0.0, 1e-6) << "10 mm above its place, and no farther";
  EXPECT_EQ(finish(), 0) << text_of(log());
}

TEST_F(BridgeSession, RubbishChangesNothing) {
  start({"bridge.publish.pose.rate_hz=100", "bridge.orders.estop.timeout_s=60", "bridge.orders.mark.per_s=5"});
  ASSERT_TRUE(await_bridge());
  FastPeer peer;
  const std::size_t stop = peer.announce("rt/estop", "std_msgs::msg::dds_::Bool_");
  const std::size_t mark = peer.announce("rt/mark", "std_msgs::msg::dds_::String_");
  peer.listen("rt/haptic0/pose", "geometry_msgs::msg::dds_::PoseStamped_");
  ASSERT_TRUE(eventually(30.0, [&] { return peer.matched(stop) && peer.matched(mark); })) << text_of(log());
  const pid_t first = bridge();
  for (int i = 0; i < 200; ++i) {
    peer.write(stop, {0, 1, 0, 0});                                            // no value at all
    peer.write(stop, {9, 9, 9, 9, 1});                                         // no encapsulation that there is
    peer.write(mark, {0, 1, 0, 0, 0xff, 0xff, 0xff, 0xff, 'x'});               // a text of four gigabytes
    peer.write(mark, {0, 1, 0, 0, 3, 0, 0, 0, static_cast<std::uint8_t>(i)});  // one that ends early
  }
  const std::uint64_t so_far = peer.received("rt/haptic0/pose");
  EXPECT_TRUE(eventually(30.0, [&] { return peer.received("rt/haptic0/pose") > so_far + 10; })) << text_of(log());
  EXPECT_EQ(bridge(), first);
  EXPECT_EQ(orders().estops, 0u);
  EXPECT_EQ(finish(), 0) << text_of(log());
}

TEST_F(BridgeSession, TheExampleWithoutRtbusPrintsTheForce) {
  start({"haptic.0.device.hand.release_s=0", "bridge.publish.wrench.rate_hz=100"});
  ASSERT_TRUE(await_bridge()) << text_of(log());
  const std::string printed = folder_.path().string() + "/printed";
  Child example({std::string(RTBUS_BINARY_DIR) + "/force_over_dds", "haptic0"}, printed);
  // The hand has fallen on the wall and lies there: what it feels is what the program prints.
  double vertical_n = 0.0;
  EXPECT_TRUE(eventually(60.0,
                         [&] {
                           const Ticks now = follow_ticks();
                           const std::string text = text_of(printed);
                           const std::size_t end = text.rfind(" N\n");
                           const std::size_t begin = end == std::string::npos ? 0 : text.rfind('\n', end) + 1;
                           double other[2];
                           return end != std::string::npos && now.spread_n < 0.01 && newest_tick_.force_n[1] > 0.05 &&
                                  std::sscanf(text.c_str() + begin, "%lf %lf %lf", &other[0], &vertical_n, &other[1]) ==
                                      3 &&
                                  std::abs(vertical_n - newest_tick_.force_n[1]) < 0.02;
                         }))
      << text_of(printed) << newest_tick_.force_n[1] << '\n'
      << text_of(log());
  EXPECT_EQ(finish(), 0) << text_of(log());
}

}  // namespace
