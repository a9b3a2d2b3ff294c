// The keys of `bridge:`, and the one rotation.
#include "tools/bridge/config/bridge_config.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/support/bad_config.hpp"
#include "tests/support/temporary_file.hpp"
#include "tools/bridge/frames.hpp"

namespace {

using bridge::BridgeConfig;
using bridge::Stream;
using rtbus::config::Override;
using tests::BadConfig;

BridgeConfig read(const std::string& file, const std::vector<Override>& overrides) {
  rtbus::config::SessionConfig session = rtbus::config::load_session(file, overrides);
  std::vector<haptic::HapticConfig> haptic;
  for (std::size_t i = 0; i < session.haptic.size(); ++i) haptic.push_back(haptic::read_haptic_config(session, i));
  return bridge::read_bridge_config(session, haptic);
}

/// config/wall.yaml with these keys changed.
BridgeConfig wall(const std::vector<std::string>& assignments) {
  std::vector<Override> overrides;
  for (const std::string& text : assignments) overrides.push_back(rtbus::config::parse_override(text));
  return read(std::string(RTBUS_SOURCE_DIR) + "/config/wall.yaml", overrides);
}

class BadBridge : public testing::TestWithParam<BadConfig> {};
TEST_P(BadBridge, IsRefusedWithItsReason) {
  EXPECT_TRUE(tests::fails_as_expected(
      GetParam(), [](const std::string& file, const std::vector<Override>& sets) { (void)read(file, sets); }));
}
INSTANTIATE_TEST_SUITE_P(Files, BadBridge, testing::ValuesIn(tests::bad_configs("bridge")), tests::bad_config_name);

TEST(BridgeConfig, WithoutKeysEverythingIsPublishedHereAndNoOrderTaken) {
  const BridgeConfig config = wall({});
  EXPECT_EQ(config.domain, 0);
  EXPECT_EQ(config.network, "lo");
  for (const bridge::StreamConfig& each : config.streams) {
    EXPECT_TRUE(each.on);
    EXPECT_TRUE(each.reliable);
    EXPECT_GT(each.rate_hz, 0.0);
  }
  EXPECT_FALSE(config.orders.any());
  EXPECT_EQ(config.topic(Stream::kPose, "haptic0"), "/haptic0/pose");
  EXPECT_EQ(config.topic(Stream::kProxyWrench, "haptic1"), "/haptic1/proxy/wrench");
  EXPECT_EQ(config.topic(Stream::kDiagnostics, ""), "/diagnostics");
}

TEST(BridgeConfig, WhatPublishNamesIsPublishedAndNothingElse) {
  const BridgeConfig config =
      wall({"bridge.namespace=/lab/desk", "bridge.publish.pose={rate_hz: 500, topic: hand, reliable: false}",
            "bridge.publish.tf={}"});
  EXPECT_EQ(config.topic(Stream::kPose, "haptic0"), "/lab/desk/haptic0/hand");
  EXPECT_EQ(config.topic(Stream::kTf, "haptic0"), "/tf");
  EXPECT_EQ(config.of(Stream::kPose).rate_hz, 500.0);
  EXPECT_FALSE(config.of(Stream::kPose).reliable);
  EXPECT_EQ(config.of(Stream::kTf).rate_hz, 30.0);
  int on = 0;
  for (const bridge::StreamConfig& each : config.streams) on += each.on ? 1 : 0;
  EXPECT_EQ(on, 2);
}

TEST(BridgeConfig, AnAdjustableGainHasTheLimitsOfItsDevice) {
  const BridgeConfig config = wall({"haptic.0.adjustable=[coupling.stiffness_n_per_m, coupling.damping_n_s_per_m]",
                                    "bridge.orders.adjust=[{key: haptic0.coupling.stiffness_n_per_m, most: 250}, "
                                    "{key: haptic0.coupling.damping_n_s_per_m, timeout_s: 3}]"});
  ASSERT_EQ(config.orders.adjust.size(), 2u);
  const bridge::AdjustOrder& stiffness = config.orders.adjust[0];
  EXPECT_EQ(config.order_topic(stiffness.topic), "/adjust/haptic0/coupling/stiffness_n_per_m");
  EXPECT_EQ(stiffness.initial, 200.0);
  EXPECT_EQ(stiffness.least, 1.0);
  EXPECT_EQ(stiffness.most, 250.0);
  EXPECT_EQ(config.orders.adjust[1].least, 0.0);
  EXPECT_EQ(config.orders.adjust[1].timeout_s, 3.0);
}

TEST(BridgeConfig, EmptyMapsSwitchOrdersOnWithTheirTimeOuts) {
  const BridgeConfig config = wall({"bridge.orders={estop: {}, enable: {}, mark: {}}"});
  EXPECT_EQ(config.orders.estop_timeout_s, 1.0);
  EXPECT_EQ(config.orders.enable_timeout_s, 0.5);
  EXPECT_EQ(config.orders.marks_per_s, 5.0);
}

TEST(BridgeFrames, OurWorldStandsUprightInThatOfRep103) {
  const Eigen::Quaterniond turn = bridge::ros_from_world();
  EXPECT_NEAR(turn.norm(), 1.0, 1e-15);
  const auto is = [](const Eigen::Vector3d& v, double x, double y, double z) {
    return (v - Eigen::Vector3d(x, y, z)).norm() < 1e-15;
  };
  EXPECT_TRUE(is(turn * Eigen::Vector3d::UnitY(), 0, 0, 1)) << "up";
  EXPECT_TRUE(is(turn * -Eigen::Vector3d::UnitZ(), 1, 0, 0)) << "away from the user: forward";
  EXPECT_TRUE(is(turn * Eigen::Vector3d::UnitX(), 0, -1, 0)) << "to the right";
}

TEST(BridgeConfig, ExtraForceIsOrderedWhereTheHapticEntryAllowsIt) {
  const BridgeConfig config = wall({"bridge.orders.extra_wrench.timeout_s=0.3", "bridge.orders.clutch.timeout_s=0.4",
                                    "haptic.0.extra_force_max_n=1"});
  EXPECT_EQ(config.orders.takes_extra_force, std::vector<std::string>{"haptic0"});
  EXPECT_EQ(config.orders.extra_wrench_timeout_s, 0.3);
  EXPECT_EQ(config.orders.clutch, std::vector<std::string>{"haptic0"});
  EXPECT_EQ(config.orders.clutch_timeout_s, 0.4);
  EXPECT_TRUE(config.orders.any());
}

TEST(BridgeConfig, NamesPeersWhereThereIsNoMulticast) {
  EXPECT_EQ(wall({"bridge.peers=[192.168.7.2, lab-pc]"}).peers, (std::vector<std::string>{"192.168.7.2", "lab-pc"}));
}

}  // namespace
