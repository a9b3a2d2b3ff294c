#include "haptic_node/velocity.hpp"

#include <gtest/gtest.h>

#include <cmath>

namespace velocity_test {

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

/// Largest error over the second half of 400 ms of `position(t)`, as the encoder rounds it.
template <class Position, class Velocity>
double worst_error(const haptic::VelocityConfig& config, Position position, Velocity velocity) {
  VelocityEstimator estimator(config);
  double worst = 0.0;
  for (std::uint64_t k = 0; k < 400; ++k) {
    const double t = static_cast<double>(k) * 1e-3;
    const double shown = std::round(position(t) / 23e-6) * 23e-6;
    estimator.update({shown, 0.0, 0.0}, k * kTick_ns);
    if (k > 200) worst = std::max(worst, std::abs(estimator.velocity_m_s().x() - velocity(t)));
  }
  return worst;
}
constexpr haptic::VelocityConfig kLowPass{false, 100.0, 23e-6};
constexpr haptic::VelocityConfig kAdaptive{true, 100.0, 23e-6};

TEST(AdaptiveWindow, IsQuieterAtRestThanTheLowPass) {
  // A tip that trembles over the edge of an encoder step.
  const auto position = [](double t) { return 11.5e-6 + 2e-6 * std::sin(2.0 * M_PI * 37.0 * t); };
  const auto still = [](double) { return 0.0; };
  const double low_pass = worst_error(kLowPass, position, still);
  const double adaptive = worst_error(kAdaptive, position, still);
  RecordProperty("low_pass_mm_s", std::to_string(low_pass * 1e3));
  RecordProperty("adaptive_mm_s", std::to_string(adaptive * 1e3));
  EXPECT_GT(low_pass, 0.008);
  EXPECT_LE(adaptive, 23e-6 / 1e-3 + 1e-12) << "never more than the raw difference";
}

TEST(AdaptiveWindow, LagsLessWhenTheHandIsFast) {
  const auto position = [](double t) { return 0.02 * std::sin(2.0 * M_PI * 5.0 * t); };  // 0.63 m/s, 20 m/s2
  const auto velocity = [](double t) { return 0.02 * 2.0 * M_PI * 5.0 * std::cos(2.0 * M_PI * 5.0 * t); };
  const double low_pass = worst_error(kLowPass, position, velocity);
  const double adaptive = worst_error(kAdaptive, position, velocity);
  RecordProperty("low_pass_mm_s", std::to_string(low_pass * 1e3));
  RecordProperty("adaptive_mm_s", std::to_string(adaptive * 1e3));
  EXPECT_GT(low_pass, 0.025);
  EXPECT_LT(adaptive, low_pass * 1.5);
}

TEST(AdaptiveWindow, IsExactAtConstantSpeedWithAnExactEncoder) {
  VelocityEstimator estimator(haptic::VelocityConfig{true, 100.0, 0.0});
  for (std::uint64_t k = 0; k < 100; ++k) estimator.update({0.3e-3 * static_cast<double>(k), 0.0, 0.0}, k * kTick_ns);
  EXPECT_NEAR(estimator.velocity_m_s().x(), 0.3, 1e-9);
  EXPECT_EQ(estimator.velocity_m_s().y(), 0.0);
}

}  // namespace velocity_test
