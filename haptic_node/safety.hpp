#pragma once
/// @file safety.hpp
/// The ladder that every force climbs last, whatever the force law said. It cannot be configured away; docs/safety.md
/// explains each rung.
///
///   finite check → clamp to the device's limit → slew limit → start ramp → overspeed cut → thermal budget →
///   stale fade → passivity → clamp once more
///
/// Slew limiting stands before passivity: a slew limit after it would change the force that the ledger has accounted
/// for, and pump energy.
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
  double slew_n_per_ms = 3.0;      ///< Growth and turning of the force; toward zero it may go 10 times faster.
  double stiffness_n_per_m = 0.0;  ///< Of the coupling: a force against the motion may grow by 4·K·|v| besides.
  double start_ramp_s = 0.2;       ///< 0 → 1 after enable.
  double resume_ramp_s = 0.1;      ///< 0 → 1 after a loss, an overspeed cut or a clutch.
  double overspeed_m_s = 2.0;
  double stale_fade_s = 0.04;     ///< 1 → 0 once loss is declared.
  double force_timeout_s = 0.02;  ///< The device's own: after so long without a cycle it has gone to zero by itself.
  PassivityConfig passivity;
};

/// Which rung acted; the bits of Telemetry::safety.
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
};

struct SafetyInput {
  Eigen::Vector3d force_n = Eigen::Vector3d::Zero();       ///< From the force law, in D.
  Eigen::Vector3d position_m = Eigen::Vector3d::Zero();    ///< p_DT.
  Eigen::Vector3d velocity_m_s = Eigen::Vector3d::Zero();  ///< v_DT, estimated.
  double world_work_j = 0.0;         ///< What the world has put into the coupling at the proxy, since the cycle before.
  double dt_s = 0.0;                 ///< Period of the loop.
  std::uint64_t now_ns = 0;          ///< Of this cycle: when its force will act.
  std::uint64_t sample_time_ns = 0;  ///< When position_m was measured; the same as before: nothing new.
  bool enabled = false;              ///< The user wants forces (and no clutch is pressed).
  bool link_alive = false;           ///< Physics answers, or the force law does not need it.
  bool device_ok = false;            ///< The sample of this cycle is good.
};

struct SafetyOutput {
  Eigen::Vector3d force_n = Eigen::Vector3d::Zero();  ///< For the device, in D.
  std::uint32_t acted = 0;                            ///< SafetyBit.
  double gate = 0.0;                                  ///< Ramp × fade × cut, 0…1.
};

/// A position that can be meant: finite, and nearer than a kilometre. Loop and ladder judge by the same.
[[nodiscard]] bool sane_position(const Eigen::Vector3d& p_DT) noexcept RTBUS_NONBLOCKING;
/// Likewise a velocity (below 10⁶ m/s) and a force (below 10⁹ N): with more a law's own sums would overflow.
[[nodiscard]] bool sane_velocity(const Eigen::Vector3d& v_DT) noexcept RTBUS_NONBLOCKING;
[[nodiscard]] bool sane_force(const Eigen::Vector3d& f_DT) noexcept RTBUS_NONBLOCKING;

/// One per loop. @realtime Yes: constant time, no allocation.
///
/// A loop that was held up for longer than the device's time-out finds a device at zero: it starts again at gate 0, as
/// after the loss of the device.
class SafetyLadder {
 public:
  explicit SafetyLadder(const SafetyConfig& config) noexcept;

  [[nodiscard]] SafetyOutput apply(const SafetyInput& input) noexcept RTBUS_NONBLOCKING;

  /// The force of the last apply() did not reach the device: it holds zero or will soon. @realtime Yes.
  void not_sent() noexcept RTBUS_NONBLOCKING {
    sent_n_.setZero();
    held_.revoke();
  }

  [[nodiscard]] const Passivity& passivity() const noexcept { return passivity_; }
  /// Mean square force over the thermal time constant [N²].
  [[nodiscard]] double thermal_load_n2() const noexcept { return thermal_load_n2_; }

 private:
  [[nodiscard]] Eigen::Vector3d clamp(const Eigen::Vector3d& force_n, double limit_n, std::uint32_t bit,
                                      std::uint32_t& acted) const noexcept;
  [[nodiscard]] Eigen::Vector3d limit_slew(const Eigen::Vector3d& force_n, const SafetyInput& input,
                                           std::uint32_t& acted) noexcept;
  [[nodiscard]] double update_gate(const SafetyInput& input, std::uint32_t& acted) noexcept;
  void watch_speed(const SafetyInput& input) noexcept;
  void book_energy(const SafetyInput& input) noexcept;
  void start_over() noexcept;
  [[nodiscard]] double thermal_limit_n() const noexcept;

  SafetyConfig config_;
  Passivity passivity_;
  VelocityEstimator speed_;                             ///< Of its own, so that no filter setting blinds the cut.
  bool ever_open_ = false;                              ///< The start ramp has been completed once.
  std::uint64_t last_cycle_ns_ = 0;                     ///< 0: none yet.
  std::uint64_t last_sample_ns_ = 0;                    ///< 0: none yet.
  HeldForce held_;                                      ///< What acted on the hand of late.
  Eigen::Vector3d slewed_n_ = Eigen::Vector3d::Zero();  ///< Force after the slew limit, before the gate.
  Eigen::Vector3d sent_n_ = Eigen::Vector3d::Zero();    ///< What left in the last cycle.
  double gate_ = 0.0;
  bool fading_ = false;
  double fade_from_n_ = 0.0;  ///< Norm of the ungated force when the fade began.
  bool overspeed_ = false;
  double slow_s_ = 0.0;  ///< How long the tip has been slow since the cut.
  double thermal_load_n2_ = 0.0;
};

}  // namespace haptic
