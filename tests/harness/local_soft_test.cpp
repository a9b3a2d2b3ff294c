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

// A firm hand on a stiff coupling wants to be 25 mm beyond the script. Later the body is squeezed out from under it.
TEST(LocalSoft, AHandThatPressesHardDoesNotFallThrough) {
  auto settings = tools::stroke_settings(options(), kSlow, "local_contact", 0.025);
  settings.insert(settings.end(), {"haptic.0.device.hand.impedance=firm", "haptic.0.coupling.stiffness_n_per_m=1000"});
  auto session = tools::load_stroke(options(), settings);
  Harness harness(session, {});
  double least_n = HUGE_VAL, most_n = 0.0;
  harness.run(3.0, [&](const rtbus::Telemetry& tick) {
    most_n = std::max(most_n, std::hypot(tick.force_n[0], tick.force_n[1], tick.force_n[2]));
    if (harness.now_s() > 1.2) least_n = std::min(least_n, tick.force_n[1]);
  });
  EXPECT_GT(most_n, 3.0);
  EXPECT_GT(least_n, 0.5) << "felt all the time";
  EXPECT_LE(most_n, harness.config().safety.max_force_n);
  EXPECT_EQ(harness.stepper()->world().recoveries(), 0U);
  for (std::size_t i = 0; i < harness.stepper()->world().soft_nodes(); ++i) {
    ASSERT_TRUE(harness.stepper()->world().soft_node(i).allFinite());
  }
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
