#include "haptic_node/safety.hpp"

#include <algorithm>
#include <cmath>

#include "rtbus/clock.hpp"

namespace haptic {

namespace {
/// The force of an order follows it no faster than this: 1 N within 50 ms.
constexpr double kExtraSlew_n_per_s = 20.0;
/// A force may fall toward zero so much faster than it may grow.
constexpr double kFallingSlewFactor = 10.0;
/// A force against the motion may grow by so many times K·|v| besides the slew limit: what a wall asks for, with room …
constexpr double kDissipativeSlewFactor = 4.0;
/// … where the speed is more than the noise of its estimate.
constexpr double kNoiseSpeed_m_s = 0.05;
/// After an overspeed cut the tip must stay below this part of the limit …
constexpr double kOverspeedRelease = 0.5;
/// … for so long before force comes back.
constexpr double kOverspeedHold_s = 0.1;
/// A hand that presses and stays while the force ramps up is slower than this.
constexpr double kSlow_m_s = 0.005;
/// A spring that a ramp finds stretched counts whole after so long, as long as the ramp after a loss; at once would be
/// a step of force.
constexpr double kFill_s = 0.100;
/// After a pause of so many periods, a hand rests when it has stayed within this distance …
constexpr double kPausePeriods = 3.0;
constexpr double kRestRadius_m = 0.2e-3;
/// … for so long. A spring that it has stretched then fills up …
constexpr double kRest_s = 0.2;
/// … at this rate, too slowly to be felt as a push.
constexpr double kRefill_n_per_s = 0.5;
/// … and by so many times its force in all. What an oscillation takes out meanwhile must not feed it for ever.
constexpr double kMostRefill = 2.0;
/// A sample that comes later than this (and than kPausePeriods) finds the hand farther on, at 50 mm/s by 0.2 mm. What
/// it went meanwhile must not be a step of the force …
constexpr double kLate_s = 4e-3;
/// … the force catches up at this rate beside what the motion itself asks for: 0.05 N per ms is an encoder step's.
constexpr double kCatchUp_n_per_s = 50.0;
/// Until so long after a ramp, a force still comes back: the energy limit may hold it back longer than the ramp does …
constexpr double kReturn_s = 0.3;
/// … and it grows by what the ramp and the motion ask for, and so much more, which is less than an encoder step may
/// make. At 0.03 N per ms a tip that a rising proxy lifts bounced on it …
constexpr double kReturn_n_per_s = 40.0;
/// … then e times as much after each of so long: what is held back still makes no step. After so many it is no limit.
constexpr double kRelease_s = 0.05, kReleases = 6.0;
/// Bandwidth of the overspeed watch: 5 m/s is seen within two milliseconds.
constexpr double kOverspeedCutoff_hz = 100.0;
/// The thermal limit starts to close at this part of the continuous load.
constexpr double kThermalKnee = 0.8;
/// Beyond these a value is as meaningless as one that is not a number, and its square would soon overflow.
constexpr double kAbsurdPosition_m = 1e3;
constexpr double kAbsurdSpeed_m_s = 1e6;
constexpr double kAbsurdForce_n = 1e9;

bool sane(const Eigen::Vector3d& v, double bound) noexcept { return v.allFinite() && v.cwiseAbs().maxCoeff() < bound; }

/// What is left of `before` in `now`: the part along it that neither grows nor turns.
Eigen::Vector3d kept_of(const Eigen::Vector3d& before, const Eigen::Vector3d& now) noexcept {
  const double before2 = before.squaredNorm();
  if (before2 <= 0.0) return Eigen::Vector3d::Zero();
  return std::clamp(now.dot(before) / before2, 0.0, 1.0) * before;
}

Eigen::Vector3d shortened(const Eigen::Vector3d& v, double limit) noexcept {
  const double norm = v.norm();
  return norm <= limit ? v : Eigen::Vector3d(v * (limit / norm));
}
}  // namespace

bool sane_position(const Eigen::Vector3d& p_DT) noexcept { return sane(p_DT, kAbsurdPosition_m); }
bool sane_velocity(const Eigen::Vector3d& v_DT) noexcept { return sane(v_DT, kAbsurdSpeed_m_s); }
bool sane_force(const Eigen::Vector3d& f_DT) noexcept { return sane(f_DT, kAbsurdForce_n); }

SafetyLadder::SafetyLadder(const SafetyConfig& config) noexcept
    : config_(config),
      passivity_(config.passivity),
      speed_(kOverspeedCutoff_hz),
      held_(config.force_timeout_s),
      // Nobody knows how warm the windings are: the peak is free, but only just.
      thermal_load_n2_(kThermalKnee * config.continuous_force_n * config.continuous_force_n) {}

Eigen::Vector3d SafetyLadder::clamp(const Eigen::Vector3d& force_n, double limit_n, std::uint32_t bit,
                                    std::uint32_t& acted) const noexcept {
  if (force_n.norm() <= limit_n) return force_n;
  acted |= bit;
  return shortened(force_n, limit_n);
}

Eigen::Vector3d SafetyLadder::limit_slew(const Eigen::Vector3d& force_n, const SafetyInput& input,
                                         std::uint32_t& acted) noexcept {
  const double slow = config_.slew_n_per_ms * 1e3 * input.dt_s;
  // Of the samples, not of the cycles: those that find no new one write what the device takes with its next.
  const bool later = slewed_ns_ != 0 && input.sample_time_ns > slewed_ns_;
  const double gap_s = later ? rtbus::seconds_between(slewed_ns_, input.sample_time_ns) : 0.0;
  const bool fresh = input.sample_time_ns != slewed_ns_;
  catches_up_ = catches_up_ || gap_s > std::max(kLate_s, kPausePeriods * input.dt_s);
  slewed_ns_ = input.sample_time_ns;
  // First the part that takes the present force back along its own direction, at most to zero: that may be fast.
  if (const double norm = slewed_n_.norm(); norm > 0.0) {
    const Eigen::Vector3d direction = slewed_n_ / norm;
    const double wanted = std::clamp(force_n.dot(direction), 0.0, norm);
    slewed_n_ -= std::min(norm - wanted, kFallingSlewFactor * slow) * direction;
  }
  // Then whatever is left: growing, turning, reversing. A wall that is hit grows as fast as the hand moves into it.
  const Eigen::Vector3d change = force_n - slewed_n_;
  double allowed = slow;
  const double speed = input.velocity_m_s.norm();
  if (speed > kNoiseSpeed_m_s && change.dot(input.velocity_m_s) < 0.0 && force_n.dot(input.velocity_m_s) < 0.0) {
    allowed += kDissipativeSlewFactor * config_.stiffness_n_per_m * speed * input.dt_s;
  }
  if (catches_up_) {
    const double rate_n_per_s = kCatchUp_n_per_s + config_.stiffness_n_per_m * speed;
    allowed = fresh ? std::min(allowed, rate_n_per_s * input.dt_s) : 0.0;
    catches_up_ = change.norm() > allowed;
  }
  if (change.norm() > allowed) acted |= kSlewLimited;
  slewed_n_ += shortened(change, allowed);
  return slewed_n_;
}

Eigen::Vector3d SafetyLadder::limit_growth(const Eigen::Vector3d& force_n, const SafetyInput& input,
                                           std::uint32_t& acted) const noexcept {
  // The observed energy may rise at once, by as much as the world claims to have given: with it the force that it
  // bounds. What was held back may have turned meanwhile, too. A force that is held back takes no energy from anybody:
  // what is sent is what the observer counts.
  const Eigen::Vector3d kept = kept_of(sent_n_, force_n);
  const Eigen::Vector3d change = force_n - kept;
  double allowed = config_.slew_n_per_ms * 1e3 * input.dt_s;
  const double speed = input.velocity_m_s.norm();
  if (speed > kNoiseSpeed_m_s && change.dot(input.velocity_m_s) < 0.0 && force_n.dot(input.velocity_m_s) < 0.0) {
    allowed += kDissipativeSlewFactor * config_.stiffness_n_per_m * speed * input.dt_s;
  }
  return kept + clamp(change, allowed, kSlewLimited, acted);
}

Eigen::Vector3d SafetyLadder::limit_return(const Eigen::Vector3d& force_n, const SafetyInput& input,
                                           std::uint32_t& acted) const noexcept {
  if (returned_s_ >= kReturn_s + kReleases * kRelease_s) return force_n;
  const double against_m_s = std::max(0.0, -force_n.normalized().dot(input.velocity_m_s));
  const double asked_n = gate_step_ * slewed_n_.norm() + config_.stiffness_n_per_m * against_m_s * input.dt_s;
  const double more_n_per_s = kReturn_n_per_s * std::exp(std::max(0.0, returned_s_ - kReturn_s) / kRelease_s);
  const Eigen::Vector3d kept = kept_of(sent_n_, force_n);
  return kept + clamp(force_n - kept, asked_n + more_n_per_s * input.dt_s, kSlewLimited, acted);
}

void SafetyLadder::watch_speed(const SafetyInput& input) noexcept {
  if (!input.device_ok) return;
  const double speed = speed_.update(input.position_m, input.sample_time_ns).norm();
  if (speed > config_.overspeed_m_s) {
    overspeed_ = true;
    slow_s_ = 0.0;
  } else if (overspeed_) {
    slow_s_ = speed < kOverspeedRelease * config_.overspeed_m_s ? slow_s_ + input.dt_s : 0.0;
    if (slow_s_ >= kOverspeedHold_s) overspeed_ = false;
  }
}

double SafetyLadder::update_gate(const SafetyInput& input, double since_s, std::uint32_t& acted) noexcept {
  const bool open = input.enabled && input.link_alive && !input.estop;
  // Afterwards as at the start: nobody knows what the hand did meanwhile.
  if (input.estop || !input.device_ok || (!input.enabled && !input.clutched)) ever_open_ = false;
  if (open) {
    fading_ = false;
  } else if (!fading_) {
    fading_ = true;
    fade_from_n_ = gate_ > 0.0 ? std::min(sent_n_.norm() / gate_, config_.max_force_n) : 0.0;
  }
  if (overspeed_ || !input.device_ok) {
    // A cut, not a fade: the tip is running away, or nobody knows where it is.
    gate_ = 0.0;
    acted |= overspeed_ ? kOverspeed : kDeviceLost;
  } else if (!open) {
    // A loop that misses periods must not fade for longer: whoever counts on zero counts time.
    const double passed_s = std::max(1.0, std::round(since_s / input.dt_s)) * input.dt_s;
    gate_ = config_.stale_fade_s > 0.0 ? std::max(0.0, gate_ - passed_s / config_.stale_fade_s) : 0.0;
    acted |= input.estop ? kEstop : input.enabled ? kStale : kDisabled;
  } else if (gate_ < 1.0) {
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

void SafetyLadder::book_energy(const SafetyInput& input) noexcept {
  if (!input.device_ok || (last_sample_ns_ != 0 && input.sample_time_ns <= last_sample_ns_)) return;
  const double elapsed_s = last_sample_ns_ == 0 ? 0.0 : rtbus::seconds_between(last_sample_ns_, input.sample_time_ns);
  Eigen::Vector3d mean_n = Eigen::Vector3d::Zero();
  if (elapsed_s > 0.0) mean_n = held_.impulse_n_s(last_sample_ns_, input.sample_time_ns) / elapsed_s;
  passivity_.observe(mean_n, input.position_m, elapsed_s);
  last_sample_ns_ = input.sample_time_ns;
}

void SafetyLadder::watch_rest(const Eigen::Vector3d& position_m, double dt_s) noexcept {
  if ((position_m - rest_m_).norm() > kRestRadius_m) {
    rest_m_ = position_m;
    rested_s_ = 0.0;
  } else {
    rested_s_ += dt_s;
  }
}

void SafetyLadder::fill_resting_spring(const SafetyInput& input, const Eigen::Vector3d& force_n) noexcept {
  // A hand that rests in a wall cannot supply, without moving, what a ramp or a pause has cost the observer; without it
  // the wall would stay soft for as long as it rests. It counts up to the device's continuous force (decision 0016),
  // and not for a tip that has just run away.
  if (gate_ <= 0.0) {
    ran_away_ = overspeed_;
    short_ = short_ || opened_;
  }
  const double stiffness_n_per_m = config_.stiffness_n_per_m;
  if (gate_ <= 0.0 || fading_ || ran_away_ || stiffness_n_per_m <= 0.0) {
    filling_ = false;
    return;
  }
  const double whole_n = std::min(force_n.norm(), config_.continuous_force_n);
  // Where the spring ends at the proxy of physics, the work that the world does there counts in a ramp instead.
  const bool slow = input.velocity_m_s.norm() <= kSlow_m_s;
  filling_ = whole_n > 0.0 && !config_.passivity.counts_world_work && (filling_ || (gate_ < 1.0 && slow));
  if (filling_ && slow) filling_ = !passivity_.grant_in_steps(whole_n, whole_n * input.dt_s / kFill_s);
  if (!short_ || rested_s_ < kRest_s) return;
  // What comes back may be little at first: the proxy was at the hand.
  const double step_n = kRefill_n_per_s * input.dt_s;
  filled_n_ += step_n;
  const bool whole = passivity_.grant_in_steps(whole_n, step_n);
  if ((!whole && filled_n_ < kMostRefill * whole_n) || returned_s_ < kReturn_s) return;
  short_ = false;
  filled_n_ = 0.0;
}

Eigen::Vector3d SafetyLadder::follow_extra(const SafetyInput& input) noexcept {
  const bool wanted = !fading_ && sane_force(input.extra_force_n);
  const Eigen::Vector3d change = (wanted ? input.extra_force_n : Eigen::Vector3d::Zero()) - extra_n_;
  extra_n_ += shortened(change, kExtraSlew_n_per_s * input.dt_s);
  return extra_n_ * gate_;
}

void SafetyLadder::start_over() noexcept {
  gate_ = 0.0;
  slewed_n_.setZero();
  sent_n_.setZero();
  extra_n_.setZero();
  speed_.reset();
}

SafetyOutput SafetyLadder::apply(const SafetyInput& input) noexcept {
  SafetyOutput out;
  SafetyInput checked = input;
  if (!sane_position(input.position_m) || !sane_velocity(input.velocity_m_s)) {
    // A pose that is not a number: as good as no device.
    checked.device_ok = false;
    checked.velocity_m_s.setZero();
    out.acted |= kNonfinite;
  }
  if (!std::isfinite(checked.world_work_j)) checked.world_work_j = 0.0;

  book_energy(checked);
  const double since_s = last_cycle_ns_ == 0 ? checked.dt_s : rtbus::seconds_between(last_cycle_ns_, checked.now_ns);
  short_ = short_ || since_s > kPausePeriods * checked.dt_s;
  if (last_cycle_ns_ != 0 && since_s > config_.force_timeout_s) start_over();

  Eigen::Vector3d force = checked.force_n;
  if (!sane_force(force)) {
    force.setZero();
    out.acted |= kNonfinite;
  }
  force = clamp(force, config_.max_force_n, kClamped, out.acted);
  force = limit_slew(force, checked, out.acted);
  watch_speed(checked);
  const double gate_before = gate_;
  out.gate = update_gate(checked, since_s, out.acted);
  gate_step_ = std::max(0.0, out.gate - gate_before);
  opened_ = opened_ || out.gate >= 1.0;
  returned_s_ = out.gate < 1.0 && opened_ ? 0.0 : returned_s_ + checked.dt_s;
  // A fade only ever falls, also when the method goes on pulling harder at a proxy that stands still. The slew limit's
  // own state is held down with it, so that a fade that is called off goes on from here.
  if (fading_) force = slewed_n_ = shortened(slewed_n_, fade_from_n_);
  if (checked.device_ok) watch_rest(checked.position_m, checked.dt_s);
  fill_resting_spring(checked, force);
  // What the coupling stores, also while a ramp lets less of it through; not after the tip has run away.
  const double stored_n = ran_away_ ? 0.0 : force.norm();
  force *= out.gate;
  const double thermal_n = thermal_limit_n();
  force = clamp(force, thermal_n, kThermalLimited, out.acted);

  bool limited = false, damped = false;
  passivity_.give(checked.world_work_j);
  force = passivity_.limit(force, stored_n, checked.velocity_m_s, limited);
  force = limit_growth(force, checked, out.acted);
  if (out.gate > 0.0) force = passivity_.control(force, checked.velocity_m_s, checked.dt_s, damped);
  force = limit_return(force, checked, out.acted);
  if (limited || damped) out.acted |= kPassivity;
  const double limit_n = std::min(config_.max_force_n, thermal_n);
  force = clamp(force, limit_n, kClamped, out.acted);
  out.extra_force_n = follow_extra(checked);
  out.force_n = force + out.extra_force_n;
  if (const double norm = out.force_n.norm(); norm > limit_n && !out.extra_force_n.isZero(0.0)) {
    force *= limit_n / norm;
    out.extra_force_n *= limit_n / norm;
    out.force_n *= limit_n / norm;
    out.acted |= kClamped;
  }

  const double weight = since_s / (since_s + config_.thermal_time_constant_s);
  thermal_load_n2_ += weight * (out.force_n.squaredNorm() - thermal_load_n2_);
  held_.write(checked.now_ns, force);
  sent_n_ = force;
  last_cycle_ns_ = checked.now_ns;
  return out;
}

}  // namespace haptic
