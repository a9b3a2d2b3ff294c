#include "tools/cli/host/core_plan.hpp"

#include <gtest/gtest.h>

namespace {

using Cores = std::vector<int>;
using tools::plan_cores;

TEST(CorePlan, GivesEachLoopACoreOfItsOwnFromTheEnd) {
  EXPECT_EQ(plan_cores({0, 1}, {-1}), (Cores{1}));
  EXPECT_EQ(plan_cores({0, 1}, {-1, -1}), (Cores{1, 0}));
  EXPECT_EQ(plan_cores({0, 1, 2, 3}, {-1, -1}), (Cores{3, 2}));
}

TEST(CorePlan, KeepsWhatTheSessionAsksForAndWorksAroundIt) {
  EXPECT_EQ(plan_cores({0, 1, 2, 3}, {3, -1}), (Cores{3, 2}));
  EXPECT_EQ(plan_cores({0, 1, 2, 3}, {-1, 3, -1}), (Cores{2, 3, 1}));
  EXPECT_EQ(plan_cores({0, 1}, {1, 1}), (Cores{1, 1})) << "two that insist on one core get it";
  EXPECT_EQ(plan_cores({0, 1}, {7}), (Cores{7})) << "the node says what is wrong with it";
}

TEST(CorePlan, SharesEvenlyWhenThereAreMoreLoopsThanCores) {
  EXPECT_EQ(plan_cores({0, 1}, {-1, -1, -1, -1}), (Cores{1, 0, 1, 0}));
  EXPECT_EQ(plan_cores({5}, {-1, -1}), (Cores{5, 5}));
  EXPECT_EQ(plan_cores({0, 1}, {0, 1, -1}), (Cores{0, 1, 1}));
}

TEST(CorePlan, StaysWithinTheCpusOfTheProcess) { EXPECT_EQ(plan_cores({2, 6, 9}, {-1, -1}), (Cores{9, 6})); }

TEST(CorePlan, LeavesItToTheNodesWhenTheKernelDoesNotSay) { EXPECT_EQ(plan_cores({}, {-1, 3}), (Cores{-1, 3})); }

TEST(CorePlan, AsksTheKernel) {
  const Cores cores = tools::cores_of_this_process();
  ASSERT_FALSE(cores.empty());
  for (std::size_t i = 1; i < cores.size(); ++i) EXPECT_LT(cores[i - 1], cores[i]);
}

}  // namespace
