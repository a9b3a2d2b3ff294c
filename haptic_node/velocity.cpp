#include "haptic_node/velocity.hpp"

#include <numbers>

#include "rtbus/clock.hpp"

namespace haptic {

VelocityEstimator::VelocityEstimator(double cutoff_hz) noexcept
    : time_constant_s_(1.0 / (2.0 * std::numbers::pi * cutoff_hz)) {}

const Eigen::Vector3d& VelocityEstimator::update(const Eigen::Vector3d& position_m, std::uint64_t time_ns) noexcept {
  if (!primed_) {
    primed_ = true;
    position_m_ = position_m;
    time_ns_ = time_ns;
    return velocity_m_s_;
  }
  const double elapsed_s = rtbus::seconds_between(time_ns_, time_ns);
  if (elapsed_s <= 0.0) return velocity_m_s_;
  // Backward Euler of the low-pass: stable for any pause between samples, and exact in the limit of a long one.
  const double weight = elapsed_s / (elapsed_s + time_constant_s_);
  velocity_m_s_ += weight * ((position_m - position_m_) / elapsed_s - velocity_m_s_);
  position_m_ = position_m;
  time_ns_ = time_ns;
  return velocity_m_s_;
}

void VelocityEstimator::reset() noexcept {
  primed_ = false;
  velocity_m_s_.setZero();
}

}  // namespace haptic
