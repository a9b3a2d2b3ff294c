#pragma once
/// @file phantom_kinematics.hpp
/// Counters to pose, force to currents, and back, for the arms of phantom_models.hpp. Frame D unless said otherwise;
/// SI units. Angles: yaw a about the vertical; for a serial arm b of the upper arm from the vertical and c of the
/// forearm from straight down, both against the ground; for the five-bar b of the crank and c of the lever.
///
/// Serial arm: r = L_b sin b + L_c sin c, h = L_n + L_b cos b − L_c cos c. Five-bar: the coupler's end C lies where the
/// circles L4 around the crank's end B and L3 around the lever's end E meet, on the side away from the pen; the tip is
/// L5 from B on the far side of C, at the angle λ = ∠(B−C). In both, tip_M = (r cos a, r sin a, h) − origin.
///
/// Nothing here allocates, throws or keeps state; every function is realtime-safe. No argument gives a NaN.
#include <array>
#include <cstdint>

#include <Eigen/Core>

#include "drivers/device.hpp"
#include "drivers/phantom/phantom_models.hpp"
#include "rtbus/realtime.hpp"

namespace drivers::phantom {

using Counts = std::array<std::int32_t, 3>;
using JointAngles = Eigen::Vector3d;  ///< (a, b, c) [rad]

/// Where the arm is.
struct ArmPose {
  Eigen::Vector3d position_m = Eigen::Vector3d::Zero();  ///< p_DT.
  Eigen::Matrix3d jacobian_m = Eigen::Matrix3d::Zero();  ///< ∂p_DT/∂(a, b, c) [m/rad].
  double elevation_rad = 0.0;                            ///< λ of the last link above the horizontal.
};

class Kinematics {
 public:
  explicit Kinematics(const Model& model);

  /// Joint angles from counters: direction · 2π (count + home)/counts_per_turn · capstan/body.
  [[nodiscard]] JointAngles angles(const Counts& counts) const noexcept RTBUS_NONBLOCKING;

  /// The counters (not rounded) at these angles.
  [[nodiscard]] Eigen::Vector3d counts(const JointAngles& angles) const noexcept RTBUS_NONBLOCKING;

  /// Pose and analytic Jacobian. False when the linkage cannot have these angles (the five-bar does not close, or
  /// stands within 1e-6 of its dead centre), or when the tip would be behind the turntable's axis; `out` is unchanged.
  [[nodiscard]] bool forward(const JointAngles& angles, ArmPose& out) const noexcept RTBUS_NONBLOCKING;

  /// Closed-form inverse, in the assembly of the home pose. False when the point is out of reach.
  [[nodiscard]] bool inverse(const Eigen::Vector3d& position_m, JointAngles& out) const noexcept RTBUS_NONBLOCKING;

  /// Motor currents [mA] that hold joint torques [N·m]: 1000 τ direction · capstan/(body · K_t).
  [[nodiscard]] Eigen::Vector3d currents_ma(const Eigen::Vector3d& torques_n_m) const noexcept RTBUS_NONBLOCKING;

  /// Joint torques [N·m] of motor currents [mA].
  [[nodiscard]] Eigen::Vector3d torques_n_m(const Eigen::Vector3d& currents_ma) const noexcept RTBUS_NONBLOCKING;

  /// Joint torques that carry the arm's own weight, from V = m_b g l_b cos b + m_c g (L_b cos b − l_c cos c). Zero for
  /// a model without figures. The weight of a parallelogram's crank is not in it.
  [[nodiscard]] Eigen::Vector3d gravity_torques_n_m(const JointAngles& angles) const noexcept RTBUS_NONBLOCKING;

  /// q_DT from yaw, elevation and gimbal angles: R_M = Rz(a) Ry(−λ) X(g0) Ry(g1) Rx(g2), X = Rx for a magnetic gimbal
  /// and Rz for one with encoders, then relabelled to D, so that zero everywhere is the identity. The maker marks order
  /// and signs of the gimbal "to verify".
  [[nodiscard]] Quat orientation(double yaw_rad, double elevation_rad,
                                 const std::array<double, 3>& gimbal_rad) const noexcept RTBUS_NONBLOCKING;

  /// Gimbal angles of the sensors: 2π (count + home)/counts_per_turn, within ±π for finite input.
  [[nodiscard]] std::array<double, 3> gimbal_angles(const std::array<std::int32_t, 3>& counts) const noexcept
      RTBUS_NONBLOCKING;

  [[nodiscard]] const Model& model() const noexcept { return model_; }

 private:
  [[nodiscard]] bool serial(const JointAngles& q, ArmPose& out) const noexcept;
  [[nodiscard]] bool five_bar(const JointAngles& q, ArmPose& out) const noexcept;

  Model model_;
  Eigen::Vector3d angle_per_count_rad_;
};

/// The same rotation with the sign that is closer to `before`, so that a recorded quaternion never jumps.
[[nodiscard]] Quat continuous(const Quat& q, const Quat& before) noexcept RTBUS_NONBLOCKING;

}  // namespace drivers::phantom
