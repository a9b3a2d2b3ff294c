// What `rtbus evaluate work-precision` claims, on a few of its cells.
#include "tools/evaluation/work_precision/work_precision.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "tools/evaluation/work_precision/precision_stack.hpp"

namespace {

using tools::PrecisionCell;
using tools::PrecisionRow;

tools::WorkPrecisionOptions options() {
  tools::WorkPrecisionOptions out;
  out.wall_file = std::string(RTBUS_SOURCE_DIR) + "/config/wall.yaml";
  out.sphere_file = std::string(RTBUS_SOURCE_DIR) + "/config/sphere.yaml";
  out.block_file = std::string(RTBUS_SOURCE_DIR) + "/config/free_block.yaml";
  out.soft_file = std::string(RTBUS_SOURCE_DIR) + "/config/soft.yaml";
  return out;
}

double force_error_n(const tools::PrecisionScene& scene, const PrecisionCell& cell, const tools::Reference& reference) {
  return tools::error_of(tools::run_precisely(scene, cell), scene, reference).force_rms_n;
}

TEST(WorkPrecision, DirectTendsToTheClosedFormAsItsRateGrows) {
  for (const auto& scene : {tools::wall_scene(options()), tools::drop_scene(options())}) {
    const tools::Reference exact = scene.name == "wall" ? tools::wall_reference(scene) : tools::drop_reference(scene);
    const double slow_n = force_error_n(scene, {"direct", 1000, 1000}, exact);
    const double fast_n = force_error_n(scene, {"direct", 1000, 4000}, exact);
    EXPECT_LT(fast_n, 0.6 * slow_n) << scene.name;
  }
}

TEST(WorkPrecision, TheErrorOfRemoteCouplingGrowsWithThePeriodOfPhysics) {
  const auto scene = tools::wall_scene(options());
  const tools::Reference exact = tools::wall_reference(scene);
  double before_n = 0.0;
  for (const double rate : {1000.0, 250.0, 100.0, 43.0, 18.0}) {
    const double error_n = force_error_n(scene, {"remote_virtual_coupling", rate, 1000}, exact);
    EXPECT_GT(error_n, before_n) << rate;
    before_n = error_n;
  }
}

TEST(WorkPrecision, TheConvergedLoopIsTheClosedFormOnTheWall) {
  auto scene = tools::wall_scene(options());
  scene.assignments.emplace_back("haptic.0.velocity_cutoff_hz=5000");
  scene.assignments.emplace_back("haptic.0.proxy.mass_kg=0.001");
  const tools::Reference exact = tools::wall_reference(scene);
  EXPECT_LT(force_error_n(scene, {"remote_virtual_coupling", 10000, 10000, 10000, 0, false}, exact), 5e-3);
}

#if RTBUS_WITH_BULLET
TEST(WorkPrecision, ASoftBodyIsKnownFarBetterThanAnyLateMethodRendersIt) {
  auto scene = tools::soft_scene(options());
  const auto loop = [&](double haptic_hz) {
    return tools::run_precisely(scene, {"remote_virtual_coupling", 1000, haptic_hz, 1000, 0, false});
  };
  const tools::PrecisionTrace coarse = loop(2000), fine = loop(4000);
  EXPECT_GT(*std::max_element(fine.force_n.begin(), fine.force_n.end()), 0.5);  // it is touched
  const double known_to_n = tools::error_of(coarse, scene, tools::reference_of(fine)).force_rms_n;
  EXPECT_LT(known_to_n, 0.01);
  double before_n = 10.0 * known_to_n;
  for (const double rate : {100.0, 18.0}) {
    const double error_n = force_error_n(scene, {"remote_virtual_coupling", rate, 1000}, tools::reference_of(fine));
    EXPECT_GT(error_n, before_n) << rate;
    before_n = error_n;
  }
}
#endif

#if RTBUS_WITH_BULLET
TEST(WorkPrecision, MeasuringTheCostChangesNothing) {
  const auto scene = tools::block_scene(options());
  std::uint64_t hash[2];
  for (const bool measured : {false, true}) {
    std::vector<rtbus::config::Override> overrides;
    for (const std::string& text : tools::assignments_of(scene, {"remote_virtual_coupling", 100, 1000}))
      overrides.push_back(rtbus::config::parse_override(text));
    auto session = rtbus::config::load_session(scene.session_file, overrides);
    tools::Harness harness(session, {.measure_cost = measured});
    harness.run(1.0, nullptr);
    hash[measured ? 1 : 0] = harness.hash();
    EXPECT_EQ(harness.cost().steps > 0, measured);
  }
  EXPECT_EQ(hash[0], hash[1]);
}
#endif

TEST(WorkPrecision, ErrorIsTakenOverTheWindowAlone) {
  tools::PrecisionScene scene;
  scene.from_s = 0.5;
  scene.until_s = 1.0;
  tools::PrecisionTrace trace;
  trace.time_s = {0.25, 0.5, 0.75, 1.0};
  trace.position_m = {9.0, 0.0, 1.0, 2.0};
  trace.force_n = {9.0, 1.0, 1.0, 1.0};
  const tools::PrecisionError error = tools::error_of(trace, scene, [](double t) {
    return tools::ReferencePoint{4.0 * (t - 0.5), 0.0};
  });
  EXPECT_DOUBLE_EQ(error.force_rms_n, 1.0);
  EXPECT_DOUBLE_EQ(error.position_peak_m, 0.0);
  EXPECT_DOUBLE_EQ(error.spurious_j, 2.0);  // 1 N pushed the hand 2 m, which the reference did not
}

TEST(WorkPrecision, TheParetoFrontHoldsWhatNothingBeats) {
  std::vector<PrecisionRow> rows(5);
  const double cost[] = {3, 1, 2, 4, 0.5}, error[] = {1, 5, 6, 0.5, 0.1};
  for (std::size_t i = 0; i < rows.size(); ++i) {
    rows[i].trace.cpu_s_per_s = cost[i];
    rows[i].error.force_rms_n = error[i];
    rows[i].trace.limit_n = 1.0;
  }
  rows[4].trace.wanted_peak_n = 2.0;  // diverged: on no front
  EXPECT_EQ(tools::pareto_front(rows), (std::vector<std::size_t>{1, 0, 3}));
}

TEST(WorkPrecision, IntervalsAreStudents) {
  // Ten values 1 … 10: mean 5.5, s = 3.0277, t(9) = 2.262: ± 2.1657.
  std::vector<double> values;
  for (int i = 1; i <= 10; ++i) values.push_back(i);
  const tools::MeanInterval interval = tools::mean_interval(values);
  EXPECT_DOUBLE_EQ(interval.mean, 5.5);
  EXPECT_NEAR(interval.half_width, 2.1657, 1e-3);
  EXPECT_TRUE(std::isnan(tools::mean_interval({1.0}).half_width));
}

}  // namespace
