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
  bool control = true;           ///< False: energy is observed and published, and nothing is done about it.
  double debt_floor_j = 0.0;     ///< The debt may grow at least as far, whatever may be stored.
  double reservoir_max_j = 0.0;  ///< What may be stored and given back: the energy of the fully stretched coupling. The
                                 ///< debt is bounded by the same figure.
  double damping_max_n_s_per_m = 0.0;      ///< Ceiling of the injected damper: more would amplify velocity noise.
  double viscous_damping_n_s_per_m = 0.0;  ///< Of the device: energy it burns by itself (DeviceInfo, lower bound).
  double coulomb_friction_n = 0.0;         ///< Likewise.
  double position_quantum_m = 0.0;         ///< Of the encoders: what toggles by less than some of these is not motion.
  double stiffness_n_per_m = 0.0;          ///< Of the coupling: its stored energy is |F|²/(2K). 0: no limit().
  bool books_world = false;                ///< give() is called: no energy but the spring's own need be kept.
  double allowance_n_s_per_m = 0.0;        ///< A force against the motion may be larger by so much times the speed …
  double noise_speed_m_s = 0.0;            ///< … that is more than this.
};

/// @realtime Yes, all of it.
class Passivity {
 public:
  explicit Passivity(const PassivityConfig& config) noexcept : config_(config) {}

  /// A new position: books the work of the force that acted since the last one.
  /// @param mean_force_n Mean over time of what acted on the hand, in D. @param position_m p_DT now. @param elapsed_s
  /// Time since the last call.
  void observe(const Eigen::Vector3d& mean_force_n, const Eigen::Vector3d& position_m,
               double elapsed_s) noexcept RTBUS_NONBLOCKING;

  /// The force that may leave: `force_n`, plus a damper when the ledger is in debt. `acted` tells whether it was.
  [[nodiscard]] Eigen::Vector3d control(const Eigen::Vector3d& force_n, const Eigen::Vector3d& velocity_m_s,
                                        double dt_s, bool& acted) noexcept RTBUS_NONBLOCKING;

  /// The world has put so much energy into the coupling at its other end; negative: it has taken some.
  void give(double energy_j) noexcept RTBUS_NONBLOCKING;

  /// `force_n`, shortened to what a spring can hold with the energy in the ledger, √(2K·E): passive set-point
  /// modulation (D. Lee, K. Huang, "Passive-set-position-modulation framework for interactive robotic systems", IEEE
  /// Trans. Robotics 26(2), 2010) seen from the force, whatever moved the set-point. `acted` tells whether it was.
  [[nodiscard]] Eigen::Vector3d limit(const Eigen::Vector3d& force_n, const Eigen::Vector3d& velocity_m_s,
                                      bool& acted) noexcept RTBUS_NONBLOCKING;

  /// Work the hand has done on the device's force since start [J]; negative: we have made energy.
  [[nodiscard]] double absorbed_j() const noexcept { return absorbed_j_; }
  /// What may still be given back [J]: absorbed energy plus what the device's own friction burnt, capped.
  [[nodiscard]] double ledger_j() const noexcept { return ledger_j_; }
  /// Energy the damper has been commanded to take out since start [J].
  [[nodiscard]] double dissipated_j() const noexcept { return dissipated_j_; }

 private:
  [[nodiscard]] double burnt(const Eigen::Vector3d& position_m, double elapsed_s) noexcept RTBUS_NONBLOCKING;

  PassivityConfig config_;
  bool primed_ = false;
  Eigen::Vector3d position_m_ = Eigen::Vector3d::Zero();  ///< At the last observe().
  Eigen::Vector3d anchor_m_ = Eigen::Vector3d::Zero();    ///< Friction is credited from here on …
  double since_anchor_s_ = 0.0;                           ///< … and for so long.
  double absorbed_j_ = 0.0;
  double ledger_j_ = 0.0;
  double dissipated_j_ = 0.0;
  double owed_j_ = 0.0;  ///< By the world: what it has taken before the hand had put it in.
};

}  // namespace haptic
