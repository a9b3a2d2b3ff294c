#include "tools/cli/run/trace.hpp"

#include <gtest/gtest.h>

#include <algorithm>

namespace tools {
namespace {

struct Row {
  std::uint64_t first = 0;
  std::uint64_t worst = 0;
  void absorb(const Row& later) { worst = std::max(worst, later.worst); }
};

TEST(Trace, KeepsEverythingUntilItIsFull) {
  Trace<Row> trace;
  for (std::uint64_t i = 0; i < Trace<Row>::kCapacity; ++i) trace.add({i, i});
  EXPECT_EQ(trace.stride(), 1u);
  ASSERT_EQ(trace.rows().size(), Trace<Row>::kCapacity);
  EXPECT_EQ(trace.rows().back().first, Trace<Row>::kCapacity - 1);
}

TEST(Trace, ThinsEvenlyAndLosesNoExtreme) {
  constexpr std::uint64_t kSamples = 7 * Trace<Row>::kCapacity + 5;
  constexpr std::uint64_t kWorstAt = 100'001;
  Trace<Row> trace;
  for (std::uint64_t i = 0; i < kSamples; ++i) trace.add({i, i == kWorstAt ? 1u : 0u});
  EXPECT_EQ(trace.stride(), 8u);
  EXPECT_LE(trace.rows().size(), Trace<Row>::kCapacity);
  std::uint64_t worst_rows = 0;
  for (std::size_t i = 0; i < trace.rows().size(); ++i) {
    ASSERT_EQ(trace.rows()[i].first, i * trace.stride());
    if (trace.rows()[i].worst == 1) {
      ++worst_rows;
      EXPECT_EQ(i, kWorstAt / trace.stride());
    }
  }
  EXPECT_EQ(worst_rows, 1u);
}

}  // namespace
}  // namespace tools
