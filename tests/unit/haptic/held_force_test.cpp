#include "haptic_node/held_force.hpp"
#include "rtbus/clock.hpp"

#include <gtest/gtest.h>

#include <cmath>

namespace {

using Eigen::Vector3d;
using haptic::HeldForce;
TEST(HeldForce, HoldsEachForceFromItsWriteToTheNext) {
  HeldForce held(0.02);
  held.write(10 * rtbus::kNsPerMs, {1.0, 0.0, 0.0});
  held.write(11 * rtbus::kNsPerMs, {3.0, 0.0, 0.0});
  EXPECT_NEAR(held.impulse_n_s(10 * rtbus::kNsPerMs, 12 * rtbus::kNsPerMs).x(), 4e-3, 1e-12);
  EXPECT_NEAR(
      held.impulse_n_s(10 * rtbus::kNsPerMs + rtbus::kNsPerMs / 2, 11 * rtbus::kNsPerMs + rtbus::kNsPerMs / 2).x(),
      2e-3, 1e-12);
  EXPECT_EQ(held.impulse_n_s(5 * rtbus::kNsPerMs, 10 * rtbus::kNsPerMs).norm(), 0.0)
      << "nothing acted before the first write";
}

TEST(HeldForce, KnowsThatTheDeviceLetsGo) {
  HeldForce held(0.02);
  held.write(10 * rtbus::kNsPerMs, {1.0, 0.0, 0.0});
  EXPECT_NEAR(held.impulse_n_s(10 * rtbus::kNsPerMs, 500 * rtbus::kNsPerMs).x(), 0.02, 1e-12);
}

TEST(HeldForce, ForgetsAForceThatDidNotLeave) {
  HeldForce held(0.02);
  held.write(10 * rtbus::kNsPerMs, {1.0, 0.0, 0.0});
  held.write(11 * rtbus::kNsPerMs, {9.0, 0.0, 0.0});
  held.revoke();
  EXPECT_NEAR(held.impulse_n_s(10 * rtbus::kNsPerMs, 13 * rtbus::kNsPerMs).x(), 1e-3, 1e-12);
}

// A spring on a 20 Hz motion, sampled and written with delays and less often than the loop runs: the counted energy is
// that of the forces that acted, not of those that were meant.
TEST(HeldForce, CountsWhatActedWhateverTheDelayOfTheSamples) {
  for (const int stride : {1, 2, 4}) {
    for (const std::uint64_t age_ns : {std::uint64_t{0}, std::uint64_t{200'000}, std::uint64_t{900'000}}) {
      constexpr std::uint64_t kCycle_ns = 250'000;
      const auto position = [](std::uint64_t t) {
        return 0.005 * std::sin(2.0 * M_PI * 20.0 * 1e-9 * static_cast<double>(t));
      };
      HeldForce held(0.02);
      double booked_j = 0.0, true_j = 0.0, force_n = 0.0;
      std::uint64_t sample_ns = 0;
      for (int k = 1; k <= 4000; ++k) {
        const std::uint64_t now_ns = 100 * rtbus::kNsPerMs + static_cast<std::uint64_t>(k) * kCycle_ns;
        true_j -= force_n * (position(now_ns) - position(now_ns - kCycle_ns));
        if (k % stride == 0) {
          const std::uint64_t next_ns = now_ns - age_ns;
          if (sample_ns != 0) {
            booked_j -= held.impulse_n_s(sample_ns, next_ns).x() * (position(next_ns) - position(sample_ns)) /
                        (static_cast<double>(next_ns - sample_ns) * 1e-9);
          }
          sample_ns = next_ns;
        }
        force_n = -1000.0 * position(sample_ns);
        held.write(now_ns, {force_n, 0.0, 0.0});
      }
      EXPECT_NEAR(booked_j, true_j, 0.08 * std::abs(true_j) + 1e-3)
          << "stride " << stride << ", age " << age_ns << " ns";
    }
  }
}

}  // namespace
