#include "tools/evaluation/shared/force_profile.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <random>
#include <vector>

namespace tools {
namespace {

constexpr double kRate_hz = 1000.0;

std::vector<double> sine(double hz, double amplitude_n, std::size_t samples, double mean_n = 0.0) {
  std::vector<double> out(samples);
  for (std::size_t i = 0; i < samples; ++i) {
    out[i] = mean_n + amplitude_n * std::sin(2.0 * std::numbers::pi * hz * static_cast<double>(i) / kRate_hz);
  }
  return out;
}

TEST(Roughness, OfASineIsItsSlopeAndItsPower) {
  const auto force_n = sine(100.0, 0.2, 20000, 1.5);
  const Roughness found = roughness(force_n, kRate_hz);
  EXPECT_NEAR(found.mean_n, 1.5, 1e-12);
  EXPECT_NEAR(found.rms_n, std::sqrt(1.5 * 1.5 + 0.02), 1e-9);
  // x(t + T) − x(t) of a sine has the amplitude 2·sin(πfT).
  EXPECT_NEAR(found.increment_rms_n, 0.2 * std::sqrt(2.0) * std::sin(0.1 * std::numbers::pi), 1e-5);
  EXPECT_NEAR(found.power_above_30hz_n2, 0.02, 1e-5);
}

TEST(Roughness, OfWhatAHandDoesHasNoVibration) {
  // Begun at rest, at its turning point; begun in full swing it leaves a millionth.
  auto force_n = sine(3.0, 1.0, 20000 + 83);
  force_n.erase(force_n.begin(), force_n.begin() + 83);
  EXPECT_LT(roughness(force_n, kRate_hz).power_above_30hz_n2, 1e-8);
  EXPECT_LT(roughness(sine(3.0, 1.0, 20000), kRate_hz).power_above_30hz_n2, 2e-6);
}

TEST(Roughness, FindsTheVibrationUnderASlowForce) {
  auto force_n = sine(5.0, 1.0, 20000 + 50);
  force_n.erase(force_n.begin(), force_n.begin() + 50);  // from a turning point
  const auto buzz_n = sine(80.0, 0.01, 20000);
  for (std::size_t i = 0; i < force_n.size(); ++i) force_n[i] += buzz_n[i];
  EXPECT_NEAR(roughness(force_n, kRate_hz).power_above_30hz_n2, 0.00005, 1e-6);
}

TEST(Roughness, OfWhiteNoiseIsSpreadEvenly) {
  std::mt19937 random(7);
  std::normal_distribution<double> noise(0.0, 0.1);
  std::vector<double> force_n(20000);
  for (double& value : force_n) value = noise(random);
  const Roughness found = roughness(force_n, kRate_hz);
  const double variance = found.rms_n * found.rms_n - found.mean_n * found.mean_n;
  EXPECT_NEAR(found.power_above_30hz_n2 / variance, 1.0 - 30.0 / 500.0, 0.01);
  EXPECT_NEAR(found.increment_rms_n, std::sqrt(2.0 * variance), 0.01 * 0.1);
}

TEST(Roughness, HasAllOfThePowerWhenNothingIsSlow) {
  // 20 samples last 20 ms: the slowest component is one of 25 Hz, and alternating samples have none of it.
  std::vector<double> force_n(20);
  for (std::size_t i = 0; i < force_n.size(); ++i) force_n[i] = i % 2 == 0 ? 0.3 : -0.3;
  EXPECT_NEAR(roughness(force_n, kRate_hz).power_above_30hz_n2, 0.09, 1e-3);
}

TEST(Roughness, DoesNotTakeTheEndsOfARampForAJump) {
  std::vector<double> force_n(20000);
  for (std::size_t i = 0; i < force_n.size(); ++i) force_n[i] = 2.0 * static_cast<double>(i) / 20000.0;
  const Roughness found = roughness(force_n, kRate_hz);
  EXPECT_NEAR(found.increment_rms_n, 1e-4, 1e-9);
  EXPECT_LT(found.power_above_30hz_n2, 1e-9);
}

TEST(Roughness, OfAStepFallsOffWithItsLength) {
  std::vector<double> force_n(2000, 0.0);
  std::fill(force_n.begin() + 1000, force_n.end(), 1.0);
  const Roughness found = roughness(force_n, kRate_hz);
  EXPECT_NEAR(found.increment_rms_n, 1.0 / std::sqrt(1999.0), 1e-12);
  // Its components are the odd ones m; that of 30 Hz is m = 120. The cosines over the upper half sum up to 1/(2·sin).
  double expected = 0.0;
  for (int m = 121; m < 2000; m += 2) expected += 0.5 / std::pow(2000.0 * std::sin(std::numbers::pi * m / 4000.0), 2);
  EXPECT_NEAR(found.power_above_30hz_n2, expected, 1e-6 * expected);
}

TEST(Roughness, TakesChangesOverAMillisecondAtAnyRate) {
  std::vector<double> force_n(16000);
  for (std::size_t i = 0; i < force_n.size(); ++i) force_n[i] = static_cast<double>(i) / 4000.0;  // 1 N/s
  EXPECT_NEAR(roughness(force_n, 4000.0).increment_rms_n, 1e-3, 1e-9);
}

TEST(Roughness, OfTooLittleIsZero) {
  EXPECT_EQ(roughness({}, kRate_hz).rms_n, 0.0);
  const std::vector<double> one{2.0};
  const Roughness found = roughness(one, kRate_hz);
  EXPECT_EQ(found.mean_n, 2.0);
  EXPECT_EQ(found.increment_rms_n, 0.0);
  EXPECT_EQ(found.power_above_30hz_n2, 0.0);
}

}  // namespace
}  // namespace tools
