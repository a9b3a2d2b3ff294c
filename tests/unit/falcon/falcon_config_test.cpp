// The device file of a Falcon and of a virtual one: what is accepted, what it comes to, and what is refused with which
// words.
#include "drivers/falcon/falcon_config.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "drivers/falcon/boot_stream.hpp"
#include "drivers/virtual_devices/falcon/virtual_falcon.hpp"
#include "tests/support/bad_config.hpp"
#include "tests/support/temporary_file.hpp"

namespace drivers::falcon {
namespace {

using rtbus::config::Map;
using rtbus::config::Override;
using tests::BadConfig;

struct Read {
  FalconFile falcon;
  virtual_usb::VirtualFalconSettings device;
};

Read read(const std::string& file, const std::vector<Override>& overrides = {}) {
  Read out;
  Map map = rtbus::config::load(file, overrides);
  (void)map.choice("schema", {"device/1"});
  (void)map.choice("driver", {"falcon"});
  (void)map.text("serial", "");
  out.falcon = read_settings(map);
  if (auto usb = map.optional_map("usb")) {
    if (auto settings = usb->optional_map("virtual")) {
      out.device = virtual_usb::read_virtual_falcon(*settings);
      settings->finish();
    }
    usb->finish();
  }
  map.finish();
  return out;
}

std::string shipped(const std::string& name) { return std::string(RTBUS_SOURCE_DIR) + "/config/devices/" + name; }

class BadFalcon : public testing::TestWithParam<BadConfig> {};
TEST_P(BadFalcon, IsRefusedWithItsReason) {
  EXPECT_TRUE(tests::fails_as_expected(
      GetParam(), [](const std::string& file, const std::vector<Override>& sets) { (void)read(file, sets); }));
}
INSTANTIATE_TEST_SUITE_P(Files, BadFalcon, testing::ValuesIn(tests::bad_configs("falcon")), tests::bad_config_name);

TEST(FalconConfig, ShippedFilesShowTheDefaults) {
  const Read real = read(shipped("falcon.yaml"));
  const FalconSettings defaults;
  EXPECT_EQ(real.falcon.settings.firmware, nullptr);
  EXPECT_EQ(real.falcon.settings.command_gain, defaults.command_gain);
  EXPECT_EQ(real.falcon.settings.geometry.name, "libnifalcon");
  EXPECT_EQ(real.falcon.settings.centre_m, defaults.centre_m);
  EXPECT_EQ(real.falcon.settings.keep_homing_flag, defaults.keep_homing_flag);
  EXPECT_EQ(real.falcon.settings.patience.attempts, defaults.patience.attempts);
  EXPECT_EQ(real.falcon.info.max_force_n, 8.0);
  EXPECT_EQ(real.falcon.info.force_timeout_s, 0.020);
  EXPECT_TRUE(real.falcon.info.can_pace_loop);

  const Read simulated = read(shipped("virtual_falcon.yaml"));
  ASSERT_NE(simulated.falcon.settings.firmware, nullptr);
  EXPECT_TRUE(check_boot_stream(simulated.falcon.settings.firmware->bytes));
  const virtual_usb::VirtualFalconSettings device_defaults;
  EXPECT_EQ(simulated.device.serial, device_defaults.serial);
  EXPECT_EQ(simulated.device.arm.torque_timeout_ns, device_defaults.arm.torque_timeout_ns);
  EXPECT_EQ(simulated.device.arm.mechanics.mass_kg, device_defaults.arm.mechanics.mass_kg);
  EXPECT_EQ(simulated.device.arm.mechanics.start_position_m, Eigen::Vector3d(0, 0.015, 0));
}

TEST(FalconConfig, AFirmwareFileIsReadAndAnUnknownOneAccepted) {
  const tests::TemporaryFolder folder;
  const auto bytes = synthetic_boot_stream(500);
  folder.write("mine.bin", {reinterpret_cast<const char*>(bytes.data()), bytes.size()});
  const Read out =
      read(folder.write("device.yaml", "schema: device/1\ndriver: falcon\nfirmware: mine.bin\nforce_upload: true\n"));
  ASSERT_NE(out.falcon.settings.firmware, nullptr);
  EXPECT_EQ(out.falcon.settings.firmware->bytes, bytes);
  EXPECT_EQ(out.falcon.settings.firmware->known_as, "");
  EXPECT_TRUE(out.falcon.settings.force_upload);
}

TEST(FalconConfig, TheOtherGainBringsItsOwnGripMass) {
  const auto set = [](const char* text) { return rtbus::config::parse_override(text); };
  const Read out = read(shipped("falcon.yaml"),
                        {set("force_gain=libnifalcon"), set("grip_mass_kg=null"), set("force_calibration=1.1")});
  EXPECT_NEAR(out.falcon.settings.command_gain, 11000.0, 1e-9);
  EXPECT_NEAR(out.falcon.settings.grip_mass_kg, 0.090 / 1.1, 1e-12);  // the counts that were found by feel stay
}

}  // namespace
}  // namespace drivers::falcon
