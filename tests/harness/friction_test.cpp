/// Static friction and rolling under a hand, with both methods at several rates of physics (simulated clock).
#include <gtest/gtest.h>

#include <cmath>
#include <string>
#include <vector>

#include "tools/harness/harness.hpp"

#if RTBUS_WITH_BULLET
namespace {

using tools::Harness;
using Settings = std::vector<std::string>;

constexpr const char* kMethods[] = {"local_contact", "remote_virtual_coupling"};
constexpr double kBoundN = 0.3 * 0.3 * 9.81;
/// What Bullet alone creeps in four seconds under a steady force of that size at the centre (docs/decisions/0020).
constexpr double kBareBullet_m = 0.2e-6;
constexpr const char* kPhysics_hz[] = {"null", "100", "43", "18"};

Harness harness_of(const std::string& file, const Settings& assignments) {
  std::vector<rtbus::config::Override> overrides;
  for (const std::string& text : assignments) overrides.push_back(rtbus::config::parse_override(text));
  auto settings = rtbus::config::load_session(std::string(RTBUS_SOURCE_DIR) + "/" + file, overrides);
  return Harness(settings, {});
}

/// @returns the last force on the hand along z.
double run(Harness& harness, double seconds) {
  double force_n = 0.0;
  harness.run(seconds, [&force_n](const rtbus::Telemetry& tick) { force_n = tick.force_n[2]; });
  return force_n;
}

Eigen::Vector3d place_of(const Harness& harness, std::size_t body) {
  return harness.stepper()->world().body_pose(body).position_m;
}

/// 0.3 kg, friction of the pair 0.3: it stands up to 0.883 N. The hand pushes 8 mm above its centre.
Settings heavy_block(const char* method, const char* physics_hz) {
  return {"scene.bodies.1.mass_kg=0.3",
          "scene.bodies.0.friction=0.5",
          "scene.bodies.1.friction=0.6",
          "haptic.0.coupling.stiffness_n_per_m=800",
          "haptic.0.mapping.offset_m=[0, 0.028, 0]",
          std::string("haptic.0.method=") + method,
          std::string("physics.throttle_hz=") + physics_hz,
          "haptic.0.device.mechanics.position_quantum_m=0",
          "haptic.0.device.hand={type: push, impedance: firm, start_m: [0, 0, 0.008], direction: [0, 0, -1], "
          "distance_m: 0.00493, speed_m_s: 0.01, start_s: 0.2}"};
}

// At 80 % of the bound it crept by 0.1 to 1 mm/s, viscously: Bullet's friction left out the torque of the hand, and
// stood across the push.
TEST(StaticFriction, HoldsABlockThatAHandPressesBelowTheBound) {
  for (const char* method : kMethods) {
    for (const char* physics_hz : kPhysics_hz) {
      Harness harness = harness_of("config/free_block.yaml", heavy_block(method, physics_hz));
      const double before_n = run(harness, 0.8 + 0.7);
      ASSERT_NEAR(before_n, 0.8 * kBoundN, 0.03 * kBoundN) << method << ", physics " << physics_hz;
      const double before_m = place_of(harness, 1).z();
      const double after_n = run(harness, 4.0);
      const double way_m = std::abs(place_of(harness, 1).z() - before_m);
      EXPECT_LE(way_m, kBareBullet_m + 2e-6) << method << ", physics " << physics_hz;
      EXPECT_GE(after_n, 0.98 * before_n) << method << ", physics " << physics_hz;
    }
  }
}

// A ball turns over its support. When the support turned with it in the replay of an answer, it came back at 18 Hz.
TEST(Rolling, ABallRollsTheWayThatTheFingerStrokesIt) {
  double truth_m = 0.0;
  for (const char* physics_hz : kPhysics_hz) {
    Harness harness = harness_of("tests/data/sessions/rolling_ball.yaml",
                                 {"haptic.0.method=local_contact", std::string("physics.throttle_hz=") + physics_hz});
    run(harness, 3.0);
    const double way_m = place_of(harness, 1).x() - 0.045;
    if (truth_m == 0.0) truth_m = way_m;
    EXPECT_GT(truth_m, 0.010);
    EXPECT_NEAR(way_m, truth_m, 0.2 * truth_m) << "physics " << physics_hz;
  }
}

}  // namespace
#endif
