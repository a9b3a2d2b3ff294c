// Orders of the user in the loop: E-stop and gains.
#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "haptic_node/gains.hpp"
#include "haptic_node/order_box.hpp"

namespace haptic {
namespace {

rtbus::Orders orders(bool estop, std::uint64_t rearms) {
  rtbus::Orders out;
  out.estop = estop ? 1 : 0;
  out.rearms = rearms;
  return out;
}

TEST(OrderBox, HoldsAnEstopUntilItIsRearmed) {
  OrderBox box({300.0, 1.0});
  EXPECT_FALSE(box.estopped(false));
  box.set(orders(true, 0));
  EXPECT_TRUE(box.estopped(false));
  EXPECT_TRUE(box.estopped(false));
  box.set(orders(false, 1));
  EXPECT_FALSE(box.estopped(false));
}

TEST(OrderBox, HoldsAPressOfTheButtonUntilItIsRearmed) {
  OrderBox box({300.0, 1.0});
  EXPECT_TRUE(box.estopped(true));
  EXPECT_TRUE(box.estopped(false)) << "released";
  box.set(orders(false, 0));
  EXPECT_TRUE(box.estopped(false)) << "orders that say nothing new";
  box.set(orders(false, 1));
  EXPECT_TRUE(box.estopped(true)) << "re-armed while the button is down";
  EXPECT_TRUE(box.estopped(false));
  box.set(orders(false, 2));
  EXPECT_FALSE(box.estopped(false));
}

TEST(OrderBox, ReleasesAnEstopOnlyWhenTheCountOfRearmsHasGrown) {
  OrderBox box({300.0, 1.0});
  box.set(orders(true, 3));
  EXPECT_TRUE(box.estopped(false));
  box.set(orders(false, 3));
  EXPECT_TRUE(box.estopped(false)) << "a sample without an E-stop, and without a re-arm";
  box.set(orders(false, 2));
  EXPECT_TRUE(box.estopped(false)) << "a count that has fallen is none of ours";
  box.set(orders(false, 4));
  EXPECT_FALSE(box.estopped(false));
  box.set(orders(true, 5));
  EXPECT_TRUE(box.estopped(false)) << "re-armed and ordered again in between";
}

TEST(OrderBox, EndsAnEstopThatNobodyHasCountedAndHoldsOneWhoseFlagIsDamaged) {
  OrderBox box({300.0, 1.0});
  rtbus::Orders calm = orders(false, 3);
  calm.estops = 7;
  box.set(calm);
  EXPECT_FALSE(box.estopped(false));
  rtbus::Orders damaged = calm;
  damaged.estop = 1;
  box.set(damaged);
  EXPECT_TRUE(box.estopped(false)) << "it is heeded all the same";
  box.set(calm);
  EXPECT_FALSE(box.estopped(false));
  damaged.rearms = 1ull << 40;
  box.set(damaged);
  box.set(calm);
  EXPECT_FALSE(box.estopped(false));

  rtbus::Orders ordered = orders(true, 3);
  ordered.estops = 8;
  box.set(ordered);
  EXPECT_TRUE(box.estopped(false));
  damaged = ordered;
  damaged.estop = 0;
  box.set(damaged);
  EXPECT_TRUE(box.estopped(false));
  rtbus::Orders rearmed = orders(false, 4);
  rearmed.estops = 8;
  box.set(rearmed);
  EXPECT_FALSE(box.estopped(false));
}

TEST(OrderBox, HoldsAPressFromBeforeTheFirstOrdersOfASessionThatWasRearmedBefore) {
  OrderBox box({300.0, 1.0});
  EXPECT_TRUE(box.estopped(true));
  box.set(orders(false, 1));
  EXPECT_TRUE(box.estopped(false)) << "that re-arm was of another press";
  box.set(orders(false, 2));
  EXPECT_FALSE(box.estopped(false));
}

TEST(OrderBox, WantsTheConfiguredGainsUntilOthersAreOrdered) {
  OrderBox box({300.0, 1.0});
  EXPECT_EQ(box.wanted(), (Gains{300.0, 1.0}));
  rtbus::Orders ordered;
  box.set(ordered);
  EXPECT_EQ(box.wanted(), (Gains{300.0, 1.0}));
  ordered.stiffness_n_per_m = 500.0;
  box.set(ordered);
  EXPECT_EQ(box.wanted(), (Gains{500.0, 1.0}));
  ordered.damping_n_s_per_m = 0.0;
  box.set(ordered);
  EXPECT_EQ(box.wanted(), (Gains{500.0, 0.0}));
}

TEST(OrderBox, HoldsTheClutchUntilItsTime) {
  OrderBox box({300.0, 1.0});
  EXPECT_FALSE(box.clutched(0));
  rtbus::Orders ordered;
  ordered.clutched_until_ns = 500;
  box.set(ordered);
  EXPECT_TRUE(box.clutched(499));
  EXPECT_FALSE(box.clutched(500));
}

TEST(OrderBox, AddsAForceUntilItsTimeAndNoMoreThanAllowed) {
  OrderBox box({300.0, 1.0}, 2.0);
  EXPECT_EQ(box.extra_force_n(1), Eigen::Vector3d::Zero());
  rtbus::Orders ordered;
  ordered.extra_force_n = {0.5, 0.0, -1.0};
  ordered.extra_force_until_ns = 500;
  box.set(ordered);
  EXPECT_EQ(box.extra_force_n(499), Eigen::Vector3d(0.5, 0.0, -1.0));
  EXPECT_EQ(box.extra_force_n(500), Eigen::Vector3d::Zero());
  ordered.extra_force_n = {0.0, 30.0, 40.0};
  ordered.extra_force_until_ns = 900;
  box.set(ordered);
  EXPECT_NEAR((box.extra_force_n(600) - Eigen::Vector3d(0.0, 1.2, 1.6)).norm(), 0.0, 1e-12);

  OrderBox allows_none({300.0, 1.0});
  allows_none.set(ordered);
  EXPECT_EQ(allows_none.extra_force_n(600), Eigen::Vector3d::Zero());
}

constexpr GainLimits kFastLink{1000.0, 4.0, 0.1, std::numeric_limits<double>::infinity()};

TEST(Gains, NeverExceedWhatTheDeviceBears) {
  EXPECT_EQ(kFastLink.bearable({500.0, 1.0}), (Gains{500.0, 1.0}));
  EXPECT_EQ(kFastLink.bearable({1e9, 1e9}), (Gains{1000.0, 4.0}));
}

TEST(Gains, KeepAFifthOfCriticalDampingOnASlowLink) {
  const GainLimits slow{1000.0, 40.0, 0.1, 12.0};  // below 1.5 times the tip's own 11 Hz
  const Gains out = slow.bearable({500.0, 0.0});
  EXPECT_NEAR(out.damping_n_s_per_m, 0.4 * std::sqrt(500.0 * 0.1), 1e-12);
  EXPECT_EQ(slow.bearable({500.0, 20.0}).damping_n_s_per_m, 20.0) << "more is not taken away";
}

TEST(GainRamp, NeedsASecondFromNothingToTheLimit) {
  GainRamp ramp({0.0, 0.0}, kFastLink);
  int cycles = 0;
  double last_n_per_m = 0.0;
  while (ramp.follow({1000.0, 4.0}, 1e-3)) {
    EXPECT_LE(ramp.now().stiffness_n_per_m - last_n_per_m, 1.0 + 1e-9) << "N/m in one cycle of a thousand";
    last_n_per_m = ramp.now().stiffness_n_per_m;
    ASSERT_LT(++cycles, 2000);
  }
  EXPECT_NEAR(cycles, 1000, 2);
  EXPECT_EQ(ramp.now(), (Gains{1000.0, 4.0}));
}

TEST(GainRamp, StaysWhereNothingIsOrdered) {
  GainRamp ramp({300.0, 1.0}, kFastLink);
  EXPECT_FALSE(ramp.follow({300.0, 1.0}, 1e-3));
}

}  // namespace
}  // namespace haptic
