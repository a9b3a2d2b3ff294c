#include "haptic_node/passivity.hpp"

#include <algorithm>

namespace haptic {

void Passivity::observe(const Eigen::Vector3d& held_force_n, const Eigen::Vector3d& moved_m,
                        double elapsed_s) noexcept {
  if (elapsed_s <= 0.0) return;
  // The force on the hand does −F·dx of work on our side of the port.
  const double absorbed = -held_force_n.dot(moved_m);
  absorbed_j_ += absorbed;
  // What the mechanics burnt on the same way: b·v² and f_c·|v| with the mean speed, a lower bound of the true figure.
  const double distance = moved_m.norm();
  const double burnt = distance * (config_.viscous_damping_n_s_per_m * distance / elapsed_s + config_.coulomb_friction_n);
  // The cap keeps a long stretch of friction from becoming credit for an instability later.
  ledger_j_ = std::min(ledger_j_ + absorbed + burnt, config_.reservoir_max_j);
}

Eigen::Vector3d Passivity::control(const Eigen::Vector3d& force_n, const Eigen::Vector3d& velocity_m_s, double dt_s,
                                   bool& acted) noexcept {
  acted = false;
  const double speed_squared = velocity_m_s.squaredNorm();
  if (ledger_j_ >= 0.0 || speed_squared <= 0.0) return force_n;
  // α = −E/(T·v²) would settle the debt within this tick; the ceiling spreads it when v is small.
  const double damping = std::min(-ledger_j_ / (dt_s * speed_squared), config_.damping_max_n_s_per_m);
  dissipated_j_ += damping * speed_squared * dt_s;
  acted = true;
  return force_n - damping * velocity_m_s;
}

}  // namespace haptic
