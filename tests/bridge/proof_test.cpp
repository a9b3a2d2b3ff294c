// What a participant of another maker's DDS sees of the bridge: names, types, hashes, bytes, values.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <fstream>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <sstream>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "rtbus/clock.hpp"
#include "rtbus/messages.hpp"
#include "rtbus/topic.hpp"
#include "tests/bridge/fast_peer.hpp"
#include "tests/support/process.hpp"
#include "tests/support/temporary_file.hpp"

namespace {

using tests::Bytes;
using tests::Child;
using tests::eventually;
using tests::FastPeer;

/// As ROS 2 names and hashes them (`ros2 topic info -v` shows the hash).
struct Expected {
  const char *topic, *type, *ros_type, *hash;
  bool latched = false;
};
constexpr const char* kPoseHash = "10f3786d7d40fd2b54367835614bff85d4ad3b5dab62bf8bca0cc232d73b4cd8";
constexpr const char* kTwistHash = "5f0fcd4f81d5d06ad9b4c4c63e3ea51b82d6ae4d0558f1d475229b1121db6f64";
constexpr const char* kWrenchHash = "8dc3deaf06b2ab281f9f9a742a8961c328ca7cec16e3fd6586d3a5c83fa78f77";
constexpr const char* kTfHash = "e369d0f05a23ae52508854b66f6aa0437f3449d652e8cbf22d5abe85d020f087";
constexpr Expected kExpected[] = {
    {"rt/haptic0/pose", "geometry_msgs::msg::dds_::PoseStamped_", "geometry_msgs/PoseStamped", kPoseHash},
    {"rt/haptic0/twist", "geometry_msgs::msg::dds_::TwistStamped_", "geometry_msgs/TwistStamped", kTwistHash},
    {"rt/haptic0/wrench", "geometry_msgs::msg::dds_::WrenchStamped_", "geometry_msgs/WrenchStamped", kWrenchHash},
    {"rt/haptic0/joy", "sensor_msgs::msg::dds_::Joy_", "sensor_msgs/Joy",
     "0d356c79cad3401e35ffeb75a96a96e08be3ef896b8b83841d73e890989372c5"},
    {"rt/haptic0/joint_states", "sensor_msgs::msg::dds_::JointState_", "sensor_msgs/JointState",
     "a13ee3a330e346c9d87b5aa18d24e11690752bd33a0350f11c5882bc9179260e"},
    {"rt/haptic0/proxy/pose", "geometry_msgs::msg::dds_::PoseStamped_", "geometry_msgs/PoseStamped", kPoseHash},
    {"rt/haptic0/proxy/twist", "geometry_msgs::msg::dds_::TwistStamped_", "geometry_msgs/TwistStamped", kTwistHash},
    {"rt/haptic0/proxy/wrench", "geometry_msgs::msg::dds_::WrenchStamped_", "geometry_msgs/WrenchStamped", kWrenchHash},
    {"rt/tf", "tf2_msgs::msg::dds_::TFMessage_", "tf2_msgs/TFMessage", kTfHash},
    {"rt/tf_static", "tf2_msgs::msg::dds_::TFMessage_", "tf2_msgs/TFMessage", kTfHash, true},
    {"rt/diagnostics", "diagnostic_msgs::msg::dds_::DiagnosticArray_", "diagnostic_msgs/DiagnosticArray",
     "5a8a36efb05fb25070fa0fb3810290c0e6cd4862b54a8fb975a1ee8dc55a333e"},
};

/// The topics of a session on config/free_block.yaml, with samples that are always the same but for their stamps.
class FixedSession {
 public:
  explicit FixedSession(const std::string& name) {
    session_.name = name;
    device_.emplace(make<rtbus::DeviceState>("haptic0.device_state"));
    tick_.emplace(make<rtbus::Telemetry>("haptic0.telemetry"));
    loop_.emplace(make<rtbus::LoopStats>("haptic0.loop_stats"));
    info_.emplace(make<rtbus::NodeInfo>("haptic0.node_info"));
    beat_.emplace(make<rtbus::Heartbeat>("haptic0.heartbeat"));
    proxy_.emplace(make<rtbus::ProxyState>("physics.proxy_state.haptic0"));
    bodies_.emplace(make<rtbus::BodyPoses>("physics.body_poses"));
  }

  /// Measured, ticked and answered at these times (CLOCK_MONOTONIC), whenever it is published.
  [[nodiscard]] std::uint64_t device_ns() const { return begin_ns_ - 20 * rtbus::kNsPerMs; }
  [[nodiscard]] std::uint64_t tick_ns() const { return begin_ns_ - 300 * rtbus::kNsPerMs; }
  [[nodiscard]] std::uint64_t proxy_ns() const { return begin_ns_ - 4 * rtbus::kNsPerS; }

  void publish() {
    const std::uint64_t now_ns = rtbus::monotonic_ns();
    rtbus::DeviceState device;
    device.position_m = {1.0, 2.0, 3.0};
    device.velocity_m_s = {0.5, -0.25, 0.125};
    device.orientation_wxyz = {0.5, -0.5, 0.5, -0.5};
    device.buttons = 0b101;
    device.gripper_m = 0.25;
    device.sample_time_ns = device_ns();
    device_->publish(device, now_ns);

    rtbus::Telemetry tick;
    tick.device_time_ns = tick_ns();
    tick.due_ns = now_ns;
    tick.tick = ++ticks_;
    tick.position_m = device.position_m;
    tick.velocity_m_s = device.velocity_m_s;
    tick.force_n = {-1.0, 4.0, 2.0};
    tick_->publish(tick, now_ns);

    rtbus::ProxyState proxy;
    proxy.position_m = {0.5, 1.0, -2.0};
    proxy.velocity_m_s = {1.0, 0.0, -1.0};
    proxy.angular_velocity_rad_s = {0.0, 2.0, 0.0};
    proxy.contact_force_n = {0.0, 8.0, 0.0};
    proxy.step_index = ticks_;
    proxy_->publish(proxy, proxy_ns());

    rtbus::BodyPoses bodies;
    bodies.frame = ticks_;
    bodies.step_index = ticks_;
    bodies.count = bodies.bodies = 2;
    for (auto& each : bodies.orientation_wxyz) each = {1, 0, 0, 0};
    bodies.position_m[1] = {0.0, 0.5, -0.5};
    bodies_->publish(bodies, now_ns);

    rtbus::LoopStats loop;
    loop.achieved_hz = 1000.0;
    loop.ticks = 12;
    loop.ticks_due = 12;
    loop_->publish(loop, now_ns);
    rtbus::NodeInfo info;
    rtbus::set_text(info.kind, "phantom_desktop");
    info_->publish(info, now_ns);
    rtbus::Heartbeat beat;
    beat.beats = ticks_;
    beat.pid = static_cast<std::uint32_t>(::getpid());
    beat_->publish(beat, now_ns);
  }

 private:
  template <class T>
  rtbus::Writer<T> make(const std::string& topic) {
    auto writer = rtbus::Writer<T>::create(session_, topic);
    if (!writer) throw std::runtime_error(topic + ": " + rtbus::to_string(writer.error()));
    return std::move(*writer);
  }
  rtbus::Session session_;
  const std::uint64_t begin_ns_ = rtbus::monotonic_ns();
  std::uint64_t ticks_ = 0;
  std::optional<rtbus::Writer<rtbus::DeviceState>> device_;
  std::optional<rtbus::Writer<rtbus::Telemetry>> tick_;
  std::optional<rtbus::Writer<rtbus::ProxyState>> proxy_;
  std::optional<rtbus::Writer<rtbus::BodyPoses>> bodies_;
  std::optional<rtbus::Writer<rtbus::LoopStats>> loop_;
  std::optional<rtbus::Writer<rtbus::NodeInfo>> info_;
  std::optional<rtbus::Writer<rtbus::Heartbeat>> beat_;
};

/// One bridge over one fixed session, and one peer, for all tests of the suite.
class BridgeProof : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    name_ = "bridgeproof" + std::to_string(getpid());
    session_ = std::make_unique<FixedSession>(name_);
    bridge_ = std::make_unique<Child>(std::vector<std::string>{
        std::string(RTBUS_BINARY_DIR) + "/rtbus", "bridge", std::string(RTBUS_SOURCE_DIR) + "/config/free_block.yaml",
        "--set", "session=" + name_, "--set", "bridge.publish=null", "--set", "bridge.network=lo"});
    peer_ = std::make_unique<FastPeer>();
    for (const Expected& each : kExpected) peer_->listen(each.topic, each.type, true, each.latched);
  }
  static void TearDownTestSuite() {
    EXPECT_EQ(bridge_->end(SIGTERM), 0);
    peer_.reset();
    session_.reset();
    EXPECT_EQ(tests::segments_of(name_), std::vector<std::string>{});
  }

  /// The newest message of the topic. Publishes until there is one.
  static Bytes message(const std::string& topic) {
    EXPECT_TRUE(eventually(30.0, [&] {
      session_->publish();
      return peer_->newest(topic).has_value();
    })) << topic;
    return peer_->newest(topic).value_or(Bytes{});
  }

  static inline std::string name_;
  static inline std::unique_ptr<FixedSession> session_;
  static inline std::unique_ptr<Child> bridge_;
  static inline std::unique_ptr<FastPeer> peer_;
};

TEST_F(BridgeProof, AnotherMakersDdsReceivesEveryType) {
  for (const Expected& each : kExpected) EXPECT_FALSE(message(each.topic).empty()) << each.topic;
}

TEST_F(BridgeProof, NamesTypesAndHashesAreThoseOfRos2) {
  const auto complete = [] {
    const auto found = peer_->writers();
    return std::all_of(std::begin(kExpected), std::end(kExpected),
                       [&](const Expected& each) { return found.count(each.topic) == 1; });
  };
  ASSERT_TRUE(eventually(30.0, complete));
  for (const Expected& each : kExpected) {
    const tests::FoundWriter found = peer_->writers()[each.topic];
    EXPECT_EQ(found.type, each.type) << each.topic;
    EXPECT_EQ(found.user_data, std::string("typehash=RIHS01_") + each.hash + ";") << each.topic;
    EXPECT_FALSE(found.keyed) << each.topic;
    EXPECT_TRUE(found.reliable) << each.topic;
    EXPECT_EQ(found.latched, each.latched) << each.topic;
  }
  EXPECT_EQ(peer_->writers().size(), std::size(kExpected));
}

TEST_F(BridgeProof, AReaderThatAsksForLessReceivesToo) {
  FastPeer other;
  other.listen("rt/haptic0/pose", "geometry_msgs::msg::dds_::PoseStamped_", false);
  EXPECT_TRUE(eventually(30.0, [&] {
    session_->publish();
    return other.received("rt/haptic0/pose") > 0;
  }));
}

TEST_F(BridgeProof, WhoComesLateGetsTheFixedFrames) {
  (void)message("rt/tf_static");
  FastPeer late;
  late.listen("rt/tf_static", "tf2_msgs::msg::dds_::TFMessage_", true, true);
  EXPECT_TRUE(eventually(30.0, [&] { return late.received("rt/tf_static") > 0; }));
}

/// Little-endian CDR behind its encapsulation, by hand: what our bytes are compared with.
class Cdr {
 public:
  Cdr& u32(std::uint32_t value) { return put(&value, sizeof value); }
  Cdr& f32(float value) { return put(&value, sizeof value); }
  Cdr& f64(std::initializer_list<double> values) {
    for (const double value : values) put(&value, sizeof value);
    return *this;
  }
  Cdr& text(const std::string& value) {
    u32(static_cast<std::uint32_t>(value.size() + 1));
    bytes_.insert(bytes_.end(), value.begin(), value.end());
    bytes_.push_back(0);
    return *this;
  }
  /// The stamp is left out of the comparison.
  Cdr& header(const std::string& frame) { return u32(0).u32(0).text(frame); }
  [[nodiscard]] std::string hex() const { return tests::hex(bytes_); }

 private:
  Cdr& put(const void* from, std::size_t size) {
    while (bytes_.size() % size != 0) bytes_.push_back(0);
    const auto* const begin = static_cast<const std::uint8_t*>(from);
    bytes_.insert(bytes_.end(), begin, begin + size);
    return *this;
  }
  Bytes bytes_;
};

/// Without encapsulation, which is checked, its padding, and the stamp.
std::string body_of(Bytes message) {
  EXPECT_GE(message.size(), 12u);
  if (message.size() < 12) return "";
  EXPECT_EQ(message[0], 0);
  EXPECT_EQ(message[1], 1) << "not plain CDR, little endian";
  EXPECT_EQ(message[2], 0);
  const std::size_t padding = message[3] & 3U;
  message.resize(message.size() - padding);
  std::fill_n(message.begin() + 4, 8, std::uint8_t{0});
  message.erase(message.begin(), message.begin() + 4);
  return tests::hex(message);
}

TEST_F(BridgeProof, BytesOfAPoseAreThePublishedOnes) {
  // Header "haptic0_base", (1, 2, 3), quaternion x y z w. Recorded once, so that a change of both sides is seen too.
  EXPECT_EQ(body_of(message("rt/haptic0/pose")),
            "0000000000000000"                                  // stamp
            "0d000000686170746963305f6261736500"                // 13, "haptic0_base"
            "000000"                                            // to the next multiple of four …
            "00000000"                                          // … and of eight
            "000000000000f03f00000000000000400000000000000840"  // 1 2 3
            "000000000000e0bf000000000000e03f000000000000e0bf000000000000e03f");
}

TEST_F(BridgeProof, BytesAreTheCdrOfThePublishedDefinitions) {
  const std::string base = "haptic0_base", world = "rtbus_world";
  EXPECT_EQ(body_of(message("rt/haptic0/pose")), Cdr().header(base).f64({1, 2, 3, -0.5, 0.5, -0.5, 0.5}).hex());
  EXPECT_EQ(body_of(message("rt/haptic0/twist")), Cdr().header(base).f64({0.5, -0.25, 0.125, 0, 0, 0}).hex());
  EXPECT_EQ(body_of(message("rt/haptic0/wrench")), Cdr().header(base).f64({-1, 4, 2, 0, 0, 0}).hex());
  EXPECT_EQ(body_of(message("rt/haptic0/proxy/pose")), Cdr().header(world).f64({0.5, 1, -2, 0, 0, 0, 1}).hex());
  EXPECT_EQ(body_of(message("rt/haptic0/proxy/twist")), Cdr().header(world).f64({1, 0, -1, 0, 2, 0}).hex());
  EXPECT_EQ(body_of(message("rt/haptic0/proxy/wrench")), Cdr().header(world).f64({0, 8, 0, 0, 0, 0}).hex());

  Cdr joy;
  joy.header(base).u32(1).f32(0.25F).u32(32).u32(1).u32(0).u32(1);
  for (int i = 3; i < 32; ++i) joy.u32(0);
  EXPECT_EQ(body_of(message("rt/haptic0/joy")), joy.hex());

  Cdr joints;
  joints.header(base).u32(3).text("haptic0/x").text("haptic0/y").text("haptic0/z");
  joints.u32(3).f64({1, 2, 3}).u32(3).f64({0.5, -0.25, 0.125}).u32(3).f64({-1, 4, 2});
  EXPECT_EQ(body_of(message("rt/haptic0/joint_states")), joints.hex());
}

/// Time since 1970 of a time of CLOCK_MONOTONIC, by the closest of several looks at both.
std::int64_t since_1970_ns(std::uint64_t monotonic_ns) {
  std::int64_t offset_ns = 0;
  std::uint64_t closest_ns = ~std::uint64_t{0};
  for (int look = 0; look < 20; ++look) {
    const std::uint64_t before_ns = rtbus::monotonic_ns();
    timespec now{};
    ::clock_gettime(CLOCK_REALTIME, &now);
    const std::uint64_t between_ns = rtbus::monotonic_ns() - before_ns;
    if (between_ns >= closest_ns) continue;
    closest_ns = between_ns;
    offset_ns = static_cast<std::int64_t>(now.tv_sec) * static_cast<std::int64_t>(rtbus::kNsPerS) + now.tv_nsec -
                static_cast<std::int64_t>(before_ns);
  }
  return static_cast<std::int64_t>(monotonic_ns) + offset_ns;
}

TEST_F(BridgeProof, StampsAreTheTimesOfTheSamplesSince1970) {
  const auto stamp_ns = [](const std::string& topic) {
    const Bytes bytes = message(topic);
    std::int32_t seconds = 0;
    std::uint32_t rest_ns = 0;
    EXPECT_GE(bytes.size(), 12u);
    std::memcpy(&seconds, bytes.data() + 4, sizeof seconds);
    std::memcpy(&rest_ns, bytes.data() + 8, sizeof rest_ns);
    return static_cast<double>(seconds) * 1e9 + static_cast<double>(rest_ns);
  };
  constexpr double kTolerance_ns = 5e6;
  const auto expected_ns = [](std::uint64_t at_ns) { return static_cast<double>(since_1970_ns(at_ns)); };
  for (const char* topic : {"rt/haptic0/pose", "rt/haptic0/twist", "rt/haptic0/joy"}) {
    EXPECT_NEAR(stamp_ns(topic), expected_ns(session_->device_ns()), kTolerance_ns) << topic;
  }
  for (const char* topic : {"rt/haptic0/wrench", "rt/haptic0/joint_states"}) {
    EXPECT_NEAR(stamp_ns(topic), expected_ns(session_->tick_ns()), kTolerance_ns) << topic;
  }
  for (const char* topic : {"rt/haptic0/proxy/pose", "rt/haptic0/proxy/twist", "rt/haptic0/proxy/wrench"}) {
    EXPECT_NEAR(stamp_ns(topic), expected_ns(session_->proxy_ns()), kTolerance_ns) << topic;
  }
}

/// What the independent decoder reads.
std::map<std::string, nlohmann::json> decode(const std::map<std::string, std::pair<std::string, Bytes>>& messages) {
  const std::string folder = std::string(RTBUS_SOURCE_DIR) + "/tests/bridge/decoder";
  const tests::TemporaryFolder work;
  std::string lines;
  for (const auto& [topic, message] : messages) lines += message.first + " " + tests::hex(message.second) + "\n";
  const std::string in = work.write("in", lines), out = work.path().string() + "/out";
  const std::string command = "node '" + folder + "/decode.mjs' <'" + in + "' >'" + out + "'";
  EXPECT_EQ(std::system(command.c_str()), 0) << command;
  std::ifstream answers(out);
  std::map<std::string, nlohmann::json> decoded;
  for (const auto& [topic, message] : messages) {
    std::string line;
    std::getline(answers, line);
    decoded[topic] = nlohmann::json::parse(line, nullptr, false);
  }
  return decoded;
}

/// v turned by the quaternion of a transform: x y z w.
std::array<double, 3> turned(const nlohmann::json& q, std::array<double, 3> v) {
  const double x = q["x"], y = q["y"], z = q["z"], w = q["w"];
  const std::array<double, 3> t{2 * (y * v[2] - z * v[1]), 2 * (z * v[0] - x * v[2]), 2 * (x * v[1] - y * v[0])};
  return {v[0] + w * t[0] + y * t[2] - z * t[1], v[1] + w * t[1] + z * t[0] - x * t[2],
          v[2] + w * t[2] + x * t[1] - y * t[0]};
}

TEST_F(BridgeProof, AnIndependentDecoderReadsTheValues) {
  const std::string modules = std::string(RTBUS_SOURCE_DIR) + "/tests/bridge/decoder/node_modules";
  if (::access(modules.c_str(), R_OK) != 0 || std::system("node --version >/dev/null 2>&1") != 0) {
    GTEST_SKIP() << "no node, or no " << modules << ": npm ci --prefix tests/bridge/decoder";
  }
  std::map<std::string, std::pair<std::string, Bytes>> messages;
  for (const Expected& each : kExpected) messages[each.topic] = {each.ros_type, message(each.topic)};
  auto decoded = decode(messages);

  const auto& pose = decoded["rt/haptic0/pose"];
  EXPECT_EQ(pose["header"]["frame_id"], "haptic0_base");
  EXPECT_EQ(pose["pose"]["position"], (nlohmann::json{{"x", 1.0}, {"y", 2.0}, {"z", 3.0}}));
  EXPECT_EQ(pose["pose"]["orientation"], (nlohmann::json{{"x", -0.5}, {"y", 0.5}, {"z", -0.5}, {"w", 0.5}}));
  timespec now{};
  ::clock_gettime(CLOCK_REALTIME, &now);
  EXPECT_NEAR(pose["header"]["stamp"]["sec"].get<double>(), static_cast<double>(now.tv_sec), 60.0);
  EXPECT_EQ(decoded["rt/haptic0/twist"]["twist"]["linear"]["y"], -0.25);
  EXPECT_EQ(decoded["rt/haptic0/wrench"]["wrench"]["force"], (nlohmann::json{{"x", -1.0}, {"y", 4.0}, {"z", 2.0}}));
  EXPECT_EQ(decoded["rt/haptic0/joy"]["buttons"].size(), 32u);
  EXPECT_EQ(decoded["rt/haptic0/joy"]["buttons"][2], 1);
  EXPECT_EQ(decoded["rt/haptic0/joy"]["axes"], nlohmann::json::array({0.25}));
  const auto& joints = decoded["rt/haptic0/joint_states"];
  EXPECT_EQ(joints["name"], nlohmann::json::array({"haptic0/x", "haptic0/y", "haptic0/z"}));
  EXPECT_EQ(joints["effort"], nlohmann::json::array({-1.0, 4.0, 2.0}));
  EXPECT_EQ(decoded["rt/haptic0/proxy/pose"]["header"]["frame_id"], "rtbus_world");
  EXPECT_EQ(decoded["rt/haptic0/proxy/twist"]["twist"]["angular"]["y"], 2.0);
  EXPECT_EQ(decoded["rt/haptic0/proxy/wrench"]["wrench"]["force"]["y"], 8.0);

  // Y up in our world is z up in that of REP 103; what lies before the user (−z) lies forward (x).
  const auto& fixed = decoded["rt/tf_static"]["transforms"];
  ASSERT_EQ(fixed.size(), 3u);
  EXPECT_EQ(fixed[0]["header"]["frame_id"], "world");
  EXPECT_EQ(fixed[0]["child_frame_id"], "rtbus_world");
  const auto& turn = fixed[0]["transform"]["rotation"];
  EXPECT_THAT(turned(turn, {0, 1, 0}), testing::Pointwise(testing::DoubleNear(1e-12), {0.0, 0.0, 1.0}));
  EXPECT_THAT(turned(turn, {0, 0, -1}), testing::Pointwise(testing::DoubleNear(1e-12), {1.0, 0.0, 0.0}));
  EXPECT_THAT(turned(turn, {1, 0, 0}), testing::Pointwise(testing::DoubleNear(1e-12), {0.0, -1.0, 0.0}));
  EXPECT_EQ(fixed[1]["child_frame_id"], "haptic0_base");
  EXPECT_EQ(fixed[1]["transform"]["translation"]["y"], 0.02);  // mapping.offset_m of the session
  EXPECT_EQ(fixed[2]["child_frame_id"], "body/floor");

  const auto& rows = decoded["rt/diagnostics"]["status"];
  ASSERT_EQ(rows.size(), 3u);
  EXPECT_EQ(rows[0]["name"], "rtbus " + name_ + ": haptic0");
  EXPECT_EQ(rows[1]["level"], 3) << "there is no physics node";
  EXPECT_EQ(rows[2]["message"], "running");
}

TEST_F(BridgeProof, MovingFramesAreInTheTree) {
  // The message in which all three moved.
  const auto contains = [](const Bytes& bytes, const std::string& text) {
    return std::search(bytes.begin(), bytes.end(), text.begin(), text.end()) != bytes.end();
  };
  EXPECT_TRUE(eventually(30.0, [&] {
    const Bytes bytes = message("rt/tf");
    session_->publish();
    return contains(bytes, "haptic0_hand") && contains(bytes, "haptic0_proxy") && contains(bytes, "body/block") &&
           !contains(bytes, "body/floor");
  }));
}

TEST(Bridge, AWrongNetworkIsRefusedWithASentence) {
  const tests::TemporaryFolder work;
  const std::string output = work.path().string() + "/out";
  Child bridge({std::string(RTBUS_BINARY_DIR) + "/rtbus", "bridge", std::string(RTBUS_SOURCE_DIR) + "/config/wall.yaml",
                "--set", "bridge.network=nosuch0"},
               output);
  EXPECT_EQ(WEXITSTATUS(bridge.wait()), 1);
  std::ostringstream said;
  said << std::ifstream(output).rdbuf();
  EXPECT_THAT(said.str(), testing::HasSubstr("rtbus bridge: DDS does not begin on network 'nosuch0', domain 0"));
}

}  // namespace
