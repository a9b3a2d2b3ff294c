#include "rtbus/histogram.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <random>
#include <thread>
#include <vector>

namespace rtbus {
namespace {

TEST(Histogram, EmptyIsZero) {
  const auto histogram = std::make_unique<Histogram>();
  EXPECT_EQ(histogram->percentile(0.5), 0u);
  EXPECT_EQ(histogram->max(), 0u);
  EXPECT_EQ(histogram->count(), 0u);
  EXPECT_EQ(histogram->mean(), 0.0);
}

TEST(Histogram, PercentilesAgreeWithSortedDataTo16PerMille) {
  std::mt19937_64 random(7);
  const auto histogram = std::make_unique<Histogram>();
  std::vector<std::uint64_t> all;
  double sum = 0;
  for (int i = 0; i < 200'000; ++i) {
    // Spread evenly over the decades from 1 ns to 10 s.
    const double exponent = std::uniform_real_distribution<double>(0.0, 10.0)(random);
    const auto ns = static_cast<std::uint64_t>(std::pow(10.0, exponent));
    histogram->record(ns);
    all.push_back(ns);
    sum += static_cast<double>(ns);
  }
  std::sort(all.begin(), all.end());
  for (const double p : {0.001, 0.01, 0.1, 0.25, 0.5, 0.75, 0.9, 0.99, 0.999, 0.9999, 1.0}) {
    const auto rank = static_cast<std::size_t>(std::ceil(p * static_cast<double>(all.size())));
    const auto exact = static_cast<double>(all[rank - 1]);
    EXPECT_NEAR(static_cast<double>(histogram->percentile(p)), exact, 0.016 * exact) << p;
  }
  EXPECT_EQ(histogram->max(), all.back());
  EXPECT_EQ(histogram->count(), all.size());
  EXPECT_NEAR(histogram->mean(), sum / static_cast<double>(all.size()), 1.0);
}

TEST(Histogram, SmallDurationsAreExact) {
  for (std::uint64_t ns = 0; ns < 128; ++ns) {
    const auto histogram = std::make_unique<Histogram>();
    histogram->record(ns);
    histogram->record(1'000'000);
    EXPECT_EQ(histogram->percentile(0.5), ns);
  }
}

TEST(Histogram, EveryBinBorderStaysWithinTheError) {
  for (int bit = 7; bit < 36; ++bit) {
    for (std::int64_t step = -1; step <= 1; ++step) {
      const std::uint64_t ns = (std::uint64_t{1} << bit) + static_cast<std::uint64_t>(step);
      const auto histogram = std::make_unique<Histogram>();
      histogram->record(ns);
      histogram->record(~std::uint64_t{0});
      EXPECT_NEAR(static_cast<double>(histogram->percentile(0.5)), static_cast<double>(ns),
                  0.016 * static_cast<double>(ns));
    }
  }
}

TEST(Histogram, TheTopPercentileIsTheExactMaximumHoweverLong) {
  const auto histogram = std::make_unique<Histogram>();
  histogram->record(5);
  histogram->record(std::uint64_t{1} << 50);
  EXPECT_EQ(histogram->percentile(1.0), std::uint64_t{1} << 50);
  EXPECT_EQ(histogram->percentile(0.5), 5u);
}

TEST(Histogram, ResetForgets) {
  const auto histogram = std::make_unique<Histogram>();
  histogram->record(1000);
  histogram->reset();
  EXPECT_EQ(histogram->count(), 0u);
  EXPECT_EQ(histogram->percentile(1.0), 0u);
}

TEST(Histogram, MayBeReadWhileItIsWritten) {
  const auto histogram = std::make_unique<Histogram>();
  std::thread writer([&] {
    for (std::uint64_t i = 0; i < 100'000; ++i) histogram->record(100 + i % 100);
  });
  for (int i = 0; i < 200; ++i) {
    const std::uint64_t median = histogram->percentile(0.5);
    EXPECT_TRUE(median == 0 || (median >= 99 && median <= 201)) << median;
  }
  writer.join();
  EXPECT_EQ(histogram->count(), 100'000u);
}

}  // namespace
}  // namespace rtbus
