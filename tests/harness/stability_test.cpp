/// Stability cases that went wrong once. tests/data/stability_seeds.tsv has the seeds and what they have to be now.
#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <numbers>
#include <sstream>
#include <string>
#include <vector>

#include "tools/evaluation/stability/parallel_cases.hpp"
#include "tools/evaluation/stability/stability_run.hpp"
#include "tools/evaluation/stability/stability_watch.hpp"

namespace {

using tools::StabilityOutcome;
using tools::StabilityResult;

const std::string kSession = std::string(RTBUS_SOURCE_DIR) + "/config/wall.yaml";

struct Seed {
  std::uint64_t seed;
  /// "rest": settled, or on its way there; "small": likewise, or an oscillation below the bars; "steady": finite,
  /// within the limit, and neither oscillation nor deficit grow; "bounded": finite and within the limit.
  std::string outcome;
  std::string why;
};
void PrintTo(const Seed& seed, std::ostream* out) { *out << seed.seed << ' ' << seed.outcome; }

std::vector<Seed> seeds() {
  std::vector<Seed> out;
  std::ifstream file(std::string(RTBUS_SOURCE_DIR) + "/tests/data/stability_seeds.tsv");
  for (std::string line; std::getline(file, line);) {
    if (line.empty() || line[0] == '#') continue;
    std::istringstream fields(line);
    Seed seed{};
    fields >> seed.seed >> seed.outcome;
    std::getline(fields, seed.why);
    out.push_back(seed);
  }
  return out;
}

class PastSeed : public testing::TestWithParam<Seed> {
 protected:
  /// @returns false: it is not at rest, but an oscillation below the bars.
  static bool judge(const tools::StabilityCase& each, const std::string& wanted) {
    const StabilityResult result = tools::run_case(each, kSession, {});
    SCOPED_TRACE(describe(each) + ": " + result.error);
    EXPECT_NE(result.outcome, StabilityOutcome::kFailed);
    EXPECT_EQ(result.nonfinite, 0u);
    EXPECT_EQ(result.above_limit, 0u);
    if (wanted == "bounded") return true;
    EXPECT_FALSE(result.growing);
    EXPECT_LE(result.deficit_growth_j, tools::kDeficitBarJ);
    if (wanted == "steady") return true;
    const bool rests = result.outcome == StabilityOutcome::kSettled || result.outcome == StabilityOutcome::kMoving;
    EXPECT_TRUE(rests || result.outcome == StabilityOutcome::kLimitCycle)
        << to_string(result.outcome) << ", swing " << result.swing_n << " N, " << result.swing_m * 1e3 << " mm";
    EXPECT_GE(result.lowest_observed_j, result.deficit_bar_j());
    EXPECT_LE(result.deficit_s, tools::kDeficitBarS);
    return rests;
  }
};

// Which start of a stack leaves its boxes wobbling is decided by last bits, which differ between processors. So a stack
// has to rest from most of five heights, which are micrometres apart, and is never above the bars.
TEST_P(PastSeed, StaysMended) {
  tools::StabilityCase each = tools::draw_case(GetParam().seed);
#if !RTBUS_WITH_BULLET
  if (each.needs_bullet()) GTEST_SKIP() << "bullet is not built";
#endif
  const std::string& wanted = GetParam().outcome;
  const int starts = wanted == "rest" && each.task == tools::StabilityTask::kStack ? 5 : 1;
  const double height_m = each.height_m;
  int rest = 0;
  for (int start = 0; start < starts; ++start) {
    each.height_m = height_m * (1.0 + 0.002 * start);
    rest += judge(each, wanted) ? 1 : 0;
  }
  if (wanted == "rest") {
    EXPECT_GT(2 * rest, starts) << "of " << starts << " starts";
  }
}

INSTANTIATE_TEST_SUITE_P(Seeds, PastSeed, testing::ValuesIn(seeds()),
                         [](const auto& row) { return std::to_string(row.param.seed); });

TEST(StabilityCase, IsTheSameFromTheSameSeed) {
  for (const std::uint64_t seed : {3u, 17u, 221u}) {
    EXPECT_EQ(assignments_of(tools::draw_case(seed)), assignments_of(tools::draw_case(seed)));
    const StabilityResult first = tools::run_case(tools::draw_case(seed), kSession, {});
    const StabilityResult second = tools::run_case(tools::draw_case(seed), kSession, {});
    EXPECT_EQ(first.outcome, second.outcome);
    EXPECT_EQ(first.plant_work_j, second.plant_work_j);
    EXPECT_EQ(first.peak_n, second.peak_n);
  }
}

// A classifier that never says "diverged" would pass everything: the published interpolation at 500 N/m and 50 Hz does.
TEST(StabilityCase, FindsThatThePublishedInterpolationDiverges) {
  tools::StabilityCase each;
  each.method = "interpolation";
  each.paper = true;
  each.stiffness_n_per_m = 500.0;
  each.physics_hz = 50.0;
  const StabilityResult result = tools::run_case(each, kSession, {});
  EXPECT_EQ(result.outcome, StabilityOutcome::kDiverged) << result.error;
  EXPECT_EQ(result.above_limit, 0u);
}

/// What the watch of the sweep says of an oscillation of 0.1 N and 1 mm, 10 Hz, that grows by so much per second.
StabilityResult watched(double growth_per_s) {
  const tools::StabilityCase each;
  const tools::WatchTimes times(each);
  constexpr double kTick_s = 1e-3;
  StabilityResult out;
  tools::Watch watch(each, 7.9, kTick_s, out);
  watch.begin_windows();
  double since_s = 0.0;
  while (since_s < times.watched_s) {
    for (double window_s = 0.0; window_s < times.window_s; window_s += kTick_s, since_s += kTick_s) {
      const double size = std::exp(growth_per_s * since_s) * std::sin(2.0 * std::numbers::pi * 10.0 * since_s);
      rtbus::Telemetry tick{};
      tick.force_n = {0.0, 0.1 * size, 0.0};
      watch.tick(tick, {0.0, 1e-3 * size, 0.0}, 0.0, each.end_s() + since_s);
    }
    (void)watch.end_window();
  }
  watch.judge(false);
  return out;
}

// Nor one that never says "growing", nor one that always does.
TEST(StabilityCase, TellsAnOscillationThatGrowsFromOneThatDoesNot) {
  const StabilityResult grows = watched(0.1), steady = watched(0.0), fades = watched(-0.2);
  EXPECT_TRUE(grows.growing);
  EXPECT_EQ(grows.outcome, StabilityOutcome::kDiverged);
  EXPECT_FALSE(steady.growing);
  EXPECT_EQ(steady.outcome, StabilityOutcome::kDiverged);
  EXPECT_FALSE(fades.growing);
  EXPECT_EQ(fades.outcome, StabilityOutcome::kMoving);
}

TEST(StabilityCase, ReportsAStiffnessThatIsLowered) {
  tools::StabilityCase each;
  each.stiffness_n_per_m = 2000.0;
  const StabilityResult result = tools::run_case(each, kSession, {});
  EXPECT_DOUBLE_EQ(result.rendered_n_per_m, 1480.0);
}

// A case that kills its process is one failed case; the others go on.
TEST(ParallelCases, SurviveACaseThatCrashes) {
  std::vector<int> seen(7, 0);
  int failed = 0;
  EXPECT_TRUE(tools::run_cases(
      7, 2,
      [](std::size_t i) {
        if (i == 2) std::abort();
        StabilityResult result;
        result.outcome = StabilityOutcome::kSettled;
        return result;
      },
      [&](const StabilityResult& result) {
        ++seen[result.index];
        if (result.outcome == StabilityOutcome::kFailed) ++failed;
      }));
  EXPECT_EQ(seen, std::vector<int>(7, 1));
  EXPECT_EQ(failed, 1);
}

}  // namespace
