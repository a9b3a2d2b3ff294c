/// The scene of soft bodies from end to end, under the simulated clock.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "tools/harness/harness.hpp"

namespace {

using rtbus::Telemetry;

#if RTBUS_WITH_BULLET

struct Felt {
  std::vector<double> force_n;
  double max_force_n = 0.0;
  std::uint64_t hash = 0;
};

Felt stroke(const std::vector<std::string>& assignments, double duration_s) {
  std::vector<rtbus::config::Override> overrides;
  for (const std::string& text : assignments) overrides.push_back(rtbus::config::parse_override(text));
  auto session = rtbus::config::load_session(std::string(RTBUS_SOURCE_DIR) + "/config/soft.yaml", overrides);
  tools::Harness harness(session, {});
  Felt felt;
  felt.max_force_n = harness.config().safety.max_force_n;
  harness.run(duration_s, [&](const Telemetry& tick) {
    felt.force_n.push_back(std::hypot(tick.force_n[0], tick.force_n[1], tick.force_n[2]));
  });
  felt.hash = harness.hash();
  return felt;
}

TEST(SoftSession, IsFeltWithBothMethodsWithinTheDevicesLimits) {
  for (const char* method : {"remote_virtual_coupling", "interpolation"}) {
    const Felt felt = stroke({std::string("haptic.0.method=") + method, "physics.throttle_hz=43"}, 3.0);
    for (const double force_n : felt.force_n) {
      ASSERT_TRUE(std::isfinite(force_n));
      ASSERT_LE(force_n, felt.max_force_n);
    }
    // In free air the tip sinks into the grip for a moment, and the coupling drags a little.
    const double before_n = *std::max_element(felt.force_n.begin() + 300, felt.force_n.begin() + 900);
    const double pressed_n = *std::min_element(felt.force_n.begin() + 2200, felt.force_n.begin() + 3000);
    EXPECT_GT(pressed_n, 3.0 * before_n) << method;
    for (std::size_t i = 2200; i < 3000; ++i)
      ASSERT_GT(felt.force_n[i], 0.05) << method << " lost contact at " << i << " ms";
  }
}

TEST(SoftSession, RepeatsBitForBit) {
  const Felt one = stroke({}, 1.8), two = stroke({}, 1.8);
  EXPECT_EQ(one.hash, two.hash);
}

TEST(SoftSession, StaysWithinLimitsWithExtremeSettings) {
  for (const char* extreme :
       {"scene.soft_bodies.middle.bulk_modulus_pa=1e9", "scene.soft_bodies.middle.pose_matching_hz=1000",
        "scene.soft_bodies.middle.mass_kg=1e-6", "scene.soft_bodies.middle.linear_stiffness=0.001",
        "haptic.0.coupling.stiffness_n_per_m=1400", "physics.throttle_hz=5"}) {
    const Felt felt = stroke({extreme}, 2.5);
    for (const double force_n : felt.force_n) {
      ASSERT_TRUE(std::isfinite(force_n)) << extreme;
      ASSERT_LE(force_n, felt.max_force_n) << extreme;
    }
  }
}

#endif

}  // namespace
