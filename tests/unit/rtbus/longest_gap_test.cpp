#include "rtbus/longest_gap.hpp"

#include <gtest/gtest.h>

namespace {

using rtbus::kNsPerMs;
using rtbus::kNsPerS;

TEST(LongestGap, AHandWithoutLossesGoesOnForTwoTicks) {
  rtbus::LongestGap gap;
  for (int i = 0; i < 100; ++i) gap.add(kNsPerMs);
  EXPECT_EQ(gap.goes_on_ns(kNsPerMs), 2 * kNsPerMs);
}

TEST(LongestGap, RemembersALongGapForAbout10s) {
  rtbus::LongestGap gap;
  gap.add(3 * kNsPerMs);
  gap.add(kNsPerMs);
  EXPECT_NEAR(static_cast<double>(gap.goes_on_ns(kNsPerMs)), 4e6, 1e3);
  for (int i = 0; i < 30'000; ++i) gap.add(kNsPerMs);
  EXPECT_EQ(gap.goes_on_ns(kNsPerMs), 2 * kNsPerMs);
}

TEST(LongestGap, TakesNoLongerOneIntoAccountThan5ms) {
  rtbus::LongestGap gap;
  gap.add(50 * kNsPerMs);
  EXPECT_EQ(gap.goes_on_ns(kNsPerMs), 6 * kNsPerMs);
  EXPECT_EQ(gap.goes_on_ns(kNsPerS), 10 * kNsPerMs);
}

}  // namespace
