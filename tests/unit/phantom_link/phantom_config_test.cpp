// Device files of the PHANToM-class driver: the shipped ones are right, wrong ones are refused with a sentence that
// helps.
#include "drivers/phantom/phantom_config.hpp"

#include <gtest/gtest.h>

#include <string>

#include "drivers/virtual_devices/kinds.hpp"
#include "tests/support/bad_config.hpp"

namespace drivers::phantom {
namespace {

using rtbus::config::Override;
using tests::BadConfig;

void read(const std::string& file, const std::vector<Override>& sets) {
  auto map = rtbus::config::load(file, sets);
  (void)map.choice("schema", {"device/1"});
  (void)map.choice("driver", {"phantom"});
  const auto config = parse(map, virtual_usb::find_kind("phantom"));
  map.finish();
  ASSERT_NE(config, nullptr);
}

std::string shipped(const char* name) { return std::string(RTBUS_SOURCE_DIR) + "/config/devices/" + name + ".yaml"; }

TEST(PhantomDeviceFiles, ShippedOnesAreAccepted) {
  for (const char* name : {"vintage_phantom", "polhem", "woodenhaptics", "virtual_phantom"}) {
    EXPECT_NO_THROW(read(shipped(name), {})) << name;
  }
}

// The files spell every key out with its default: without them the same device comes out.
TEST(PhantomDeviceFiles, DocumentedDefaultsAreTheDefaults) {
  for (const char* name : {"vintage_phantom", "polhem", "woodenhaptics"}) {
    auto map = rtbus::config::load(shipped(name));
    const PhantomFile spelled = read_file(map);
    std::vector<Override> bare;
    for (const char* key : {"homing", "home_tolerance_rad", "gravity_compensation", "motors", "gimbal", "limits",
                            "sample_rate_hz", "exchanges_per_period", "forearm_m"}) {
      bare.push_back({key, "null"});
    }
    auto other = rtbus::config::load(shipped(name), bare);
    const PhantomFile defaults = read_file(other);
    const DeviceInfo &a = spelled.info, &b = defaults.info;
    EXPECT_EQ(a.model, b.model);
    EXPECT_EQ(a.max_force_n, b.max_force_n);
    EXPECT_EQ(a.continuous_force_n, b.continuous_force_n);
    EXPECT_EQ(a.thermal_time_constant_s, b.thermal_time_constant_s);
    EXPECT_EQ(a.max_slew_n_per_ms, b.max_slew_n_per_ms);
    EXPECT_EQ(a.max_stiffness_n_per_m, b.max_stiffness_n_per_m);
    EXPECT_EQ(a.max_speed_m_s, b.max_speed_m_s);
    EXPECT_EQ(a.workspace_min_m, b.workspace_min_m);
    EXPECT_EQ(a.workspace_max_m, b.workspace_max_m);
    EXPECT_EQ(a.position_quantum_m, b.position_quantum_m);
    EXPECT_EQ(a.sample_rate_hz, b.sample_rate_hz);
    EXPECT_EQ(spelled.fetch_first, defaults.fetch_first);
    EXPECT_EQ(spelled.settings.homing, defaults.settings.homing);
    EXPECT_EQ(spelled.settings.home_tolerance_rad, defaults.settings.home_tolerance_rad);
    EXPECT_EQ(spelled.settings.motors.peak_ma, defaults.settings.motors.peak_ma);
    EXPECT_EQ(spelled.settings.motors.continuous_ma, defaults.settings.motors.continuous_ma);
    EXPECT_EQ(spelled.settings.gravity_share, defaults.settings.gravity_share);
    EXPECT_EQ(spelled.settings.gimbal_sign, defaults.settings.gimbal_sign);
    EXPECT_EQ(spelled.settings.gimbal_zero_rad, defaults.settings.gimbal_zero_rad);
    EXPECT_EQ(spelled.settings.model.arm.forearm_m, defaults.settings.model.arm.forearm_m);
  }
}

TEST(PhantomDeviceFiles, ContinuousForceAndQuantumFollowFromTheArm) {
  const auto info = [](const char* name, const char* forearm) {
    auto map = rtbus::config::load(shipped(name), {{"forearm_m", forearm}});
    return read_file(map).info;
  };
  // The published figures: 1.6…2.0 N at 1.24 A, a step of 23…28 µm.
  const DeviceInfo vintage = info("vintage_phantom", "0.112");
  EXPECT_NEAR(vintage.continuous_force_n, 1.62, 0.05);
  EXPECT_GT(vintage.position_quantum_m, 22e-6);
  EXPECT_LT(vintage.position_quantum_m, 29e-6);
  EXPECT_EQ(info("vintage_phantom", "0.097").dof_sensed, 6);
  EXPECT_EQ(info("woodenhaptics", "0.245").dof_sensed, 3);
}

class BadPhantomFile : public ::testing::TestWithParam<BadConfig> {};
TEST_P(BadPhantomFile, IsRefusedWithItsReason) { EXPECT_TRUE(tests::fails_as_expected(GetParam(), read)); }
INSTANTIATE_TEST_SUITE_P(Files, BadPhantomFile, ::testing::ValuesIn(tests::bad_configs("phantom")),
                         tests::bad_config_name);

}  // namespace
}  // namespace drivers::phantom
