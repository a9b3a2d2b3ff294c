#include "haptic_node/rendering/echo.hpp"

#include <algorithm>
#include <cmath>
#include <complex>
#include <numbers>

#include <gtest/gtest.h>

#include "haptic_node/gains.hpp"
#include "haptic_node/rendering/remote_virtual_coupling.hpp"

namespace {

using haptic::Echo;
using Complex = std::complex<double>;

constexpr double kTip_kg = 0.041, kProxyRatio = 0.7, kMostDamping = 5.15;

/// What a mass makes of a set-point, on a spring with a damper relative to it.
Complex answer(double mass_kg, double stiffness, double damping, double rad_s) {
  const Complex s(0.0, rad_s);
  return (stiffness + s * damping) / (mass_kg * s * s + s * damping + stiffness);
}

/// The largest of what one round of the loop makes of a vibration, of those that come back in phase after any delay up
/// to `delay_s`: at the longest, and at all higher frequencies after a shorter one.
double largest_echo(double stiffness, double damping, double proxy_kg, double delay_s, double lag_s) {
  const double proxy_damping = 2.0 * kProxyRatio * std::sqrt(stiffness * proxy_kg);
  double largest = 0.0, behind_rad = 0.0, last_rad = 0.0;
  for (double rad_s = 0.2; rad_s < 5e3; rad_s *= 1.01) {
    const Complex round = answer(kTip_kg, stiffness, damping, rad_s) *
                          answer(proxy_kg, stiffness, proxy_damping, rad_s) / Complex(1.0, rad_s * lag_s);
    const double rad = std::arg(round);
    behind_rad -= std::remainder(rad - last_rad, 2.0 * std::numbers::pi);
    last_rad = rad;
    if (behind_rad + rad_s * delay_s >= 2.0 * std::numbers::pi) largest = std::max(largest, std::abs(round));
  }
  return largest;
}

/// As a session behind a network renders it.
double damping_of(double stiffness) {
  return std::min(kMostDamping, 2.0 * haptic::GainLimits::kEchoDampingRatio * std::sqrt(stiffness * kTip_kg));
}

TEST(Echo, ComesBackNoLargerWhateverTheDelay) {
  for (const double stiffness : {10.0, 50.0, 300.0, 1000.0, 1480.0}) {
    for (const double proxy_kg : {0.001, 0.02, 0.041, 0.1, 4.0}) {
      for (double delay_s = 0.002; delay_s < 1.0; delay_s *= 1.4) {
        const Echo echo{delay_s, kTip_kg, proxy_kg};
        const double damping = damping_of(stiffness);
        const double lag_s = echo.lag_s(stiffness, damping);
        EXPECT_LE(largest_echo(stiffness, damping, proxy_kg, delay_s, lag_s), 1.001)
            << stiffness << " N/m, proxy " << proxy_kg << " kg, " << delay_s << " s";
      }
    }
  }
}

// What the lag is for: without it, and with a quarter less than it has, an echo grows.
TEST(Echo, GrowsWithLess) {
  const double damping = damping_of(1480.0);
  EXPECT_GT(largest_echo(1480.0, damping, 0.01, 0.4, 0.0), 1.3);
  EXPECT_GT(largest_echo(1480.0, damping, 3.44, 0.36, 0.0), 1.05) << "of a heavy proxy";
  const double lag_s = Echo{0.4, kTip_kg, 1e-6}.lag_s(1480.0, damping);
  EXPECT_GT(largest_echo(1480.0, damping, 1e-6, 0.4, 0.75 * lag_s), 1.0);
}

TEST(Echo, NeedsNoLagWithoutANetworkOrBehindAShortOne) {
  EXPECT_EQ((Echo{0.0, kTip_kg, 0.1}.lag_s(300.0, 1.0)), 0.0);
  EXPECT_EQ((Echo{0.01, kTip_kg, 0.1}.lag_s(300.0, 2.8)), 0.0);
  EXPECT_GT((Echo{0.1, kTip_kg, 0.1}.lag_s(300.0, 2.8)), 0.02);
}

haptic::RenderInput answered(double proxy_m) {
  haptic::RenderInput input;
  input.dt_s = 1e-3;
  input.proxy.valid = input.proxy.fresh = true;
  input.proxy.period_s = 1e-3;
  input.proxy.position_m = {proxy_m, 0.0, 0.0};
  return input;
}

TEST(Echo, LetsTheSetPointLag) {
  const Echo echo{0.4, kTip_kg, 0.1};
  haptic::RemoteVirtualCoupling coupling(300.0, 2.8, false, echo);
  EXPECT_EQ(coupling.render(answered(0.0)).force_n.x(), 0.0);
  const double lag_s = echo.lag_s(300.0, 2.8);
  double at_m = 0.0;
  for (double time_s = 0.0; time_s < lag_s; time_s += 1e-3) at_m = coupling.render(answered(0.01)).proxy_position_m.x();
  EXPECT_NEAR(at_m, 0.01 * (1.0 - std::exp(-1.0)), 0.0003);
  haptic::RemoteVirtualCoupling at_once(300.0, 2.8);
  (void)at_once.render(answered(0.0));
  EXPECT_EQ(at_once.render(answered(0.01)).proxy_position_m.x(), 0.01);
}

}  // namespace
