#include "haptic_node/velocity.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "rtbus/clock.hpp"

namespace haptic {

VelocityEstimator::VelocityEstimator(const VelocityConfig& config) noexcept
    : config_(config), time_constant_s_(1.0 / (2.0 * std::numbers::pi * config.cutoff_hz)) {}

const Eigen::Vector3d& VelocityEstimator::update(const Eigen::Vector3d& position_m, std::uint64_t time_ns) noexcept {
  const Sample before = back(0);
  const double elapsed_s = kept_ == 0 ? 1.0 : rtbus::seconds_between(before.time_ns, time_ns);
  if (elapsed_s <= 0.0) return velocity_m_s_;
  newest_ = (newest_ + 1) % kWindow;
  samples_[newest_] = {time_ns, position_m};
  kept_ = std::min(kept_ + 1, kWindow);
  if (kept_ == 1) return velocity_m_s_;
  if (config_.adaptive) {
    for (int axis = 0; axis < 3; ++axis) velocity_m_s_[axis] = window_velocity(axis);
  } else {
    // Backward Euler of the low-pass: stable for any pause between samples, and exact in the limit of a long one.
    const double weight = elapsed_s / (elapsed_s + time_constant_s_);
    velocity_m_s_ += weight * ((position_m - before.position_m) / elapsed_s - velocity_m_s_);
  }
  return velocity_m_s_;
}

double VelocityEstimator::window_velocity(int axis) const noexcept {
  const Sample& now = back(0);
  // Each sample is off by half a step at most; so is the line through two of them.
  const double band_m = config_.quantum_m * (1.0 + 1e-9);
  double slope = 0.0;
  // Slopes of the lines through the newest sample that pass all those in between.
  double lowest = -std::numeric_limits<double>::infinity(), highest = -lowest;
  for (std::size_t n = 1; n < kept_; ++n) {
    const double age_s = rtbus::seconds_between(back(n).time_ns, now.time_ns);
    const double way_m = now.position_m[axis] - back(n).position_m[axis];
    const double candidate = way_m / age_s;
    if (candidate < lowest || candidate > highest) break;
    slope = candidate;
    lowest = std::max(lowest, (way_m - band_m) / age_s);
    highest = std::min(highest, (way_m + band_m) / age_s);
  }
  return slope;
}

void VelocityEstimator::reset() noexcept {
  kept_ = 0;
  velocity_m_s_.setZero();
}

}  // namespace haptic
