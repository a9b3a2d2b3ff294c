/// local_contact on soft bodies, under the simulated clock.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "tools/evaluation/soft/soft_stroke.hpp"
#include "tools/harness/harness.hpp"

namespace {

#if RTBUS_WITH_BULLET

using tools::Harness;

tools::SoftOptions options() {
  tools::SoftOptions out;
  out.session_file = std::string(RTBUS_SOURCE_DIR) + "/config/soft.yaml";
  return out;
}

constexpr tools::SoftMachine kSlow{"18hz", "18 Hz", 18.0, 250.0, true};

TEST(LocalSoft, IsThreeTimesSmootherThanARemoteSpringAtEqualMeanForce) {
  const auto remote = tools::judge_stroke(tools::stroke_in_harness(
      options(), tools::stroke_settings(options(), kSlow, "remote_virtual_coupling", 0.0), nullptr));
  const auto local = tools::stroke_at_mean(options(), kSlow, "local_contact", remote.roughness.mean_n, nullptr);
  EXPECT_NEAR(local.figures.roughness.mean_n, remote.roughness.mean_n, tools::kEqualStrokes * remote.roughness.mean_n);
  EXPECT_GT(local.figures.held, 0.95);
  EXPECT_LE(local.figures.roughness.increment_rms_n, remote.roughness.increment_rms_n / 3.0);
  EXPECT_LE(local.figures.roughness.power_above_30hz_n2, remote.roughness.power_above_30hz_n2 / 9.0);
  // Pressed, held, stroked and let go: what came back is less than what went in.
  EXPECT_GE(local.stroke.absorbed_j, 0.0);
}

/// Mean force on the hand while it presses and holds still, N.
double held_n(const std::vector<std::string>& more) {
  std::vector<std::string> settings{"haptic.0.device.hand.impedance=firm", "physics.rate_hz=1000",
                                    "haptic.0.coupling.stiffness_n_per_m=1000"};
  settings.insert(settings.end(), more.begin(), more.end());
  auto session = tools::load_stroke(options(), settings);
  Harness harness(session, {});
  double sum_n = 0.0, most_n = 0.0;
  int count = 0;
  harness.run(3.0, [&](const rtbus::Telemetry& tick) {
    most_n = std::max(most_n, std::hypot(tick.force_n[0], tick.force_n[1], tick.force_n[2]));
    if (harness.now_s() < 2.5) return;
    sum_n += tick.force_n[1];
    ++count;
  });
  EXPECT_LE(most_n, harness.config().safety.max_force_n);
  EXPECT_EQ(harness.stepper()->world().recoveries(), 0U);
  for (std::size_t i = 0; i < harness.stepper()->world().soft_nodes(); ++i) {
    EXPECT_TRUE(harness.stepper()->world().soft_node(i).allFinite());
  }
  return sum_n / count;
}

// A firm hand on a stiff coupling. Bullet's own tool, a body on the same spring, without any latency, is the truth.
TEST(LocalSoft, AFirmHandFeelsWhatBulletsOwnToolBears) {
  const double own_n = held_n({"haptic.0.method=remote_virtual_coupling"});
  EXPECT_GT(own_n, 0.5);
  EXPECT_NEAR(held_n({"haptic.0.method=local_contact"}), own_n, 0.05 * own_n);
  EXPECT_NEAR(held_n({"haptic.0.method=local_contact", "physics.throttle_hz=18"}), own_n, 0.05 * own_n);
}

TEST(LocalSoft, RepeatsBitForBit) {
  std::uint64_t hash[2] = {};
  for (std::uint64_t& each : hash) {
    auto session = tools::load_stroke(options(), tools::stroke_settings(options(), kSlow, "local_contact", 0.0));
    Harness harness(session, {});
    harness.run(2.2, {});
    each = harness.hash();
  }
  EXPECT_EQ(hash[0], hash[1]);
}

#endif

}  // namespace
