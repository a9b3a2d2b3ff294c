#include "tools/cli/top/top_marks.hpp"

#include <gtest/gtest.h>

#include <cmath>

namespace {

using tools::sparkline;

TEST(LimitBar, IsAsLongInBothCharacterSets) {
  for (const double value : {-1.0, 0.0, 3.3, 8.0, 20.0, std::nan("")}) {
    EXPECT_EQ(tools::cells_of(tools::limit_bar(value, 4.0, 8.0, 17, true)), 19u);
    EXPECT_EQ(tools::limit_bar(value, 4.0, 8.0, 17, false).size(), 19u);
  }
}

TEST(LimitBar, MarksThePeak) {
  EXPECT_EQ(tools::limit_bar(2.0, 6.0, 8.0, 8, false), "[##...|..]");
  EXPECT_EQ(tools::limit_bar(2.0, 6.0, 8.0, 8, true), "[██···│··]");
}

TEST(ShareBar, ShowsATraceOfTheSmallestShareAndNothingOfNone) {
  EXPECT_EQ(tools::share_bar(0.0, 4, true), "    ");
  EXPECT_EQ(tools::share_bar(1e-9, 4, true), "▏   ");
  EXPECT_EQ(tools::share_bar(1e-9, 4, false), "-   ");
  EXPECT_EQ(tools::share_bar(0.5, 4, true), "██  ");
  EXPECT_EQ(tools::share_bar(0.5625, 2, true), "█▏");
  EXPECT_EQ(tools::share_bar(2.0, 4, false), "####");
}

TEST(ShareMark, NeverHidesSomething) {
  EXPECT_EQ(tools::share_mark(0.0, true), " ");
  EXPECT_EQ(tools::share_mark(1e-6, true), "▁");
  EXPECT_EQ(tools::share_mark(1.0, true), "█");
  EXPECT_EQ(tools::share_mark(1.0, false), "#");
}

TEST(Sparkline, StandsAtTheRightAndShowsGaps) {
  const double values[] = {0.0, std::nan(""), 1.0};
  EXPECT_EQ(sparkline(values, 0.0, 1.0, 5, 1, true).front(), "  ▁ █");
  EXPECT_EQ(sparkline(values, 0.0, 1.0, 2, 1, true).front(), " █");
}

TEST(Sparkline, GrowsThroughItsRows) {
  const double values[] = {0.0, 0.5, 1.0};
  EXPECT_EQ(sparkline(values, 0.0, 1.0, 3, 2, true), (std::vector<std::string>{"  █", "▁██"}));
}

TEST(Sparkline, StaysWithinItsBorders) {
  const double values[] = {-5.0, 5.0, INFINITY, -INFINITY};
  EXPECT_EQ(sparkline(values, 0.0, 1.0, 4, 1, true).front(), "▁██▁");
  EXPECT_EQ(sparkline(values, 1.0, 1.0, 4, 1, true).front(), "▁▁▁▁");  // no range: a line
}

TEST(FirstCells, CountsCharactersNotBytes) {
  EXPECT_EQ(tools::first_cells("█▁x", 2), "█▁");
  EXPECT_EQ(tools::first_cells("█▁x", 9), "█▁x");
  EXPECT_EQ(tools::cells_of("█▁x"), 3u);
}

}  // namespace
