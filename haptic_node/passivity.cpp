#include "haptic_node/passivity.hpp"

#include <algorithm>
#include <cmath>

namespace haptic {

namespace {
/// Ways shorter than so many encoder steps earn no credit.
constexpr double kCreditQuanta = 8.0;
/// From this debt on the damper may use all it has.
constexpr double kFullDebtJ = 0.05e-3;
/// A force may be there without energy as far as a spring holds so much of it …
constexpr double kFreeJ = 0.25e-3;
/// … and the ledger may hold so much more than what the spring has stored.
constexpr double kReserveJ = 1e-3;
}  // namespace

double Passivity::burnt(const Eigen::Vector3d& position_m, double elapsed_s) noexcept {
  // Encoder noise is not motion: friction is credited only over straight ways of several quanta, less what rounding can
  // feign on three axes. That is a lower bound of the way really gone, and a tip that toggles on the spot earns
  // nothing.
  since_anchor_s_ += elapsed_s;
  const double way = (position_m - anchor_m_).norm();
  if (way < kCreditQuanta * config_.position_quantum_m || way <= 0.0) return 0.0;
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
  // The force on the hand does −F·dx of work on our side of the port.
  const double absorbed = -mean_force_n.dot(position_m - position_m_);
  position_m_ = position_m;
  absorbed_j_ += absorbed;
  // The cap keeps a long stretch of friction from becoming credit for an instability later; the floor keeps one bad
  // moment from making the device viscous for seconds.
  ledger_j_ = std::clamp(ledger_j_ + absorbed + burnt(position_m, elapsed_s),
                         -std::max(config_.reservoir_max_j, config_.debt_floor_j), config_.reservoir_max_j);
}

void Passivity::give(double energy_j) noexcept {
  // The other end has a spring and damper of its own and hands energy to the world before the hand has felt it, or
  // without. That is no debt of ours: the world owes it, and what comes back later pays that first.
  if (energy_j < 0.0) {
    owed_j_ = std::min(owed_j_ - energy_j, config_.reservoir_max_j);
  } else {
    const double paid = std::min(owed_j_, energy_j);
    owed_j_ -= paid;
    ledger_j_ = std::min(ledger_j_ + energy_j - paid, config_.reservoir_max_j);
  }
}

Eigen::Vector3d Passivity::limit(const Eigen::Vector3d& force_n, const Eigen::Vector3d& velocity_m_s,
                                 bool& acted) noexcept {
  acted = false;
  const double norm = force_n.norm();
  const double twice_stiffness = 2.0 * config_.stiffness_n_per_m;
  if (!config_.control || twice_stiffness <= 0.0 || norm <= 0.0) return force_n;
  // What acts against the motion takes energy in, now: it needs none.
  const double against = std::max(0.0, -force_n.dot(velocity_m_s) / norm - config_.noise_speed_m_s);
  const double limit_n =
      std::sqrt(twice_stiffness * std::max(0.0, ledger_j_ + kFreeJ)) + config_.allowance_n_s_per_m * against;
  acted = norm > limit_n;
  const Eigen::Vector3d out = acted ? Eigen::Vector3d(force_n * (limit_n / norm)) : force_n;
  if (!config_.books_world) return out;
  // More than the spring has stored is not kept: it pays first for what the world has borrowed.
  const double excess = ledger_j_ - (out.squaredNorm() / twice_stiffness + kReserveJ);
  if (excess > 0.0) {
    ledger_j_ -= excess;
    owed_j_ = std::max(0.0, owed_j_ - excess);
  }
  return out;
}

Eigen::Vector3d Passivity::control(const Eigen::Vector3d& force_n, const Eigen::Vector3d& velocity_m_s, double dt_s,
                                   bool& acted) noexcept {
  acted = false;
  const double speed_squared = velocity_m_s.squaredNorm();
  if (!config_.control || ledger_j_ >= 0.0 || speed_squared <= 0.0) return force_n;
  // α = −E/(T·v²) would settle the debt within this tick; the ceiling spreads it when v is small.
  // The ceiling itself comes with the debt, so that a ledger about zero does not switch a force on and off.
  const double damping = std::min(-ledger_j_ / (dt_s * speed_squared),
                                  config_.damping_max_n_s_per_m * std::min(1.0, -ledger_j_ / kFullDebtJ));
  dissipated_j_ += damping * speed_squared * dt_s;
  acted = true;
  return force_n - damping * velocity_m_s;
}

}  // namespace haptic
