/// A physics that wants to hurt: what the ladder promises holds, and the bound of the energy means something.
/// tests/data/worst_physics_seeds.tsv keeps the hardest cases that a search has found.
#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <fstream>
#include <sstream>
#include <string>
#include <vector>

#include "tools/evaluation/worst_physics/worst_search.hpp"

namespace {

using tools::WorstOutcome;
using tools::WorstPhysicsOptions;
using tools::WorstSearch;

const std::string kSession = std::string(RTBUS_SOURCE_DIR) + "/config/wall.yaml";

struct Seed {
  std::string method;
  double least_w = 0.0;  ///< Power that it is known to give: a search that finds less does not look any more.
  std::vector<std::uint64_t> lineage;
};
void PrintTo(const Seed& seed, std::ostream* out) { *out << seed.method << ' ' << seed.lineage.front(); }

std::vector<Seed> seeds() {
  std::vector<Seed> out;
  std::ifstream file(std::string(RTBUS_SOURCE_DIR) + "/tests/data/worst_physics_seeds.tsv");
  for (std::string line; std::getline(file, line);) {
    if (line.empty() || line[0] == '#') continue;
    std::istringstream fields(line);
    Seed seed;
    fields >> seed.method >> seed.least_w;
    for (std::uint64_t number = 0; fields >> number;) seed.lineage.push_back(number);
    out.push_back(seed);
  }
  return out;
}

void expect_holds(const WorstOutcome& out) {
  EXPECT_EQ(out.nonfinite, 0u);
  EXPECT_EQ(out.above_limit, 0u);
  EXPECT_LE(out.growth_n, out.growth_bound_n) << "N in one tick";
  EXPECT_LE(out.power_w, out.bound_w);
  EXPECT_LE(out.recovery_error_n, out.recovery_bound_n) << "a second after the last lie";
}

class WorstPhysics : public testing::TestWithParam<Seed> {};
GTEST_ALLOW_UNINSTANTIATED_PARAMETERIZED_TEST(WorstPhysics);

TEST_P(WorstPhysics, StaysWithinItsBounds) {
  tools::WorstSetup setup;
  setup.session_file = kSession;
  SCOPED_TRACE(tools::describe(tools::hostile_plan(GetParam().method, GetParam().lineage)));
  const WorstOutcome out = tools::run_worst_case(GetParam().method, GetParam().lineage, setup);
  expect_holds(out);
  EXPECT_GE(out.power_w, GetParam().least_w);
}

INSTANTIATE_TEST_SUITE_P(Seeds, WorstPhysics, testing::ValuesIn(seeds()),
                         [](const auto& row) { return row.param.method + "_" + std::to_string(row.index); });

/// RTBUS_WORST_ANSWERS: how many hostile answers per method; the label soak takes a million.
class WorstSearchOf : public testing::TestWithParam<const char*> {};

TEST_P(WorstSearchOf, FindsNothingBeyondTheBounds) {
  WorstPhysicsOptions options;
  options.session_file = kSession;
  const char* const asked = std::getenv("RTBUS_WORST_ANSWERS");
  options.answers = asked != nullptr ? std::strtoull(asked, nullptr, 10) : 40'000;
  const WorstSearch found = tools::search_worst_physics(GetParam(), options, [](const WorstSearch&) { return true; });
  std::printf("%s: %llu answers in %llu cases, worst %.2f W of %.2f W\n", GetParam(),
              static_cast<unsigned long long>(found.answers), static_cast<unsigned long long>(found.cases),
              found.power.outcome.power_w, found.power.outcome.bound_w);
  for (const tools::WorstFound& broken : found.broken) {
    SCOPED_TRACE(tools::describe(tools::hostile_plan(GetParam(), broken.lineage)));
    expect_holds(broken.outcome);
  }
  EXPECT_TRUE(found.broken.empty());
  if (asked != nullptr) {
    EXPECT_GE(found.power.outcome.power_w, found.power.outcome.bound_w / 3.0) << "a bound that nothing comes near";
  }
}

INSTANTIATE_TEST_SUITE_P(Methods, WorstSearchOf, testing::Values("remote_virtual_coupling", "local_contact"),
                         [](const auto& each) { return std::string(each.param); });

TEST(GrowthOfAForce, CountsWhatTurnsAroundAndNotWhatFalls) {
  const Eigen::Vector3d up(0.0, 7.0, 0.0);
  EXPECT_NEAR(tools::growth_n(up, {0.0, 9.0, 0.0}), 2.0, 1e-12);
  EXPECT_NEAR(tools::growth_n(up, {0.0, 1.0, 0.0}), 0.0, 1e-12);
  EXPECT_NEAR(tools::growth_n(up, {0.0, -7.0, 0.0}), 7.0, 1e-12);
  EXPECT_NEAR(tools::growth_n(up, {3.0, 4.0, 0.0}), 3.0, 1e-12) << "fallen along its line, and 3 N to the side";
  EXPECT_NEAR(tools::growth_n(Eigen::Vector3d::Zero(), {0.0, 0.0, 2.0}), 2.0, 1e-12);
}

// A bound that holds whatever the ladder does would hold without it too.
TEST(PowerBound, FollowsTheDeviceAndTheWindow) {
  auto session = rtbus::config::load_session(kSession);
  const haptic::HapticConfig config = haptic::read_haptic_config(session, 0);
  // 1.75 N continuous, 7.9 N peak, 12 s, 41 g, 2 m/s: docs/safety.md has the same figures.
  const double v_m_s = 2.0 + 7.9 / 0.041 * (1.0 / (2.0 * 3.14159265358979 * 100.0) + 0.002);
  EXPECT_NEAR(tools::power_bound_w(config, 60.0), 1.75 * std::sqrt(1.2) * v_m_s, 1e-9);
  EXPECT_NEAR(tools::power_bound_w(config, 0.1), 7.9 * v_m_s, 1e-9) << "a short window is ruled by the peak";
}

}  // namespace
