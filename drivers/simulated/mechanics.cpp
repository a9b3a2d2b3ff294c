#include "drivers/simulated/mechanics.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

namespace drivers::simulated {
namespace {

Eigen::Vector3d rounded_to(const Eigen::Vector3d& value, double step) {
  if (step <= 0.0) return value;
  return {std::round(value.x() / step) * step, std::round(value.y() / step) * step,
          std::round(value.z() / step) * step};
}

// SplitMix64 (Steele, Lea, Flood: Fast Splittable Pseudorandom Number Generators, OOPSLA 2014). Our own, because the
// distributions of <random> differ between standard libraries and a run has to repeat bit by bit everywhere.
std::uint64_t next_random(std::uint64_t& state) {
  state += 0x9e3779b97f4a7c15ULL;
  std::uint64_t z = state;
  z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9ULL;
  z = (z ^ (z >> 27)) * 0x94d049bb133111ebULL;
  return z ^ (z >> 31);
}

}  // namespace

Mechanics::Mechanics(const MechanicsParameters& parameters, Hand hand)
    : parameters_(parameters), hand_(std::move(hand)), step_s_(static_cast<double>(parameters.step_ns) * 1e-9) {
  reset(0);
}

void Mechanics::reset(std::uint64_t now_ns) noexcept RTBUS_NONBLOCKING {
  time_ns_ = now_ns;
  script_running_ = false;
  force_n_.setZero();
  hand_force_n_.setZero();
  actuator_work_j_ = 0.0;
  force_expires_ns_ = kNever;
  timed_out_ = true;
  skipped_ns_ = 0;
  random_state_ = parameters_.jitter_seed;
  place(parameters_.start_position_m, Eigen::Vector3d::Zero());
}

void Mechanics::begin_script(std::uint64_t now_ns) noexcept RTBUS_NONBLOCKING {
  script_start_ns_ = now_ns;
  script_running_ = true;
}

void Mechanics::place(const Eigen::Vector3d& position_m,
                      const Eigen::Vector3d& velocity_m_s) noexcept RTBUS_NONBLOCKING {
  position_m_ = position_m;
  velocity_m_s_ = velocity_m_s;
  steps_ = 0;
  history_m_[0] = position_m;
}

void Mechanics::advance_to(std::uint64_t now_ns) noexcept RTBUS_NONBLOCKING {
  if (now_ns <= time_ns_) return;
  const std::uint64_t due = (now_ns - time_ns_) / parameters_.step_ns;
  const std::uint64_t simulated = std::min(due, kMaxCatchUpNs / parameters_.step_ns);
  for (std::uint64_t i = 0; i < simulated; ++i) step();
  // Skipping whole steps keeps the grid of steps where it was.
  const std::uint64_t skipped = (due - simulated) * parameters_.step_ns;
  time_ns_ += skipped;
  skipped_ns_ += skipped;
}

bool limit_force(double limit_n, Eigen::Vector3d& force_n) noexcept RTBUS_NONBLOCKING {
  // Rounding of a force that was clamped to exactly the limit must not count as beyond it.
  constexpr double kTolerance = 1.0 + 1e-9;
  if (!force_n.allFinite()) {
    force_n.setZero();
    return false;
  }
  const double norm_n = force_n.stableNorm();  // no overflow for huge commands
  if (norm_n <= limit_n * kTolerance) return true;
  force_n = force_n / norm_n * limit_n;
  return false;
}

bool Mechanics::set_force(const Eigen::Vector3d& force_n, std::uint64_t expires_ns) noexcept RTBUS_NONBLOCKING {
  const double step_n = parameters_.force_step_n;
  Eigen::Vector3d wanted_n = force_n;
  const bool accepted = limit_force(parameters_.max_force_n, wanted_n);
  force_n_ = rounded_to(wanted_n, step_n);
  // At the limit, rounding up could leave the sphere by half a step: round toward zero there.
  if (step_n > 0.0 && force_n_.norm() > parameters_.max_force_n) {
    for (int axis = 0; axis < 3; ++axis) force_n_[axis] = std::trunc(wanted_n[axis] / step_n) * step_n;
  }
  force_expires_ns_ = expires_ns;
  timed_out_ = false;
  return accepted;
}

void Mechanics::step() noexcept RTBUS_NONBLOCKING {
  const MechanicsParameters& p = parameters_;
  const double h = step_s_;
  expire_force(time_ns_);
  time_ns_ += p.step_ns;
  const HandTarget hand = hand_.at(elapsed_ns(time_ns_));

  if (hand.grip == Grip::kRigid) {
    position_m_ = hand.position_m;
    velocity_m_s_ = hand.velocity_m_s;
    hand_force_n_ = -(force_n_ + p.mass_kg * p.gravity_m_s2);
    remember();
    return;
  }

  const Eigen::Vector3d before_m_s = velocity_m_s_;
  const Eigen::Vector3d free_n = force_n_ + p.mass_kg * p.gravity_m_s2;
  if (hand.grip == Grip::kNone) {
    hand_force_n_.setZero();
    velocity_m_s_ = slowed(p.mass_kg * before_m_s + h * free_n, p.mass_kg + h * p.viscous_n_s_per_m);
  } else {
    const HandImpedance& z = hand_.impedance();
    const double mass_kg = p.mass_kg + z.mass_kg;
    const double inertia_kg = mass_kg + h * p.viscous_n_s_per_m;
    const Eigen::Vector3d stretch_m = hand.position_m - position_m_;
    const Eigen::Vector3d pull_n = z.stiffness_n_per_m * stretch_m + z.damping_n_s_per_m * hand.velocity_m_s;
    const double pull_inertia_kg = h * (z.damping_n_s_per_m + h * z.stiffness_n_per_m);
    velocity_m_s_ = slowed(mass_kg * before_m_s + h * (free_n + pull_n), inertia_kg + pull_inertia_kg);

    // The force that this velocity leaves in spring and damper; beyond its limit the hand slips.
    hand_force_n_ = pull_n - (z.damping_n_s_per_m + h * z.stiffness_n_per_m) * velocity_m_s_;
    const double norm_n = hand_force_n_.norm();
    if (norm_n > z.max_force_n) {
      hand_force_n_ *= z.max_force_n / norm_n;
      velocity_m_s_ = slowed(mass_kg * before_m_s + h * (free_n + hand_force_n_), inertia_kg);
    }
    hand_force_n_ -= z.mass_kg / h * (velocity_m_s_ - before_m_s);
  }
  position_m_ += h * velocity_m_s_;
  if (p.end_stops) stop_at_ends();
  remember();
}

Eigen::Vector3d Mechanics::slowed(const Eigen::Vector3d& momentum, double inertia_kg) const noexcept {
  const double friction_impulse = step_s_ * parameters_.coulomb_n;
  const double size = momentum.norm();
  if (size <= friction_impulse) return Eigen::Vector3d::Zero();
  return (1.0 - friction_impulse / size) / inertia_kg * momentum;
}

void Mechanics::stop_at_ends() noexcept RTBUS_NONBLOCKING {
  for (int axis = 0; axis < 3; ++axis) {
    const double low_m = parameters_.workspace_min_m[axis];
    const double high_m = parameters_.workspace_max_m[axis];
    if (position_m_[axis] >= low_m && position_m_[axis] <= high_m) continue;
    position_m_[axis] = std::clamp(position_m_[axis], low_m, high_m);
    velocity_m_s_[axis] = 0.0;
  }
}

void Mechanics::remember() noexcept RTBUS_NONBLOCKING {
  actuator_work_j_ += force_n_.dot(position_m_ - history_m_[steps_ % kHistory]);
  ++steps_;
  history_m_[steps_ % kHistory] = position_m_;
}

Eigen::Vector3d Mechanics::measure(std::uint64_t now_ns) noexcept RTBUS_NONBLOCKING {
  std::uint64_t sampled_ns = now_ns;
  if (parameters_.sample_jitter_ns > 0) {
    // 53 random bits as a fraction 0…1.
    const double fraction = static_cast<double>(next_random(random_state_) >> 11) * 0x1p-53;
    const auto back_ns = static_cast<std::uint64_t>(fraction * static_cast<double>(parameters_.sample_jitter_ns));
    sampled_ns -= std::min(sampled_ns, back_ns);
  }
  return rounded_to(position_at(sampled_ns), parameters_.position_quantum_m);
}

Eigen::Vector3d Mechanics::position_at(std::uint64_t time_ns) const noexcept RTBUS_NONBLOCKING {
  if (time_ns >= time_ns_) {
    const std::uint64_t ahead_ns = std::min(time_ns - time_ns_, parameters_.step_ns);
    return position_m_ + static_cast<double>(ahead_ns) * 1e-9 * velocity_m_s_;
  }
  // Between the ends of two past steps, or the oldest one kept.
  const std::uint64_t back_ns = time_ns_ - time_ns;
  const std::uint64_t newest = back_ns / parameters_.step_ns;
  const std::uint64_t kept = std::min<std::uint64_t>(steps_, kHistory - 1);
  if (newest >= kept) return history_m_[(steps_ - kept) % kHistory];
  const double u =
      static_cast<double>(back_ns - newest * parameters_.step_ns) / static_cast<double>(parameters_.step_ns);
  const Eigen::Vector3d& later = history_m_[(steps_ - newest) % kHistory];
  const Eigen::Vector3d& earlier = history_m_[(steps_ - newest - 1) % kHistory];
  return later + u * (earlier - later);
}

}  // namespace drivers::simulated
