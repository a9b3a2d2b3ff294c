#include "tools/evaluation/shared/force_profile.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <vector>

namespace tools {

namespace {

constexpr double kIncrement_s = 1e-3;

/// Mean square of the components from the first above the mean up to `up_to_hz`, by their cosines. Few of them lie
/// below 30 Hz: their sum, taken from the variance, is cheaper than all above, and needs no fast transform.
double power_up_to(std::span<const double> centred_n, double rate_hz, double up_to_hz) {
  const auto n = static_cast<double>(centred_n.size());
  double power_n2 = 0.0;
  // Component k oscillates k/2 times within the samples.
  for (double k = 1.0; k < n && 0.5 * k * rate_hz / n <= up_to_hz; ++k) {
    // cos(πk(i + ½)/n) for i = 0, 1, … by turning: its rounding errors grow with n, not with n² as those of the
    // three-term recurrence.
    const double step = std::numbers::pi * k / n;
    const double turn_cos = std::cos(step), turn_sin = std::sin(step);
    double c = std::cos(0.5 * step), s = std::sin(0.5 * step), sum = 0.0;
    for (const double value : centred_n) {
      sum += value * c;
      const double turned = c * turn_cos - s * turn_sin;
      s = s * turn_cos + c * turn_sin;
      c = turned;
    }
    power_n2 += 2.0 * (sum / n) * (sum / n);
  }
  return power_n2;
}

}  // namespace

Roughness roughness(std::span<const double> force_n, double rate_hz) {
  Roughness out;
  if (force_n.empty()) return out;
  const auto n = static_cast<double>(force_n.size());
  double squares = 0.0;
  for (const double value : force_n) {
    out.mean_n += value / n;
    squares += value * value / n;
  }
  out.rms_n = std::sqrt(squares);

  const auto lag = static_cast<std::size_t>(std::max(1L, std::lround(kIncrement_s * rate_hz)));
  if (force_n.size() <= lag) return out;
  double changes = 0.0;
  for (std::size_t i = lag; i < force_n.size(); ++i) {
    changes += (force_n[i] - force_n[i - lag]) * (force_n[i] - force_n[i - lag]);
  }
  out.increment_rms_n = std::sqrt(changes / static_cast<double>(force_n.size() - lag));

  std::vector<double> centred(force_n.begin(), force_n.end());
  double variance = 0.0;
  for (double& value : centred) {
    value -= out.mean_n;
    variance += value * value / n;
  }
  // The difference of two nearly equal sums may fall below zero by their rounding.
  out.power_above_30hz_n2 = std::max(0.0, variance - power_up_to(centred, rate_hz, kVibration_hz));
  return out;
}

}  // namespace tools
