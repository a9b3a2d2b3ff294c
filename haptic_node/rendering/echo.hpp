#pragma once
/// @file echo.hpp
/// The echo of the hand's own tip: where the set-point is a proxy at the other end of a network, the tip meets on its
/// spring what it did a round trip ago.
#include <algorithm>
#include <cmath>

#include "rtbus/realtime.hpp"

namespace haptic {

/// In free air a loop is closed through the network: the tip on its spring and relative damper,
/// G = (K + sB)/(ms² + sB + K), the proxy on its own, the delay. |G| exceeds 1 below √2·√(K/m), by up to 1/(2ζ). Where
/// the delay turns such a frequency by a period, what comes back is larger than what went. Energy is no bound, because
/// gravity or the hand supplies it (decision 0021).
///
/// A first-order lag τ makes |G/(1 + sτ)| ≤ 1 at every frequency if and only if τ ≥ x·√(m/K) with
///     x² = max over u of (2 − u)/((1 − u)² + 4ζ²u) = 1/(2(√(1 + 8ζ²) − 1 − 2ζ²)), and 2 from ζ² = 3/8 on.
/// Tip and proxy together need the root of the sum of squares, and a little more. A delay that is short against it
/// needs less, down to none: no frequency above which |G| > 1 is turned by a period (unit test). @realtime Yes.
struct Echo {
  double delay_s = 0.0;  ///< The longest, of network and steps together; 0: no network, and no lag.
  double tip_mass_kg = 0.0;
  double proxy_mass_kg = 0.0;  ///< As the device feels it. Its ζ is 0.7, as a session gets it.

  /// Of the set-point.
  [[nodiscard]] double lag_s(double stiffness_n_per_m, double damping_n_s_per_m) const noexcept RTBUS_NONBLOCKING {
    if (delay_s <= 0.0 || stiffness_n_per_m <= 0.0 || tip_mass_kg <= 0.0) return 0.0;
    const double ratio2 = damping_n_s_per_m * damping_n_s_per_m / (4.0 * stiffness_n_per_m * tip_mass_kg);
    const double whole_s =
        kBoth * std::sqrt((over2(ratio2) * tip_mass_kg + over2(kCalm) * proxy_mass_kg) / stiffness_n_per_m);
    return std::clamp(delay_s - 0.5 * whole_s, 0.0, whole_s);
  }

 private:
  static constexpr double kBoth = 1.17;
  static constexpr double kCalm = 3.0 / 8.0;  ///< ζ² from which on x does not fall any more.

  /// x², by ζ².
  [[nodiscard]] static double over2(double ratio2) noexcept RTBUS_NONBLOCKING {
    if (ratio2 >= kCalm) return 2.0;
    constexpr double kLeastRatio2 = 1e-6;  // below it, the difference is rounding
    const double z = std::max(ratio2, kLeastRatio2);
    return 0.5 / (std::sqrt(1.0 + 8.0 * z) - 1.0 - 2.0 * z);
  }
};

}  // namespace haptic
