#include "tools/impulse_balance.hpp"

#include <gtest/gtest.h>

namespace {

using Eigen::Vector3d;
using tools::ImpulseBalance;

constexpr std::uint64_t kStart_ns = 7 * rtbus::kNsPerS;

/// Three seconds of 1 N felt at 1 kHz, and `given_n` at 100 Hz in the second of them.
ImpulseBalance balance_of(double given_n) {
  ImpulseBalance balance;
  for (std::uint64_t i = 0; i < 3000; ++i) balance.add_felt(kStart_ns + i * 1'000'000, Vector3d(0, 0, 1), 1e-3);
  for (std::uint64_t i = 0; i < 300; ++i) {
    const bool second = i >= 100 && i < 200;
    balance.add_given(kStart_ns + i * 10'000'000, Vector3d(0, 0, second ? given_n : 0.001), 0.01);
  }
  return balance;
}

TEST(ImpulseBalance, ComparesTheSecondsWithAPush) {
  const auto figures = balance_of(0.8).figures();
  EXPECT_EQ(figures.windows, 1u);
  EXPECT_NEAR(figures.felt_n_s, 1.0, 1e-9);
  EXPECT_NEAR(figures.given_n_s, 0.8, 1e-9);
  EXPECT_NEAR(figures.worst, 0.25, 1e-9);
}

TEST(ImpulseBalance, NoticesThatTheDirectionIsWrong) { EXPECT_NEAR(balance_of(-1.0).figures().worst, 2.0, 1e-9); }

TEST(ImpulseBalance, SaysNothingWithoutAPushOrBeforeTheFirstTick) {
  EXPECT_EQ(balance_of(0.01).figures().windows, 0u);
  ImpulseBalance balance;
  balance.add_given(kStart_ns, Vector3d(1, 0, 0), 1.0);
  EXPECT_EQ(balance.figures().windows, 0u);
}

}  // namespace
