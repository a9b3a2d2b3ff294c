#include "haptic_node/passivity.hpp"

#include <algorithm>
#include <cmath>

namespace haptic {

namespace {
/// Friction is counted over displacements of at least so many encoder steps.
constexpr double kMotionQuanta = 8.0;
/// From this deficit on the damper may reach its largest value.
constexpr double kFullDeficitJ = 0.05e-3;
/// Energy that the limit allows without any observed energy …
constexpr double kFreeJ = 0.25e-3;
/// … and by which E may exceed the spring's stored energy.
constexpr double kReserveJ = 1e-3;
}  // namespace

double Passivity::burnt(const Eigen::Vector3d& position_m, double elapsed_s) noexcept {
  // Encoder noise is not motion. Friction is counted only over straight displacements of several encoder steps, less
  // the rounding error on three axes: a lower bound of the real path. A tip that toggles between two steps counts
  // nothing.
  since_anchor_s_ += elapsed_s;
  const double way = (position_m - anchor_m_).norm();
  if (way < kMotionQuanta * config_.position_quantum_m || way <= 0.0) return 0.0;
  const double sure = way - 2.0 * config_.position_quantum_m;
  const double energy =
      sure * (config_.viscous_damping_n_s_per_m * sure / since_anchor_s_ + config_.coulomb_friction_n);
  anchor_m_ = position_m;
  since_anchor_s_ = 0.0;
  return energy;
}

void Passivity::observe(const Eigen::Vector3d& mean_force_n, const Eigen::Vector3d& position_m,
                        double elapsed_s) noexcept {
  if (!primed_) {
    primed_ = true;
    position_m_ = anchor_m_ = position_m;
    return;
  }
  if (elapsed_s <= 0.0) return;
  // Work of the hand on the device: −F·dx.
  const double absorbed = -mean_force_n.dot(position_m - position_m_);
  position_m_ = position_m;
  absorbed_j_ += absorbed;
  // Without the cap, long friction would allow an instability later. Without the floor, one bad moment would make the
  // device viscous for seconds.
  observed_j_ = std::clamp(observed_j_ + absorbed + burnt(position_m, elapsed_s),
                           -std::max(config_.energy_cap_j, config_.deficit_floor_j), config_.energy_cap_j);
}

void Passivity::give(double energy_j) noexcept {
  // The spring and damper at the other end may give the world energy before the hand has supplied it. That is not a
  // deficit of the hand but a claim on the world: what comes back repays it first.
  if (energy_j < 0.0) {
    claim_j_ = std::min(claim_j_ - energy_j, config_.energy_cap_j);
  } else {
    const double paid = std::min(claim_j_, energy_j);
    claim_j_ -= paid;
    observed_j_ = std::min(observed_j_ + energy_j - paid, config_.energy_cap_j);
  }
}

bool Passivity::grant_in_steps(double whole_n, double step_n) noexcept {
  const double twice_stiffness = 2.0 * config_.stiffness_n_per_m;
  const double whole_j = std::min(whole_n * whole_n / twice_stiffness, config_.energy_cap_j);
  const double next_n = std::sqrt(twice_stiffness * std::max(0.0, observed_j_ + kFreeJ)) + step_n;
  const double next_j = next_n * next_n / twice_stiffness - kFreeJ;
  if (config_.control) observed_j_ = std::max(observed_j_, std::min(whole_j, next_j));
  return !config_.control || next_j >= whole_j;
}

Eigen::Vector3d Passivity::limit(const Eigen::Vector3d& force_n, double stored_n, const Eigen::Vector3d& velocity_m_s,
                                 bool& acted) noexcept {
  acted = false;
  const double norm = force_n.norm();
  const double twice_stiffness = 2.0 * config_.stiffness_n_per_m;
  if (!config_.control || !config_.bounds || twice_stiffness <= 0.0 || norm <= 0.0) return force_n;
  // A force against the motion takes energy in, so it needs none.
  const double against = std::max(0.0, -force_n.dot(velocity_m_s) / norm - config_.noise_speed_m_s);
  const double limit_n =
      std::sqrt(twice_stiffness * std::max(0.0, observed_j_ + kFreeJ)) + config_.allowance_n_s_per_m * against;
  acted = norm > limit_n;
  Eigen::Vector3d out = acted ? Eigen::Vector3d(force_n * (limit_n / norm)) : force_n;
  if (!config_.counts_world_work) return out;
  // E is capped at the spring's stored energy plus kReserveJ. The excess first reduces the claim on the world.
  const double most_n = std::max(out.norm(), stored_n);
  const double excess = observed_j_ - (most_n * most_n / twice_stiffness + kReserveJ);
  if (excess > 0.0) {
    observed_j_ -= excess;
    claim_j_ = std::max(0.0, claim_j_ - excess);
  }
  return out;
}

Eigen::Vector3d Passivity::control(const Eigen::Vector3d& force_n, const Eigen::Vector3d& velocity_m_s, double dt_s,
                                   bool& acted) noexcept {
  acted = false;
  const double speed_squared = velocity_m_s.squaredNorm();
  if (!config_.control || !config_.damps || observed_j_ >= 0.0 || speed_squared <= 0.0) return force_n;
  // α = −E/(T·v²) would remove the deficit within this tick. The upper limit spreads it when v is small, and grows with
  // the deficit, so that E around zero does not switch a force on and off.
  const double damping = std::min(-observed_j_ / (dt_s * speed_squared),
                                  config_.damping_max_n_s_per_m * std::min(1.0, -observed_j_ / kFullDeficitJ));
  dissipated_j_ += damping * speed_squared * dt_s;
  acted = true;
  return force_n - damping * velocity_m_s;
}

}  // namespace haptic
