#include "haptic_node/velocity.hpp"

#include <gtest/gtest.h>

#include <cmath>

namespace {

using haptic::VelocityEstimator;
constexpr std::uint64_t kTick_ns = 1'000'000;

TEST(VelocityEstimator, ConvergesToAConstantVelocity) {
  VelocityEstimator estimator(100.0);
  for (std::uint64_t k = 0; k < 100; ++k) {
    estimator.update({0.3 * 1e-3 * static_cast<double>(k), 0.0, -0.1 * 1e-3 * static_cast<double>(k)}, k * kTick_ns);
  }
  EXPECT_NEAR(estimator.velocity_m_s().x(), 0.3, 1e-9);
  EXPECT_NEAR(estimator.velocity_m_s().z(), -0.1, 1e-9);
}

TEST(VelocityEstimator, TakesRealTimeBetweenSamples) {
  VelocityEstimator estimator(100.0);
  std::uint64_t time_ns = 0;
  for (int k = 0; k < 200; ++k) {
    time_ns += k % 3 == 0 ? 2 * kTick_ns : kTick_ns;  // a late sample now and then
    estimator.update({0.5 * static_cast<double>(time_ns) * 1e-9, 0.0, 0.0}, time_ns);
  }
  EXPECT_NEAR(estimator.velocity_m_s().x(), 0.5, 1e-9);
}

TEST(VelocityEstimator, StartsAtZeroWhereverTheTipIs) {
  VelocityEstimator estimator(100.0);
  EXPECT_EQ(estimator.update({0.1, 0.2, 0.3}, 5 * kTick_ns).norm(), 0.0);
  estimator.update({0.2, 0.2, 0.3}, 6 * kTick_ns);
  estimator.reset();
  EXPECT_EQ(estimator.update({-1.0, 0.0, 0.0}, 7 * kTick_ns).norm(), 0.0);
}

TEST(VelocityEstimator, IgnoresARepeatedSample) {
  VelocityEstimator estimator(100.0);
  estimator.update({0.0, 0.0, 0.0}, kTick_ns);
  const Eigen::Vector3d before = estimator.update({0.001, 0.0, 0.0}, 2 * kTick_ns);
  EXPECT_EQ(estimator.update({0.001, 0.0, 0.0}, 2 * kTick_ns), before);
}

TEST(VelocityEstimator, AttenuatesEncoderNoise) {
  // One step of 23 um and back, every other tick: +-23 mm/s before the low-pass.
  VelocityEstimator estimator(100.0);
  double worst = 0.0;
  for (std::uint64_t k = 0; k < 500; ++k) {
    estimator.update({k % 2 == 0 ? 0.0 : 23e-6, 0.0, 0.0}, k * kTick_ns);
    if (k > 50) worst = std::max(worst, std::abs(estimator.velocity_m_s().x()));
  }
  EXPECT_LT(worst, 0.010);
}

}  // namespace
