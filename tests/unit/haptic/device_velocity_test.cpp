// `velocity_estimator: device`, and what else a device tells of itself: its gripper.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>
#include <string>

#include "haptic_node/loop.hpp"
#include "rtbus/config/session.hpp"
#include "tests/support/held_device.hpp"

namespace device_velocity {

using ::testing::HasSubstr;

haptic::HapticConfig config_of(const std::string& device, const std::string& assignment) {
  auto session = rtbus::config::load_session(
      std::string(RTBUS_SOURCE_DIR) + "/config/drop.yaml",
      {rtbus::config::parse_override("haptic.0.device=devices/" + device), rtbus::config::parse_override(assignment)});
  return haptic::read_haptic_config(session, 0);
}

/// It stands still and says that it moves.
tests::HeldDevice talker(const drivers::DeviceInfo& info) {
  tests::HeldDevice out(info);
  out.sample.velocity_m_s = {0.1, 0.0, 0.0};
  out.sample.gripper_m = 0.012;
  return out;
}

/// What physics hears after ten cycles.
rtbus::DeviceState heard_of(tests::HeldDevice& device, const haptic::HapticConfig& config) {
  tests::SilentPhysics link;
  haptic::Loop loop(config, device, link, false);
  std::uint64_t now_ns = 1'000'000'000;
  for (int i = 0; i < 10; ++i) {
    now_ns += 1'000'000;
    loop.cycle(now_ns, now_ns);
  }
  return link.heard;
}

TEST(VelocityOfTheDevice, TakesTheEstimatesPlaceOnlyWhenTheSessionAsksForIt) {
  const auto own = config_of("touch.yaml", "haptic.0.velocity_estimator=device");
  const auto estimated = config_of("touch.yaml", "haptic.0.velocity_estimator=low_pass");
  tests::HeldDevice device = talker(own.device->info());
  EXPECT_EQ(heard_of(device, own).velocity_m_s[0], 0.1);
  EXPECT_EQ(heard_of(device, own).gripper_m, 0.012);
  EXPECT_EQ(heard_of(device, estimated).velocity_m_s[0], 0.0) << "it stands still";
}

TEST(VelocityOfTheDevice, ThatIsNoNumberMeansNoForce) {
  const auto own = config_of("touch.yaml", "haptic.0.velocity_estimator=device");
  const auto estimated = config_of("touch.yaml", "haptic.0.velocity_estimator=low_pass");
  tests::HeldDevice device = talker(own.device->info());
  EXPECT_EQ(heard_of(device, own).enabled, 1u);
  device.sample.velocity_m_s[0] = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(heard_of(device, own).enabled, 0u) << "as a lost device";
  EXPECT_EQ(heard_of(device, estimated).enabled, 1u) << "nobody asked for it";
}

TEST(VelocityOfTheDevice, IsRefusedOfADeviceThatMeasuresNone) {
  try {
    (void)config_of("sim_phantom_desktop.yaml", "haptic.0.velocity_estimator=device");
    FAIL();
  } catch (const rtbus::config::Error& error) {
    EXPECT_THAT(error.what(), HasSubstr("needs a device that measures its velocity, and phantom_desktop does not"));
  }
}

}  // namespace device_velocity
