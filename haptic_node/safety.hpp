#pragma once
/// @file safety.hpp
/// The safety ladder: checks and limits that every force passes last, whatever the method. It cannot be switched off;
/// docs/safety.md explains each stage.
///
///   finite check → clamp to the device's limit → slew limit → start ramp → overspeed cut → E-stop and stale fade →
///   thermal budget → passivity → growth of what comes back → force of an order → clamp once more
///
/// The slew limit stands before passivity: one that slows a fall of the force generates energy. Growth alone is limited
/// behind it too. Less force takes no energy from anybody, and the observer counts what is sent.
#include <algorithm>
#include <cstdint>

#include <Eigen/Core>

#include "haptic_node/held_force.hpp"
#include "haptic_node/passivity.hpp"
#include "haptic_node/velocity.hpp"
#include "rtbus/realtime.hpp"

namespace haptic {

struct SafetyConfig {
  double max_force_n = 0.0;         ///< Peak norm [N], at most the device's.
  double continuous_force_n = 0.0;  ///< Thermal budget [N].
  double thermal_time_constant_s = 12.0;
  double slew_n_per_ms = 3.0;  ///< Growth and turning of the force; toward zero it may go 10 times faster.
  double stiffness_n_per_m =
      0.0;  ///< Of the coupling: the slew limit of a force against the motion is larger by 4·K·|v|.
  double damping_n_s_per_m = 0.0;  ///< Of the coupling.
  double period_s = 1e-3;          ///< Of the loop.
  double workspace_m = 0.0;        ///< Diagonal of the device's workspace.
  double start_ramp_s = 0.2;       ///< 0 → 1 after enable, an E-stop, and a device that was lost.
  double resume_ramp_s = 0.1;      ///< 0 → 1 after a loss, an overspeed cut or a clutch.
  double overspeed_m_s = 2.0;
  double stale_fade_s = 0.04;     ///< 1 → 0 once loss is declared.
  double force_timeout_s = 0.02;  ///< The device's own time-out: after so long without a write it applies zero.
  double allowance_least_n_s_per_m = 0.0, allowance_most_n_s_per_m = 0.0;  ///< Of allowance_n_s_per_m().
  PassivityConfig passivity;

  /// By how much more than the energy limit a force against the motion may be, per speed: the damper of the coupling,
  /// and what its spring grows by until the hand's work is counted. What the noise of the speed makes of it is felt
  /// where the energy limit holds the force back, so it is no more than that and what noise nobody feels.
  [[nodiscard]] double allowance_n_s_per_m() const noexcept {
    constexpr double kPeriodsUntilCounted = 2.0;
    return std::clamp(damping_n_s_per_m + kPeriodsUntilCounted * stiffness_n_per_m * period_s,
                      allowance_least_n_s_per_m, allowance_most_n_s_per_m);
  }

  /// A spring of this stiffness cannot hold more than this: at the force limit, or stretched across the workspace.
  [[nodiscard]] double energy_cap_j() const noexcept {
    return std::min(max_force_n * max_force_n / (2.0 * std::max(stiffness_n_per_m, 1e-9)),
                    0.5 * stiffness_n_per_m * workspace_m * workspace_m);
  }
};

/// Which stage acted; the bits of Telemetry::safety.
enum SafetyBit : std::uint32_t {
  kClamped = 1u << 0,
  kSlewLimited = 1u << 1,
  kRamping = 1u << 2,
  kOverspeed = 1u << 3,
  kThermalLimited = 1u << 4,
  kStale = 1u << 5,
  kPassivity = 1u << 6,
  kNonfinite = 1u << 7,
  kDeviceLost = 1u << 8,
  kDisabled = 1u << 9,
  kEstop = 1u << 10,
};

struct SafetyInput {
  Eigen::Vector3d force_n = Eigen::Vector3d::Zero();  ///< From the method, in D.
  /// By an order, besides. It is no spring: the energy stage, which watches the coupling, passes over it.
  Eigen::Vector3d extra_force_n = Eigen::Vector3d::Zero();
  Eigen::Vector3d position_m = Eigen::Vector3d::Zero();    ///< p_DT.
  Eigen::Vector3d velocity_m_s = Eigen::Vector3d::Zero();  ///< v_DT, estimated.
  double world_work_j = 0.0;  ///< Energy that the world has put into the coupling at the proxy, since the cycle before.
  double dt_s = 0.0;          ///< Period of the loop.
  std::uint64_t now_ns = 0;   ///< Of this cycle: when its force will act.
  std::uint64_t sample_time_ns = 0;  ///< When position_m was measured; unchanged: no new measurement.
  bool enabled = false;              ///< The user wants forces (and no clutch is pressed).
  bool estop = false;                ///< An E-stop holds.
  bool clutched = false;             ///< Not enabled by a clutch alone: the shorter ramp follows.
  bool link_alive = false;           ///< Physics is alive, or the method does not need it.
  bool device_ok = false;            ///< The sample of this cycle is good.
};

struct SafetyOutput {
  Eigen::Vector3d force_n = Eigen::Vector3d::Zero();        ///< For the device, in D …
  Eigen::Vector3d extra_force_n = Eigen::Vector3d::Zero();  ///< … of which by an order.
  std::uint32_t acted = 0;                                  ///< SafetyBit.
  double gate = 0.0;                                        ///< Ramp × fade × cut, 0…1.
};

/// A plausible position: finite, below one kilometre. Loop and ladder use the same test.
[[nodiscard]] bool sane_position(const Eigen::Vector3d& p_DT) noexcept RTBUS_NONBLOCKING;
/// Likewise a velocity (below 10⁶ m/s) and a force (below 10⁹ N): above, a method's sums would overflow.
[[nodiscard]] bool sane_velocity(const Eigen::Vector3d& v_DT) noexcept RTBUS_NONBLOCKING;
[[nodiscard]] bool sane_force(const Eigen::Vector3d& f_DT) noexcept RTBUS_NONBLOCKING;

/// One per loop. @realtime Yes: constant time, no allocation.
///
/// After a delay longer than the device's time-out the device is at zero force. The ladder then starts at gate 0, as
/// after a loss of the device.
class SafetyLadder {
 public:
  explicit SafetyLadder(const SafetyConfig& config) noexcept;

  [[nodiscard]] SafetyOutput apply(const SafetyInput& input) noexcept RTBUS_NONBLOCKING;

  /// The force of the last apply() did not reach the device: it applies zero, or will within its time-out. @realtime
  /// Yes.
  void not_sent() noexcept RTBUS_NONBLOCKING {
    sent_n_.setZero();
    extra_n_.setZero();
    held_.revoke();
  }

  /// Physics puts the proxy onto the hand and counts its work from zero. @realtime Yes.
  void world_begins_anew() noexcept RTBUS_NONBLOCKING { passivity_.forget_claim(); }

  /// The coupling has other gains now [N/m, N·s/m]. @realtime Yes.
  void set_gains(double stiffness_n_per_m, double damping_n_s_per_m) noexcept RTBUS_NONBLOCKING {
    config_.stiffness_n_per_m = stiffness_n_per_m;
    config_.damping_n_s_per_m = damping_n_s_per_m;
    passivity_.set_coupling(stiffness_n_per_m, config_.energy_cap_j(), config_.allowance_n_s_per_m());
  }

  [[nodiscard]] const Passivity& passivity() const noexcept { return passivity_; }
  /// Mean square force over the thermal time constant [N²].
  [[nodiscard]] double thermal_load_n2() const noexcept { return thermal_load_n2_; }

 private:
  [[nodiscard]] Eigen::Vector3d clamp(const Eigen::Vector3d& force_n, double limit_n, std::uint32_t bit,
                                      std::uint32_t& acted) const noexcept;
  [[nodiscard]] Eigen::Vector3d limit_slew(const Eigen::Vector3d& force_n, const SafetyInput& input,
                                           std::uint32_t& acted) noexcept;
  /// Behind the energy limit: no faster than the slew limit from the force that was sent last.
  [[nodiscard]] Eigen::Vector3d limit_growth(const Eigen::Vector3d& force_n, const SafetyInput& input,
                                             std::uint32_t& acted) const noexcept;
  /// Behind the damper: while a force comes back it grows by what the ramp and the motion ask for, and little more.
  [[nodiscard]] Eigen::Vector3d limit_return(const Eigen::Vector3d& force_n, const SafetyInput& input,
                                             std::uint32_t& acted) const noexcept;
  [[nodiscard]] Eigen::Vector3d follow_extra(const SafetyInput& input) noexcept;
  [[nodiscard]] double update_gate(const SafetyInput& input, double since_s, std::uint32_t& acted) noexcept;
  void watch_speed(const SafetyInput& input) noexcept;
  void book_energy(const SafetyInput& input) noexcept;
  void watch_rest(const Eigen::Vector3d& position_m, double dt_s) noexcept;
  /// @param force_n Before the gate.
  void fill_resting_spring(const SafetyInput& input, const Eigen::Vector3d& force_n) noexcept;
  void start_over() noexcept;
  [[nodiscard]] double thermal_limit_n() const noexcept;

  SafetyConfig config_;
  Passivity passivity_;
  VelocityEstimator speed_;           ///< A separate filter, so that no configured filter delays the cut.
  bool ever_open_ = false;            ///< The start ramp has been completed once.
  std::uint64_t last_cycle_ns_ = 0;   ///< 0: none yet.
  std::uint64_t last_sample_ns_ = 0;  ///< 0: none yet.
  HeldForce held_;                    ///< The recent forces on the hand.
  Eigen::Vector3d slewed_n_ = Eigen::Vector3d::Zero();  ///< Force after the slew limit, before the gate.
  Eigen::Vector3d sent_n_ = Eigen::Vector3d::Zero();    ///< Force sent in the last cycle, without that of an order.
  Eigen::Vector3d extra_n_ = Eigen::Vector3d::Zero();   ///< Of an order, before the gate.
  double gate_ = 0.0;
  bool fading_ = false;
  double fade_from_n_ = 0.0;  ///< Norm of the ungated force when the fade began.
  bool overspeed_ = false;
  bool ran_away_ = false;        ///< The present ramp follows an overspeed cut.
  bool filling_ = false;         ///< A stretched spring that a ramp has found is not yet full.
  double gate_step_ = 0.0;       ///< By how much the gate opened in this cycle.
  bool opened_ = false;          ///< The gate has been open once: what comes is a return.
  double returned_s_ = 1e9;      ///< Time since the last ramp of a return; none yet: long ago.
  bool short_ = false;           ///< A pause or a loss has cost the observer energy, and no hand has rested since.
  double filled_n_ = 0.0;        ///< So far the spring of a resting hand has been filled.
  std::uint64_t slewed_ns_ = 0;  ///< Time of the sample that the slew limit saw last.
  bool catches_up_ = false;      ///< A sample came late: the force grows slowly until it is where it should be.
  Eigen::Vector3d rest_m_ = Eigen::Vector3d::Zero();  ///< Where the hand rests, if it does …
  double rested_s_ = 0.0;                             ///< … and for how long.
  double slow_s_ = 0.0;                               ///< How long the tip has been slow since the cut.
  double thermal_load_n2_ = 0.0;
};

}  // namespace haptic
