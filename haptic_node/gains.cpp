#include "haptic_node/gains.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace haptic {

namespace {

/// Physics is slow below so many times the tip's own frequency (decision 0011).
constexpr double kSlowPhysics = 1.5;

}  // namespace

Gains GainLimits::bearable(const Gains& wanted) const noexcept {
  Gains out;
  out.stiffness_n_per_m = std::min(wanted.stiffness_n_per_m, stiffness_max_n_per_m);
  const double own_hz = std::sqrt(out.stiffness_n_per_m / tip_mass_kg) / (2.0 * std::numbers::pi);
  // Without it the set-point of a slow physics, which moves in straight lines, rings the tip at each corner.
  const double floor_n_s_per_m = set_points_per_s >= kSlowPhysics * own_hz
                                     ? 0.0
                                     : 2.0 * least_damping_ratio * std::sqrt(out.stiffness_n_per_m * tip_mass_kg);
  out.damping_n_s_per_m = std::min(std::max(wanted.damping_n_s_per_m, floor_n_s_per_m), damping_max_n_s_per_m);
  return out;
}

bool GainRamp::follow(const Gains& wanted, double dt_s) noexcept {
  const Gains target = limits_.bearable(wanted);
  if (target == now_) return false;
  const double share = dt_s / kFullRange_s;
  const auto step = [share](double now, double to, double range) {
    return now + std::clamp(to - now, -share * range, share * range);
  };
  now_.stiffness_n_per_m = step(now_.stiffness_n_per_m, target.stiffness_n_per_m, limits_.stiffness_max_n_per_m);
  now_.damping_n_s_per_m = step(now_.damping_n_s_per_m, target.damping_n_s_per_m, limits_.damping_max_n_s_per_m);
  return true;
}

}  // namespace haptic
