/// The push into stacks of cubes (He & Choi 2013, Figs 15 and 16), pinned under the simulated clock: at equal mean
/// force remote coupling is the smoother one, at each of the paper's simulation rates and over its own loop. A
/// small stack stands for all; `rtbus evaluate stack` runs the paper's.
#include "tools/evaluation/stack/stack.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <string>

#include "rtbus/config/document.hpp"

#if RTBUS_WITH_BULLET

namespace {

using tools::StackCell;
using tools::StackOptions;

/// 45 cubes, three columns wide and three deep, are enough to push against.
StackOptions options(const std::vector<std::string>& assignments = {}) {
  StackOptions out{std::string(RTBUS_SOURCE_DIR) + "/config",
                   {"scene.bodies.cube.grid.count=[3, 5, 3]", "scene.bodies.cube.position_m=[-0.0201, 0.01, -0.01]"},
                   true};
  out.assignments.insert(out.assignments.end(), assignments.begin(), assignments.end());
  return out;
}

class PushedStack : public testing::TestWithParam<StackCell> {};

TEST_P(PushedStack, IsFeltSmootherByRemoteCouplingAtEqualMeanForce) {
  const tools::StackPair pair = compare_at_equal_mean(options(), GetParam());
  EXPECT_NEAR(pair.mean_ratio(), 1.0, tools::kEqualMean);
  EXPECT_LT(pair.increment_ratio(), 1.0);
  EXPECT_LT(pair.vibration_ratio(), 1.0);
  EXPECT_LT(pair.remote_same_hand.roughness.increment_rms_n, pair.interpolation.roughness.increment_rms_n);
  EXPECT_GT(pair.interpolation.roughness.mean_n, 0.05) << "the hand must have pushed";
  EXPECT_GT(pair.interpolation.touched_s, 0.4);
  EXPECT_LT(pair.interpolation.touched_s, 0.7);
}

INSTANTIATE_TEST_SUITE_P(Rates, PushedStack,
                         testing::Values(StackCell{"at_100_hz", 125, false, 100.0, 0.0, 800.0, true},
                                         StackCell{"at_43_hz", 125, false, 43.0, 0.0, 400.0, true},
                                         StackCell{"at_18_hz", 125, false, 18.0, 0.0, 275.0, true},
                                         StackCell{"over_a_pipe", 125, true, 0.0, 0.0, 450.0, true}),
                         [](const auto& row) { return std::string(row.param.id); });

// What that rests on: where interpolation does not vibrate, its ramp is the smoother one, and the steps of a held proxy
// are felt.
TEST(StackSensitivity, AFirmHandStillsTheInterpolation) {
  const StackCell cell{"firm", 125, false, 18.0, 0.0, 275.0, true};
  const tools::StackPair pair =
      compare_at_equal_mean(options({"haptic.0.device.hand.stiffness_n_per_m=700",
                                     "haptic.0.device.hand.damping_n_s_per_m=6", "haptic.0.device.hand.mass_kg=0.15"}),
                            cell);
  EXPECT_GT(pair.increment_ratio(), 1.0);
}

TEST(StackSetup, LeavesTheLastWordToTheUser) {
  const auto setup = stack_setup(options({"haptic.0.coupling.stiffness_n_per_m=123"}), tools::stack_cells().front(),
                                 "interpolation", 100.0, StackOptions::kPaperPush_s);
  EXPECT_EQ(setup.assignments.back(), "haptic.0.coupling.stiffness_n_per_m=123");
}

TEST(StackSetup, NamesTheKeyThatIsWrong) {
  try {
    (void)compare_at_equal_mean(options({"haptic.0.coupling.stifness_n_per_m=123"}), tools::stack_cells().front());
    FAIL() << "accepted";
  } catch (const rtbus::config::Error& error) {
    EXPECT_NE(std::string(error.what()).find("stifness_n_per_m"), std::string::npos) << error.what();
    EXPECT_NE(std::string(error.what()).find("stiffness_n_per_m"), std::string::npos) << "the nearest key";
  }
}

TEST(StackCells, AreThePapersRatesAndItsLoop) {
  int compared = 0;
  for (const StackCell& cell : tools::stack_cells()) {
    for (const tools::PublishedStack& paper : tools::published_stacks()) {
      if (paper.cubes == cell.cubes && cell.throttle_hz > 0.0) {
        EXPECT_EQ(cell.throttle_hz, paper.simulation_hz);
      }
    }
    compared += cell.compared ? 1 : 0;
  }
  EXPECT_EQ(compared, 6);
}

}  // namespace

#endif
