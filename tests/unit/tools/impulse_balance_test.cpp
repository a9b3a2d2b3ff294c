#include "tools/cli/run/impulse_balance.hpp"
#include "rtbus/clock.hpp"

#include <gtest/gtest.h>

namespace {

using Eigen::Vector3d;
using tools::ImpulseBalance;

constexpr std::uint64_t kStart_ns = 7 * rtbus::kNsPerS;

/// Three seconds of 1 N felt at 1 kHz, and `given_n` at 100 Hz in the second of them.
ImpulseBalance balance_of(double given_n) {
  ImpulseBalance balance;
  for (std::uint64_t ms = 0; ms <= 3000; ++ms) {
    balance.add_hand_force(kStart_ns + ms * rtbus::kNsPerMs, Vector3d(0, 0, 1));
    if (ms == 0 || ms % 10 != 0) continue;
    const bool second = ms > 1000 && ms <= 2000;
    balance.add_world_impulse(kStart_ns + (ms - 10) * rtbus::kNsPerMs, kStart_ns + ms * rtbus::kNsPerMs,
                              Vector3d(0, 0, 0.01 * (second ? given_n : 0.001)));
  }
  return balance;
}

TEST(ImpulseBalance, ComparesTheSecondsWithAPush) {
  const auto figures = balance_of(0.8).figures();
  EXPECT_EQ(figures.windows, 1u);
  EXPECT_NEAR(figures.hand_n_s, 1.0, 1e-9);
  EXPECT_NEAR(figures.world_n_s, 0.8, 1e-9);
  EXPECT_NEAR(figures.worst, 0.25, 1e-9);
}

TEST(ImpulseBalance, NoticesThatTheDirectionIsWrong) { EXPECT_NEAR(balance_of(-1.0).figures().worst, 2.0, 1e-9); }

TEST(ImpulseBalance, SaysNothingWithoutAPushOrBeforeTheFirstTick) {
  EXPECT_EQ(balance_of(0.01).figures().windows, 0u);
  ImpulseBalance balance;
  balance.add_world_impulse(kStart_ns, kStart_ns + rtbus::kNsPerS, Vector3d(1, 0, 0));
  EXPECT_EQ(balance.figures().windows, 0u);
}

// Steps of 55 ms do not end with the second, the force falls to nothing within one, and a late cycle holds it for
// longer.
TEST(ImpulseBalance, LosesNothingAtTheEndOfASecond) {
  ImpulseBalance balance;
  Vector3d sum = Vector3d::Zero(), before = Vector3d::Zero();
  for (std::uint64_t ms = 0; ms < 4000; ++ms) {
    if (ms % 55 == 0) {
      if (ms > 0)
        balance.add_world_impulse(kStart_ns + (ms - 55) * rtbus::kNsPerMs, kStart_ns + ms * rtbus::kNsPerMs,
                                  sum - before);
      before = sum;
    }
    const double force_n = ms % 1000 < 970 ? 0.5 + 1e-3 * static_cast<double>(ms % 1000) : 0.0;
    if (ms % 100 != 7) balance.add_hand_force(kStart_ns + ms * rtbus::kNsPerMs, Vector3d(0, 0, force_n));
    const double held_n = ms % 100 == 7 ? 0.5 + 1e-3 * static_cast<double>(ms % 1000 - 1) : force_n;
    sum.z() += 1e-3 * held_n;
  }
  EXPECT_EQ(balance.figures().windows, 3u);
  EXPECT_LT(balance.figures().worst, 1e-9);
}

TEST(ImpulseBalance, CountsAForceNoLongerThanADeviceHoldsIt) {
  ImpulseBalance balance;
  balance.add_hand_force(kStart_ns, Vector3d(0, 0, 50));
  balance.add_world_impulse(kStart_ns, kStart_ns + 1000 * rtbus::kNsPerMs, Vector3d(0, 0, 1));
  EXPECT_NEAR(balance.figures().worst, 0.0, 1e-9) << "50 N for 20 ms";
}

}  // namespace
