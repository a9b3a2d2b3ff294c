// Soft walls before the end stops: their force, their keys, and the loop that adds them before the safety ladder.
#include "haptic_node/workspace_walls.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <string>
#include <vector>

#include "haptic_node/loop.hpp"
#include "rtbus/config/session.hpp"
#include "tests/support/held_device.hpp"

namespace {

using Eigen::Vector3d;
using ::testing::AllOf;
using ::testing::Contains;
using ::testing::HasSubstr;
using ::testing::Not;

TEST(WorkspaceWalls, PushInwardBeyondThemAndNowhereElse) {
  haptic::WorkspaceWalls walls;
  EXPECT_FALSE(walls.exist()) << "off by default";
  walls.stiffness_n_per_m = 200.0;
  walls.min_m = {-0.07, -0.05, -0.05};
  walls.max_m = {0.07, 0.05, 0.05};
  const Vector3d still = Vector3d::Zero();
  EXPECT_EQ(walls.force_n(Vector3d(0.0699, -0.0499, 0.0), still).norm(), 0.0);
  EXPECT_NEAR((walls.force_n(Vector3d(0.08, -0.07, 0.0), still) - Vector3d(-2.0, 4.0, 0.0)).norm(), 0.0, 1e-9);
}

TEST(WorkspaceWalls, DampTheWayInAndNeverPullOutward) {
  haptic::WorkspaceWalls walls;
  walls.stiffness_n_per_m = 100.0;
  walls.damping_n_s_per_m = 10.0;
  walls.max_m = {0.07, 0.05, 0.05};
  walls.min_m = {-0.07, -0.05, -0.05};
  const Vector3d beyond(0.08, 0.0, 0.0);
  EXPECT_NEAR(walls.force_n(beyond, Vector3d(0.1, 0, 0)).x(), -2.0, 1e-9) << "1 N of spring, 1 N of damper";
  EXPECT_EQ(walls.force_n(beyond, Vector3d(-1.0, 0, 0)).x(), 0.0) << "on the way back the damper would pull outward";
  EXPECT_EQ(walls.force_n(-beyond, Vector3d(1.0, 0, 0)).x(), 0.0);
}

haptic::HapticConfig config_with(const std::vector<std::string>& assignments) {
  std::vector<rtbus::config::Override> overrides;
  for (const std::string& each : assignments) overrides.push_back(rtbus::config::parse_override(each));
  auto session = rtbus::config::load_session(std::string(RTBUS_SOURCE_DIR) + "/config/drop.yaml", overrides);
  return haptic::read_haptic_config(session, 0);
}

TEST(WorkspaceWalls, OfASessionStandInsideTheDevicesWorkspaceAndAreNoStifferThanTheCoupling) {
  EXPECT_FALSE(config_with({}).walls.exist()) << "published methods are as published";
  const haptic::HapticConfig config =
      config_with({"haptic.0.workspace_walls={stiffness_n_per_m: 5000, margin_m: 0.02}"});
  ASSERT_TRUE(config.walls.exist());
  EXPECT_EQ(config.walls.stiffness_n_per_m, config.stiffness_n_per_m) << "what the ladder's energy limit allows";
  EXPECT_THAT(config.warnings, Contains(AllOf(HasSubstr("workspace_walls.stiffness_n_per_m = 5000 is lowered to "),
                                              HasSubstr("raise coupling.stiffness_n_per_m"))));
  EXPECT_THAT(config_with({"haptic.0.workspace_walls={stiffness_n_per_m: 150}"}).warnings,
              Not(Contains(HasSubstr("workspace_walls"))));
  const drivers::DeviceInfo& device = config.device->info();
  for (std::size_t i = 0; i < 3; ++i) {
    EXPECT_DOUBLE_EQ(config.walls.min_m[i], device.workspace_min_m[i] + 0.02);
    EXPECT_DOUBLE_EQ(config.walls.max_m[i], device.workspace_max_m[i] - 0.02);
  }
  try {
    (void)config_with({"haptic.0.workspace_walls={margin_m: 0.1}"});
    FAIL() << "no room is left between the walls";
  } catch (const rtbus::config::Error& error) {
    EXPECT_THAT(error.what(), HasSubstr("leaves no room between the walls"));
  }
}

/// What the device gets after half a second with its tip 5 mm beyond the wall at its right.
double held_n(const std::vector<std::string>& assignments, double beyond_m) {
  const haptic::HapticConfig config = config_with(assignments);
  tests::HeldDevice device(config.device->info());
  device.sample.position_m = {device.info().workspace_max_m[0] - 0.010 + beyond_m, 0.02, 0.0};
  tests::SilentPhysics link;
  haptic::Loop loop(config, device, link, false);
  std::uint64_t now_ns = 1'000'000'000;
  for (int i = 0; i < 500; ++i) {
    now_ns += 1'000'000;
    loop.cycle(now_ns, now_ns);
  }
  return device.taken_n[0];
}

TEST(WorkspaceWalls, ReachTheDeviceThroughTheLadder) {
  EXPECT_EQ(held_n({}, 0.005), 0.0) << "free space without walls";
  const std::string walls = "haptic.0.workspace_walls={stiffness_n_per_m: 150}";
  EXPECT_EQ(held_n({walls}, -0.001), 0.0) << "inside";
  EXPECT_NEAR(held_n({walls}, 0.005), -0.75, 0.01) << "150 N/m, 5 mm beyond";
  EXPECT_NEAR(held_n({walls, "haptic.0.safety.max_force_n=0.5"}, 0.005), -0.5, 1e-6) << "the ladder limits it";
}

}  // namespace
