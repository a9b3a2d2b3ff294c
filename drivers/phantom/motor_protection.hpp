#pragma once
/// @file motor_protection.hpp
/// Protects the motors from heat. The firmware passes up to 6 A, five times the continuous current of an RE25 (1.24 A),
/// and measures no temperature. So the host computes the heat (I²t).
///
/// Each motor has x, the square of its current behind a first-order lag of the winding's time constant: the winding's
/// rise over its housing. Up to 80 % of continuous² the peak is free; from there to 100 % the largest allowed current
/// falls from peak to continuous, so that x never passes continuous². With the housing at the temperature that belongs
/// to the continuous current the winding then stays within its limit (tests/unit/phantom/motor_protection_test.cpp
/// does the sum with the RE25's thermal resistances).
#include <array>

#include <Eigen/Core>

#include "rtbus/realtime.hpp"

namespace drivers::phantom {

struct MotorLimits {
  double peak_ma = 5999.0;        ///< One below the firmware's 6000, which it turns into no current at all above.
  double continuous_ma = 1240.0;  ///< Maxon RE25 118743.
  double time_constant_s = 12.0;  ///< Of its winding.
};

class MotorProtection {
 public:
  explicit MotorProtection(const MotorLimits& limits) : limits_(limits) {}

  /// The currents that may flow [mA]: `base` (the arm's own weight) plus the largest share 0…1 of `force` that all
  /// three motors allow, so that the force keeps its direction. Where the base alone is too much, all of it is scaled
  /// down and no force is given. `limited` says whether anything was cut. Non-finite input gives zero. @realtime Yes.
  [[nodiscard]] Eigen::Vector3d limit(const Eigen::Vector3d& base_ma, const Eigen::Vector3d& force_ma,
                                      bool& limited) const noexcept RTBUS_NONBLOCKING;

  /// `currents_ma` flowed for `dt_s`. @realtime Yes.
  void flowed(const Eigen::Vector3d& currents_ma, double dt_s) noexcept RTBUS_NONBLOCKING;

  /// Largest current that motor `i` may have now [mA].
  [[nodiscard]] double allowed_ma(int i) const noexcept RTBUS_NONBLOCKING;

  /// x/continuous² of the hottest motor, 0…1.
  [[nodiscard]] double load() const noexcept RTBUS_NONBLOCKING;

  [[nodiscard]] const MotorLimits& limits() const noexcept { return limits_; }

 private:
  MotorLimits limits_;
  Eigen::Vector3d heat_ma2_ = Eigen::Vector3d::Zero();
};

}  // namespace drivers::phantom
