#pragma once
/// @file passivity.hpp
/// Time-domain passivity observer and controller at the device's port: energy that is generated upstream does not reach
/// the hand. Sources: the hold of the sampled spring, late physics, jumps of the set-point, a pause of the machine.
///
/// After B. Hannaford, J.-H. Ryu, "Time-domain passivity control of haptic interfaces", IEEE Trans. Robotics and
/// Automation 18(1), 2002; the work of a held force is taken over the measured displacement, after
/// J.-H. Ryu et al., "Sampled- and continuous-time passivity and stability of virtual environments", ICRA 2004.
#include <Eigen/Core>

#include "rtbus/realtime.hpp"

namespace haptic {

struct PassivityConfig {
  bool control = true;           ///< False: energy is observed and published, not controlled.
  bool bounds = true;            ///< limit() acts; false for comparison.
  bool damps = true;             ///< The damper acts; false for comparison.
  double deficit_floor_j = 0.0;  ///< Least bound of the deficit, whatever energy_cap_j is.
  double energy_cap_j =
      0.0;  ///< Largest observed energy: that of the coupling at its force limit. Bounds the deficit too.
  double damping_max_n_s_per_m = 0.0;      ///< Largest damping that is injected: more would amplify velocity noise.
  double viscous_damping_n_s_per_m = 0.0;  ///< Of the device: what it dissipates itself (DeviceInfo, lower bound).
  double coulomb_friction_n = 0.0;         ///< Likewise.
  double position_quantum_m = 0.0;         ///< Encoder step: changes of a few steps are not motion.
  double stiffness_n_per_m = 0.0;          ///< Of the coupling: its stored energy is |F|²/(2K). 0: no limit().
  bool counts_world_work = false;  ///< give() is called: E is capped at the spring's stored energy plus a margin.
  double allowance_n_s_per_m =
      0.0;  ///< B of the allowance: a force against the motion may be larger by B·(v − noise_speed_m_s).
  double noise_speed_m_s = 0.0;  ///< Speed that encoder noise can feign.
};

/// @realtime Yes, all of it.
class Passivity {
 public:
  explicit Passivity(const PassivityConfig& config) noexcept : config_(config) {}

  /// A new position: counts the work of the force that acted since the last one.
  /// @param mean_force_n Mean force on the hand since the last call, in D. @param position_m p_DT now. @param elapsed_s
  /// Time since the last call.
  void observe(const Eigen::Vector3d& mean_force_n, const Eigen::Vector3d& position_m,
               double elapsed_s) noexcept RTBUS_NONBLOCKING;

  /// `force_n`, plus a damper α = −E/(T·v²) while E < 0. `acted`: the damper was added.
  [[nodiscard]] Eigen::Vector3d control(const Eigen::Vector3d& force_n, const Eigen::Vector3d& velocity_m_s,
                                        double dt_s, bool& acted) noexcept RTBUS_NONBLOCKING;

  /// Energy that the world has put into the coupling at the proxy; negative: taken out.
  void give(double energy_j) noexcept RTBUS_NONBLOCKING;

  /// Physics counts from zero again: what the world owed by the count before is void, which may have been damage.
  void forget_claim() noexcept RTBUS_NONBLOCKING { claim_j_ = 0.0; }

  /// A spring that holds `whole_n`, and that nobody has been seen to stretch, is allowed that in steps: what limit()
  /// lets through to a hand that does not move rises by at most `step_n`. @returns whether it is whole now.
  [[nodiscard]] bool grant_in_steps(double whole_n, double step_n) noexcept RTBUS_NONBLOCKING;

  /// `force_n`, limited to √(2K·E), which a spring can hold with the observed energy E: passive set-position modulation
  /// (D. Lee, K. Huang, "Passive-set-position-modulation framework for interactive robotic systems", IEEE Trans.
  /// Robotics 26(2), 2010) applied to the force, whatever moved the set-point. `acted`: the force was limited.
  /// @param stored_n Force of the coupling before a ramp scaled it: with counts_world_work, E is capped at the energy
  /// that it stores.
  [[nodiscard]] Eigen::Vector3d limit(const Eigen::Vector3d& force_n, double stored_n,
                                      const Eigen::Vector3d& velocity_m_s, bool& acted) noexcept RTBUS_NONBLOCKING;

  /// The coupling has another stiffness, energy cap and allowance now; what is observed stays.
  void set_coupling(double stiffness_n_per_m, double energy_cap_j,
                    double allowance_n_s_per_m) noexcept RTBUS_NONBLOCKING {
    config_.stiffness_n_per_m = stiffness_n_per_m;
    config_.energy_cap_j = energy_cap_j;
    config_.allowance_n_s_per_m = allowance_n_s_per_m;
  }

  /// Work of the hand on the device's force since start [J]; negative: the device returned more than it received.
  [[nodiscard]] double absorbed_j() const noexcept { return absorbed_j_; }
  /// Observed energy E [J]: absorbed energy plus the dissipation of the device's own friction, capped. E < 0: deficit.
  [[nodiscard]] double observed_j() const noexcept { return observed_j_; }
  /// Energy that the damper has been commanded to dissipate since start [J].
  [[nodiscard]] double dissipated_j() const noexcept { return dissipated_j_; }

 private:
  [[nodiscard]] double burnt(const Eigen::Vector3d& position_m, double elapsed_s) noexcept RTBUS_NONBLOCKING;

  PassivityConfig config_;
  bool primed_ = false;
  Eigen::Vector3d position_m_ = Eigen::Vector3d::Zero();  ///< At the last observe().
  Eigen::Vector3d anchor_m_ = Eigen::Vector3d::Zero();  ///< Start of the displacement over which friction is counted …
  double since_anchor_s_ = 0.0;                         ///< … and the time since then.
  double absorbed_j_ = 0.0;
  double observed_j_ = 0.0;
  double dissipated_j_ = 0.0;
  double claim_j_ = 0.0;  ///< Claim on the world: energy that it took before the hand supplied it.
};

}  // namespace haptic
