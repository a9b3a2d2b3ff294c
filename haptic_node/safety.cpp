#include "haptic_node/safety.hpp"

#include <algorithm>
#include <cmath>

namespace haptic {

namespace {
/// Toward zero, and where the change opposes the motion, a fast force takes energy out: it may.
constexpr double kFastSlewFactor = 10.0;
/// After an overspeed cut the tip must stay below this part of the limit …
constexpr double kOverspeedRelease = 0.5;
/// … for so long before force comes back.
constexpr double kOverspeedHold_s = 0.1;
/// Beyond these a value is as meaningless as one that is not a number, and its square would soon overflow.
constexpr double kAbsurdPosition_m = 1e3;
constexpr double kAbsurdSpeed_m_s = 1e6;
constexpr double kAbsurdForce_n = 1e9;
/// The thermal limit starts to close at this part of the continuous load.
constexpr double kThermalKnee = 0.8;
bool sane(const Eigen::Vector3d& v, double bound) noexcept { return v.allFinite() && v.cwiseAbs().maxCoeff() < bound; }

}  // namespace

SafetyLadder::SafetyLadder(const SafetyConfig& config) noexcept : config_(config), passivity_(config.passivity) {}

Eigen::Vector3d SafetyLadder::clamp(const Eigen::Vector3d& force_n, double limit_n, std::uint32_t bit,
                                    std::uint32_t& acted) const noexcept {
  const double norm = force_n.norm();
  if (norm <= limit_n) return force_n;
  acted |= bit;
  return force_n * (limit_n / norm);
}

Eigen::Vector3d SafetyLadder::limit_slew(const Eigen::Vector3d& force_n, const SafetyInput& input,
                                         std::uint32_t& acted) noexcept {
  const Eigen::Vector3d change = force_n - slewed_n_;
  const bool harmless = force_n.squaredNorm() <= slewed_n_.squaredNorm() || change.dot(input.velocity_m_s) < 0.0;
  const double allowed = config_.slew_n_per_ms * 1e3 * input.dt_s * (harmless ? kFastSlewFactor : 1.0);
  const double wanted = change.norm();
  if (wanted > allowed) {
    acted |= kSlewLimited;
    slewed_n_ += change * (allowed / wanted);
  } else {
    slewed_n_ = force_n;
  }
  return slewed_n_;
}

void SafetyLadder::watch_speed(const SafetyInput& input) noexcept {
  const double speed = input.velocity_m_s.norm();
  if (speed > config_.overspeed_m_s) {
    overspeed_ = true;
    slow_s_ = 0.0;
  } else if (overspeed_) {
    slow_s_ = speed < kOverspeedRelease * config_.overspeed_m_s ? slow_s_ + input.dt_s : 0.0;
    if (slow_s_ >= kOverspeedHold_s) overspeed_ = false;
  }
}

double SafetyLadder::update_gate(const SafetyInput& input, std::uint32_t& acted) noexcept {
  if (overspeed_ || !input.device_ok) {
    // A cut, not a fade: the tip is running away, or nobody knows where it is.
    gate_ = 0.0;
    acted |= overspeed_ ? kOverspeed : kDeviceLost;
    return gate_;
  }
  if (!input.enabled || !input.link_alive) {
    gate_ = config_.stale_fade_s > 0.0 ? std::max(0.0, gate_ - input.dt_s / config_.stale_fade_s) : 0.0;
    acted |= input.enabled ? kStale : kDisabled;
    return gate_;
  }
  if (gate_ < 1.0) {
    const double ramp_s = ever_open_ ? config_.resume_ramp_s : config_.start_ramp_s;
    gate_ = ramp_s > 0.0 ? std::min(1.0, gate_ + input.dt_s / ramp_s) : 1.0;
    acted |= kRamping;
    if (gate_ >= 1.0) ever_open_ = true;
  }
  return gate_;
}

double SafetyLadder::thermal_limit_n() const noexcept {
  // Up to the knee the peak is free; from there the allowance closes linearly in F², the motor's heat, and at the full
  // continuous load only the continuous force is left.
  const double continuous2 = config_.continuous_force_n * config_.continuous_force_n;
  const double peak2 = config_.max_force_n * config_.max_force_n;
  if (continuous2 >= peak2) return config_.max_force_n;
  const double excess = std::clamp((thermal_load_n2_ / continuous2 - kThermalKnee) / (1.0 - kThermalKnee), 0.0, 1.0);
  return std::sqrt(peak2 - (peak2 - continuous2) * excess);
}

SafetyOutput SafetyLadder::apply(const SafetyInput& input) noexcept {
  SafetyOutput out;
  const bool state_finite = sane(input.position_m, kAbsurdPosition_m) && sane(input.velocity_m_s, kAbsurdSpeed_m_s);
  SafetyInput checked = input;
  if (!state_finite) {
    // A pose that is not a number: as good as no device.
    checked.device_ok = false;
    checked.position_m = last_position_m_;
    checked.velocity_m_s.setZero();
    out.acted |= kNonfinite;
  }

  // Book the work of the force that was held since the last cycle, over the way the tip really went.
  if (primed_ && checked.device_ok) passivity_.observe(sent_n_, checked.position_m - last_position_m_, checked.elapsed_s);
  if (checked.device_ok) {
    last_position_m_ = checked.position_m;
    primed_ = true;
  }

  Eigen::Vector3d force = checked.force_n;
  if (!sane(force, kAbsurdForce_n)) {
    force.setZero();
    out.acted |= kNonfinite;
  }
  force = clamp(force, config_.max_force_n, kClamped, out.acted);
  force = limit_slew(force, checked, out.acted);
  watch_speed(checked);
  out.gate = update_gate(checked, out.acted);
  force *= out.gate;
  force = clamp(force, thermal_limit_n(), kThermalLimited, out.acted);

  bool damped = false;
  if (out.gate > 0.0) force = passivity_.control(force, checked.velocity_m_s, checked.dt_s, damped);
  if (damped) out.acted |= kPassivity;
  force = clamp(force, config_.max_force_n, kClamped, out.acted);

  const double weight = checked.dt_s / (checked.dt_s + config_.thermal_time_constant_s);
  thermal_load_n2_ += weight * (force.squaredNorm() - thermal_load_n2_);
  sent_n_ = force;
  out.force_n = force;
  return out;
}

}  // namespace haptic
