#pragma once
/// @file passivity.hpp
/// Time-domain passivity observer and controller at the device's port: whatever makes energy upstream (hold of the
/// sampled spring, late physics, jumps of the set-point, a pause of the machine), the hand does not receive it.
///
/// After B. Hannaford, J.-H. Ryu, "Time-domain passivity control of haptic interfaces", IEEE Trans. Robotics and
/// Automation 18(1), 2002; the energy of a held force is taken over the displacement that really happened, after
/// J.-H. Ryu et al., "Sampled- and continuous-time passivity and stability of virtual environments", ICRA 2004.
#include <Eigen/Core>

#include "rtbus/realtime.hpp"

namespace haptic {

struct PassivityConfig {
  double reservoir_max_j = 0.0;     ///< What may be stored and given back: the energy of the fully stretched coupling.
  double damping_max_n_s_per_m = 0.0;  ///< Ceiling of the injected damper: more would amplify velocity noise.
  double viscous_damping_n_s_per_m = 0.0;  ///< Of the device: energy it burns by itself (DeviceInfo, lower bound).
  double coulomb_friction_n = 0.0;         ///< Likewise.
};

/// @realtime Yes, all of it.
class Passivity {
 public:
  explicit Passivity(const PassivityConfig& config) noexcept : config_(config) {}

  /// Start of a cycle: books the work of the force that was held since the last one.
  /// @param held_force_n What left then, in D. @param moved_m Displacement of the tip since then, in D.
  /// @param elapsed_s Time since then.
  void observe(const Eigen::Vector3d& held_force_n, const Eigen::Vector3d& moved_m, double elapsed_s) noexcept
      RTBUS_NONBLOCKING;

  /// The force that may leave: `force_n`, plus a damper when the ledger is in debt. `acted` tells whether it was.
  [[nodiscard]] Eigen::Vector3d control(const Eigen::Vector3d& force_n, const Eigen::Vector3d& velocity_m_s,
                                        double dt_s, bool& acted) noexcept RTBUS_NONBLOCKING;

  /// Work the hand has done on the device's force since start [J]; negative: we have made energy.
  [[nodiscard]] double absorbed_j() const noexcept { return absorbed_j_; }
  /// What may still be given back [J]: absorbed energy plus what the device's own friction burnt, capped.
  [[nodiscard]] double ledger_j() const noexcept { return ledger_j_; }
  /// Energy the damper has been commanded to take out since start [J].
  [[nodiscard]] double dissipated_j() const noexcept { return dissipated_j_; }

 private:
  PassivityConfig config_;
  double absorbed_j_ = 0.0;
  double ledger_j_ = 0.0;
  double dissipated_j_ = 0.0;
};

}  // namespace haptic
