// The simulated device behind the device interface: what conformance does not ask of every driver.
#include "drivers/simulated/simulated_device.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <numeric>
#include <vector>

#include "drivers/registry/registry.hpp"
#include "drivers/simulated/simulated_config.hpp"
#include "rtbus/clock.hpp"
#include "rtbus/config/document.hpp"

namespace drivers::simulated {
namespace {

SimulatedSettings settings_of(const std::string& file, const std::vector<rtbus::config::Override>& overrides = {}) {
  auto map = rtbus::config::load(std::string(RTBUS_SOURCE_DIR) + "/config/devices/" + file, overrides);
  const auto config = parse_device(map);
  return dynamic_cast<const SimulatedConfig&>(*config).settings();
}

struct Drop {
  double settled_s;      // from the release to the last time the position leaves ±0.2 mm about its final mean
  double rest_m;         // that mean, over the last second
  bool bounced = false;  // it left the wall again after the first contact
};

// He & Choi (2013), Fig. 8: 20 mm fall onto a wall of 200 N/m and 0.02 N·s/m rendered at 1 kHz with a hold.
Drop drop(const SimulatedSettings& settings) {
  constexpr double kReleaseS = 1.0;
  SimulatedDevice device(settings);
  EXPECT_TRUE(device.start(0));
  std::vector<double> y_m;
  double last_m = 0.020;
  bool touched = false;
  Drop out{};
  for (std::uint64_t now_ns = rtbus::kNsPerMs; now_ns <= 6000 * rtbus::kNsPerMs; now_ns += rtbus::kNsPerMs) {
    DeviceSample sample;
    EXPECT_EQ(device.read(now_ns, sample), IoStatus::kOk);
    const double y = sample.position_m[1];
    const double velocity_m_s = (y - last_m) / 1e-3;
    const double force_n = y < 0.0 ? -200.0 * y - 0.02 * velocity_m_s : 0.0;
    EXPECT_EQ(device.write(now_ns, {{0.0, force_n, 0.0}}), IoStatus::kOk);
    last_m = y;
    out.bounced = out.bounced || (touched && y > 0.0);
    touched = touched || y < 0.0;
    y_m.push_back(y);
  }
  out.rest_m = std::accumulate(y_m.end() - 1000, y_m.end(), 0.0) / 1000.0;
  const auto outside =
      std::find_if(y_m.rbegin(), y_m.rend(), [&](double y) { return std::abs(y - out.rest_m) > 0.2e-3; });
  out.settled_s = 1e-3 * static_cast<double>(y_m.rend() - outside) - kReleaseS;
  return out;
}

TEST(SimulatedDevice, DropOntoAWallSettlesLikeTheRealPhantomDesktop) {
  const Drop result = drop(settings_of("sim_phantom_desktop_drop.yaml"));
  RecordProperty("settled_s", std::to_string(result.settled_s));
  RecordProperty("rest_m", std::to_string(result.rest_m));
  EXPECT_TRUE(result.bounced);
  EXPECT_NEAR(result.settled_s, 0.70, 0.15 * 0.70);
  // Weight over stiffness, within the band in which dry friction may stop it.
  EXPECT_NEAR(result.rest_m, -0.041 * 9.81 / 200.0, 0.06 / 200.0);
}

TEST(SimulatedDevice, DropWithoutDryFrictionGoesOnBouncing) {
  SimulatedSettings settings = settings_of("sim_phantom_desktop_drop.yaml");
  settings.mechanics.coulomb_n = 0.0;
  EXPECT_GT(drop(settings).settled_s, 1.5 * 0.70);  // so the test above does see the plant
}

TEST(SimulatedDevice, RepeatsBitByBitWithASteppedClock) {
  const auto run = [] {
    SimulatedDevice device(settings_of("sim_phantom_desktop_sinusoid.yaml", {{"mechanics.sample_jitter_us", "125"}}));
    EXPECT_TRUE(device.start(5 * rtbus::kNsPerMs));
    std::vector<double> out;
    for (std::uint64_t now_ns = 6 * rtbus::kNsPerMs; now_ns <= 2000 * rtbus::kNsPerMs; now_ns += rtbus::kNsPerMs) {
      DeviceSample sample;
      EXPECT_EQ(device.read(now_ns, sample), IoStatus::kOk);
      EXPECT_EQ(device.write(now_ns, {{0.0, std::max(0.0, -500.0 * sample.position_m[1]), 0.0}}), IoStatus::kOk);
      out.insert(out.end(), sample.position_m.begin(), sample.position_m.end());
    }
    return out;
  };
  EXPECT_EQ(run(), run());
}

TEST(SimulatedDevice, LateWriteHoldsTheOldForceForTheTimeThatPassed) {
  SimulatedDevice device(settings_of("sim_phantom_omni.yaml", {{"hand", "{type: none}"}}));
  ASSERT_TRUE(device.start(0));
  ASSERT_EQ(device.write(rtbus::kNsPerMs, {{1.0, 0.0, 0.0}}), IoStatus::kOk);
  ASSERT_EQ(device.write(11 * rtbus::kNsPerMs, {{0.0, 0.0, 0.0}}), IoStatus::kOk);  // nine periods late
  const double held_n = device.mechanics().parameters().force_step_n * std::round(1.0 / (3.3 / 2048));
  EXPECT_NEAR(device.mechanics().velocity_m_s().x(), (held_n - 0.26) / 0.045 * 0.010, 1e-3);
}

TEST(SimulatedDevice, PacesALoopAtItsSampleRate) {
  SimulatedDevice device(settings_of("sim_phantom_omni.yaml", {{"sample_rate_hz", "500"}}));
  const std::uint64_t start_ns = rtbus::monotonic_ns();
  ASSERT_TRUE(device.start(start_ns));
  EXPECT_TRUE(device.info().can_pace_loop);
  std::uint64_t last_ns = start_ns;
  for (int i = 0; i < 10; ++i) {
    ASSERT_EQ(device.wait_sample(last_ns + 1000 * rtbus::kNsPerMs), IoStatus::kOk);
    const std::uint64_t now_ns = rtbus::monotonic_ns();
    // Never early, never twice for one sample of 2 ms.
    EXPECT_GT((now_ns - start_ns) / (2 * rtbus::kNsPerMs), (last_ns - start_ns) / (2 * rtbus::kNsPerMs));
    last_ns = now_ns;
  }
  const std::uint64_t deadline_ns = rtbus::monotonic_ns() + 1000;
  EXPECT_EQ(device.wait_sample(deadline_ns), IoStatus::kTimeout);
  EXPECT_GE(rtbus::monotonic_ns(), deadline_ns);
  device.stop();
  EXPECT_EQ(device.wait_sample(rtbus::monotonic_ns() + 1000 * rtbus::kNsPerMs), IoStatus::kLost);
}

TEST(SimulatedDevice, ShowsTheScriptedButtons) {
  SimulatedDevice device(settings_of("sim_phantom_desktop_waypoints.yaml"));
  ASSERT_TRUE(device.start(0));
  DeviceSample sample;
  ASSERT_EQ(device.read(999 * rtbus::kNsPerMs, sample), IoStatus::kOk);
  EXPECT_EQ(sample.buttons, 0u);
  ASSERT_EQ(device.read(1001 * rtbus::kNsPerMs, sample), IoStatus::kOk);
  EXPECT_EQ(sample.buttons, 1u);
}

}  // namespace
}  // namespace drivers::simulated
