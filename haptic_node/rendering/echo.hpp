#pragma once
/// @file echo.hpp
/// The echo of the hand's own tip: where the set-point is a proxy at the other end of a network, the tip meets on its
/// spring what it did a round trip ago.
#include <algorithm>
#include <cmath>

#include "rtbus/realtime.hpp"

namespace haptic {

/// In free air the loop is closed through the network: tip on spring and relative damper, G = (K + sB)/(ms² + sB + K),
/// the proxy on its own, the delay. G exceeds 1 below √2·√(K/m), by up to 1/(2ζ). A delay that is long against the
/// tip's period turns each of these frequencies into phase, so what comes back is larger than what went, and energy is
/// no bound: gravity or the hand supplies it (decision 0021).
///
/// A first-order lag τ makes |G/(1 + sτ)| ≤ 1 at every frequency, for any delay, if and only if τ ≥ x·√(m/K) with
///     x² = max over u of (2 − u)/((1 − u)² + 4ζ²u) = 1/(2(√(1 + 8ζ²) − 1 − 2ζ²)),  from ζ² = 3/8 on 2.
/// The proxy needs the same for its mass; its ζ is 0.7 as a session gets it. @realtime Yes.
struct Echo {
  double round_trip_s = 0.0;  ///< The longest of the network; 0: there is none, and no lag.
  double tip_mass_kg = 0.0;
  double proxy_mass_kg = 0.0;  ///< As the device feels it.

  /// Of the set-point. At most half of the round trip: where the delay is short against the period, the echo damps.
  [[nodiscard]] double lag_s(double stiffness_n_per_m, double damping_n_s_per_m) const noexcept RTBUS_NONBLOCKING {
    if (round_trip_s <= 0.0 || stiffness_n_per_m <= 0.0) return 0.0;
    const double ratio2 =
        damping_n_s_per_m * damping_n_s_per_m / (4.0 * stiffness_n_per_m * std::max(tip_mass_kg, kLeast_kg));
    const double needed_s =
        (over(ratio2) * std::sqrt(tip_mass_kg) + over(kCalm) * std::sqrt(proxy_mass_kg)) / std::sqrt(stiffness_n_per_m);
    return std::min(needed_s, kMostOfRoundTrip * round_trip_s);
  }

 private:
  static constexpr double kMostOfRoundTrip = 0.5;
  static constexpr double kCalm = 3.0 / 8.0;  ///< ζ² from which on x does not fall any more.
  static constexpr double kLeast_kg = 1e-9;

  /// x, by ζ².
  [[nodiscard]] static double over(double ratio2) noexcept RTBUS_NONBLOCKING {
    if (ratio2 >= kCalm) return std::sqrt(2.0);
    constexpr double kLeastRatio2 = 1e-6;  // below it, the difference is rounding
    const double z = std::max(ratio2, kLeastRatio2);
    return 1.0 / std::sqrt(2.0 * (std::sqrt(1.0 + 8.0 * z) - 1.0 - 2.0 * z));
  }
};

}  // namespace haptic
