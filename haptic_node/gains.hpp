#pragma once
/// @file gains.hpp
/// Stiffness and damping of the coupling, and what a device bears of them at the rate of its loop.
#include "rtbus/realtime.hpp"

namespace haptic {

/// At the device.
struct Gains {
  double stiffness_n_per_m = 0.0;
  double damping_n_s_per_m = 0.0;

  friend bool operator==(const Gains&, const Gains&) = default;
};

/// Limits of the gains in one session.
struct GainLimits {
  /// The corners of the set-point's line, one per period T of physics, reach the tip's own frequency f with
  /// sinc²(π·f·T) of their size and are amplified there by 1/(2ζ): half of this keeps them smaller than what made them
  /// wherever 1/T is below 1.5·f; the other half is for a tip that moves, which dry friction does not calm (decision
  /// 0011).
  static constexpr double kLeastDampingRatio = 0.2;
  /// Over a network: the lag that calms the echo (echo.hpp) is 1.6·√(m/K) instead of 2.7.
  static constexpr double kEchoDampingRatio = 0.4;

  double stiffness_max_n_per_m = 0.0;  ///< Of device, rate and slew limit.
  double damping_max_n_s_per_m = 0.0;  ///< Of mass, rate and velocity filter.
  double tip_mass_kg = 0.0;
  /// Steps of physics per second, for a method whose set-point rings the tip where physics is slow (decision 0011);
  /// infinite: it does not.
  double set_points_per_s = 0.0;
  /// Least damping ratio ζ of the tip where they are slow.
  double least_damping_ratio = kLeastDampingRatio;

  /// `wanted`, lowered to the limits; the damping raised to least_damping_ratio on a slow link. @realtime Yes.
  [[nodiscard]] Gains bearable(const Gains& wanted) const noexcept RTBUS_NONBLOCKING;
};

/// Moves gains so slowly that the hand feels no step. @realtime Yes.
class GainRamp {
 public:
  /// Largest change: from zero to the limit within this time. The energy of a spring that is stretched while it
  /// stiffens grows with it; the passivity observer sees the same stiffness and limits the force.
  static constexpr double kFullRange_s = 1.0;

  GainRamp(const Gains& now, const GainLimits& limits) noexcept : now_(now), limits_(limits) {}

  /// One cycle nearer to `wanted`, within the limits. @returns whether they changed.
  bool follow(const Gains& wanted, double dt_s) noexcept RTBUS_NONBLOCKING;
  [[nodiscard]] const Gains& now() const noexcept RTBUS_NONBLOCKING { return now_; }

 private:
  Gains now_;
  GainLimits limits_;
};

}  // namespace haptic
