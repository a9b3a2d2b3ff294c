#pragma once
/// @file safety.hpp
/// The ladder that every force climbs last, whatever the force law said. It cannot be configured away; docs/safety.md
/// explains each rung.
///
///   finite check → clamp to the device's limit → slew limit → start ramp → overspeed cut → thermal budget →
///   stale fade → passivity → clamp once more
///
/// Slew limiting stands before passivity: a slew limit after it would change the force that the ledger has accounted for,
/// and pump energy.
#include <cstdint>

#include <Eigen/Core>

#include "haptic_node/passivity.hpp"
#include "rtbus/realtime.hpp"

namespace haptic {

struct SafetyConfig {
  double max_force_n = 0.0;         ///< Peak norm [N], at most the device's.
  double continuous_force_n = 0.0;  ///< Thermal budget [N].
  double thermal_time_constant_s = 12.0;
  double slew_n_per_ms = 3.0;       ///< Growth of the force; toward zero and against the motion it may change 10 times faster.
  double start_ramp_s = 0.2;        ///< 0 → 1 after enable.
  double resume_ramp_s = 0.1;       ///< 0 → 1 after a loss, an overspeed cut or a clutch.
  double overspeed_m_s = 2.0;
  double stale_fade_s = 0.04;       ///< 1 → 0 once loss is declared.
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
  double dt_s = 0.0;        ///< Period of the loop.
  double elapsed_s = 0.0;   ///< Real time since the device sample of the last cycle.
  bool enabled = false;     ///< The user wants forces (and no clutch is pressed).
  bool link_alive = false;  ///< Physics answers, or the force law does not need it.
  bool device_ok = false;   ///< The sample of this cycle is good.
};

struct SafetyOutput {
  Eigen::Vector3d force_n = Eigen::Vector3d::Zero();  ///< For the device, in D.
  std::uint32_t acted = 0;                            ///< SafetyBit.
  double gate = 0.0;                                  ///< Ramp × fade × cut, 0…1.
};

/// One per loop. @realtime Yes: constant time, no allocation.
class SafetyLadder {
 public:
  explicit SafetyLadder(const SafetyConfig& config) noexcept;

  [[nodiscard]] SafetyOutput apply(const SafetyInput& input) noexcept RTBUS_NONBLOCKING;

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
  [[nodiscard]] double thermal_limit_n() const noexcept;

  SafetyConfig config_;
  Passivity passivity_;
  bool primed_ = false;                                           ///< A good sample has been seen.
  bool ever_open_ = false;                                        ///< The start ramp has been completed once.
  Eigen::Vector3d last_position_m_ = Eigen::Vector3d::Zero();
  Eigen::Vector3d slewed_n_ = Eigen::Vector3d::Zero();            ///< Force after the slew limit, before the gate.
  Eigen::Vector3d sent_n_ = Eigen::Vector3d::Zero();              ///< What left in the last cycle.
  double gate_ = 0.0;
  bool overspeed_ = false;
  double slow_s_ = 0.0;                                           ///< How long the tip has been slow since the cut.
  double thermal_load_n2_ = 0.0;
};

}  // namespace haptic
