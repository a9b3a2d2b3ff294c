// What the cells of `rtbus evaluate network --real` are compared by.
#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <set>
#include <string>
#include <vector>

#include "rtbus/config/session.hpp"
#include "tests/support/temporary_file.hpp"
#include "tools/evaluation/network/real_cell.hpp"

namespace {

using namespace tools;

/// A hand that rests at 10 mm until `begins_s`, then goes down at 0.05 m/s; the force is its way.
std::vector<StabilityTick> push(double begins_s, double until_s, double tick_s = 0.001) {
  std::vector<StabilityTick> out;
  for (int i = 1; i * tick_s <= until_s; ++i) {
    const double time_s = i * tick_s, way_m = 0.05 * std::max(0.0, time_s - begins_s);
    out.push_back({.time_s = time_s, .height_m = 0.01 - way_m, .force_n = way_m});
  }
  return out;
}

TEST(RealCells, AreTwelveOfTheGridEachOfWhichStandsAlone) {
  std::set<std::string> names;
  for (const RealCell& cell : real_cells()) {
    names.insert(cell.name);
    EXPECT_EQ(&real_cell(cell.name), &cell);
    const StabilityCase each = case_of(cell);
    EXPECT_EQ(each.network.round_trip_s, cell.network.round_trip_s);
    EXPECT_GE(each.start_s(), 3.0) << "two machines find each other before the hand moves";
    EXPECT_TRUE(each.network.exists());
  }
  EXPECT_EQ(names.size(), 12u);
  EXPECT_THROW((void)real_cell("wall"), rtbus::config::Error);
}

TEST(RealCells, VerdictTellsStableFromSwingingFromDiverged) {
  StabilityResult result;
  for (const StabilityOutcome calm :
       {StabilityOutcome::kSettled, StabilityOutcome::kMoving, StabilityOutcome::kLimitCycle}) {
    result.outcome = calm;
    EXPECT_EQ(verdict_of(result), NetworkVerdict::kStable);
  }
  result.outcome = StabilityOutcome::kDiverged;
  EXPECT_EQ(verdict_of(result), NetworkVerdict::kSwings);
  result.growing = true;
  EXPECT_EQ(verdict_of(result), NetworkVerdict::kDiverged);
  result.growing = false;
  result.clamped_s = 1.0;
  EXPECT_EQ(verdict_of(result), NetworkVerdict::kDiverged);
  result = {};
  result.outcome = StabilityOutcome::kFailed;
  EXPECT_EQ(verdict_of(result), NetworkVerdict::kDiverged);
}

TEST(RealCells, TheBeginningOfAPushIsFoundBetweenTwoTicks) {
  EXPECT_NEAR(leaves_start_s(push(1.0, 2.0), 0.5), 1.004, 1e-9);  // 0.2 mm at 0.05 m/s
  EXPECT_NEAR(leaves_start_s(push(1.0003, 2.0), 0.5), 1.0043, 1e-9);
  EXPECT_LT(leaves_start_s(push(3.0, 2.0), 0.5), 0.0) << "it never moved";
}

TEST(RealCells, ARunIsReadAtTheTimesOfAnother) {
  const std::vector<StabilityTick> truth = push(1.0, 2.0);
  const std::vector<StabilityTick> real = push(1.0173, 1.9, 0.0009);
  const std::vector<StabilityTick> same = at_times_of(truth, real, 0.0173);
  ASSERT_FALSE(same.empty());
  EXPECT_LT(same.back().time_s, 1.9);
  for (std::size_t i = 0; i < same.size(); ++i) {
    EXPECT_EQ(same[i].time_s, truth[i].time_s);
    EXPECT_NEAR(same[i].height_m, truth[i].height_m, 0.05 * 0.0009);
    EXPECT_NEAR(same[i].force_n, truth[i].force_n, 0.05 * 0.0009);
  }
  EXPECT_LT(compare_runs(same, truth, 0.5).force_rms_n, 1e-5);
}

TEST(RealCells, ARunThatWasNotWrittenWholeIsNone) {
  tests::TemporaryFolder folder;
  const std::string file = folder.path().string() + "/run";
  EXPECT_FALSE(read_real_run(file));
  std::ofstream(file) << std::string(sizeof(StabilityResult) + sizeof(StabilityTick) + 1, 'x');
  EXPECT_FALSE(read_real_run(file));
}

}  // namespace
