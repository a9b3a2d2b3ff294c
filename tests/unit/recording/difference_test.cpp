/// The figures of `rtbus compare`, against signals whose difference is known.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "tools/cli/recording/difference.hpp"

namespace {

using tools::Difference;
using tools::Track;

template <class F>
Track track(double from_s, double to_s, double rate_hz, F value) {
  Track out;
  for (int k = 0; from_s + k / rate_hz <= to_s; ++k) {
    const double t_s = from_s + k / rate_hz;
    out.time_s.push_back(t_s);
    out.value.push_back(value(t_s));
  }
  return out;
}

TEST(DifferenceOfRecordings, IsZeroOfTheSame) {
  const Track a = track(0.0, 1.0, 1000.0, [](double t) { return std::sin(20.0 * t); });
  const Difference d = tools::compare(a, a);
  EXPECT_EQ(d.samples, a.time_s.size());
  EXPECT_EQ(d.rms, 0.0);
  EXPECT_EQ(d.peak, 0.0);
  EXPECT_EQ(d.jump_per_ms, 0.0);
  EXPECT_NEAR(d.reference_rms, std::sqrt(0.5), 0.02);
}

TEST(DifferenceOfRecordings, GivesRmsPeakAndTimeOfAKnownOne) {
  const Track a = track(0.0, 2.0, 1000.0, [](double) { return 1.0; });
  // Other rate, and a difference of 0.5·sin(2π·t): RMS 0.5/√2 over whole periods, peak 0.5 at a quarter.
  const Track b = track(0.0, 2.0, 777.0, [](double t) { return 1.0 + 0.5 * std::sin(2.0 * std::numbers::pi * t); });
  const Difference d = tools::compare(a, b);
  EXPECT_NEAR(d.rms, 0.5 / std::sqrt(2.0), 1e-3);
  EXPECT_NEAR(d.peak, 0.5, 1e-4);
  EXPECT_NEAR(std::fmod(d.peak_s, 0.5), 0.25, 2e-3);
  EXPECT_NEAR(d.jump_per_ms, std::numbers::pi * 1e-3, 1e-4) << "0.5·2π per second";
}

TEST(DifferenceOfRecordings, SeesAClick) {
  const Track a = track(0.0, 1.0, 1000.0, [](double) { return 0.0; });
  const Track b = track(0.0, 1.0, 1000.0, [](double t) { return t < 0.7 ? 0.0 : 0.4; });
  const Difference d = tools::compare(a, b);
  EXPECT_NEAR(d.jump_per_ms, 0.4, 1e-9);
  EXPECT_NEAR(d.jump_s, 0.7, 1.1e-3);
}

TEST(DifferenceOfRecordings, SeesAtTenKilohertzWhatChangesWithinAMillisecond) {
  const Track a = track(0.0, 1.0, 10000.0, [](double) { return 0.0; });
  const Track b = track(0.0, 1.0, 10000.0, [](double t) { return std::clamp((t - 0.5) * 300.0, 0.0, 0.6); });
  EXPECT_NEAR(tools::compare(a, b).jump_per_ms, 0.45, 0.16) << "0.3 per ms, the window is up to 1.5 ms";
}

TEST(DifferenceOfRecordings, OfAVectorIsItsLength) {
  Track a, b;
  a.elements = b.elements = 3;
  a.time_s = b.time_s = {0.0, 0.001};
  a.value = {0, 0, 0, 0, 0, 0};
  b.value = {3, 4, 0, 3, 4, 0};
  const Difference d = tools::compare(a, b);
  EXPECT_NEAR(d.rms, 5.0, 1e-12);
  EXPECT_NEAR(d.peak, 5.0, 1e-12);
}

TEST(DifferenceOfRecordings, ComparesOnlyWhereBothHaveSamples) {
  const Track a = track(0.0, 1.0, 1000.0, [](double) { return 0.0; });
  Track b = track(0.5, 3.0, 1000.0, [](double) { return 1.0; });
  const Difference d = tools::compare(a, b);
  EXPECT_NEAR(d.from_s, 0.5, 2e-3);
  EXPECT_NEAR(d.to_s, 1.0, 2e-3);
  const Track far = track(5.0, 6.0, 1000.0, [](double) { return 1.0; });
  EXPECT_EQ(tools::compare(a, far).samples, 0u);
}

TEST(DifferenceOfRecordings, LeavesOutAGapOfB) {
  const Track a = track(0.0, 1.0, 1000.0, [](double) { return 0.0; });
  Track b;
  for (const double t_s : {0.0, 0.001, 0.9, 0.901}) b.time_s.push_back(t_s), b.value.push_back(t_s < 0.5 ? 0.0 : 9.0);
  const Difference d = tools::compare(a, b);
  EXPECT_LE(d.samples, 6u);
  EXPECT_GE(d.samples, 2u);
}

}  // namespace
