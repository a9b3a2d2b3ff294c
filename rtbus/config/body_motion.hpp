#pragma once
/// @file body_motion.hpp
/// How a kinematic body moves: by the clock of the simulation, or by orders, whatever pushes against it. Every motion
/// starts from rest at the body's pose.
#include <string_view>
#include <variant>
#include <vector>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "rtbus/config/document.hpp"

namespace rtbus::config {

/// There and back without end: p(t) = p_WB + travel·(1 − cos 2πf·t)/2, from start_s on.
struct SinusoidMotion {
  Eigen::Vector3d travel_m = Eigen::Vector3d::Zero();  ///< In W, from position_m to the far end.
  double frequency_hz = 1.0;
  double start_s = 0.0;
};

/// From point to point, at rest in each of them; between two a smooth step 3s² − 2s³, whose peak speed is 1.5 times the
/// mean.
struct WaypointMotion {
  std::vector<double> times_s;               ///< Growing; before the first the body is at position_m.
  std::vector<Eigen::Vector3d> positions_m;  ///< In W. The way from position_m begins at time 0.
  bool repeat = false;                       ///< After the last point time begins anew.
};

/// Turns about an axis through the body's origin; the speed grows evenly over ramp_s.
struct SpinMotion {
  Eigen::Vector3d axis = Eigen::Vector3d::UnitY();  ///< Unit, in W.
  double rate_rad_s = 0.0;
  double ramp_s = 0.5;
  double start_s = 0.0;
};

/// Where orders send it (docs/orders.md); without one it stays where it is.
struct TargetMotion {
  double max_speed_m_s = 0.1, max_rate_rad_s = 1.0;
  double reach_m = 0.1;  ///< Farthest from position_m.
};

using BodyMotion = std::variant<SinusoidMotion, WaypointMotion, SpinMotion, TargetMotion>;

/// A pose X_WB.
struct PlacedAt {
  Eigen::Vector3d p_WB = Eigen::Vector3d::Zero();
  Eigen::Quaterniond q_WB = Eigen::Quaterniond::Identity();
};
/// Where a body is that started at (p, q); of a TargetMotion, where it waits for orders.
[[nodiscard]] PlacedAt pose_at(const BodyMotion& motion, const Eigen::Vector3d& p_WB, const Eigen::Quaterniond& q_WB,
                               double t_s);

/// One step of `step_s` from `now` toward `target`, within the speeds and the reach around `home_m`.
[[nodiscard]] PlacedAt step_toward(const TargetMotion& motion, const Eigen::Vector3d& home_m, const PlacedAt& now,
                                   const PlacedAt& target, double step_s);

/// Faster surfaces are a slip of units: no hand could follow.
inline constexpr double kMaxBodySpeed_m_s = 5.0;

/// Reads `motion: {sinusoid: {…}}` of a body. Throws Error.
[[nodiscard]] BodyMotion read_body_motion(Map& body, const Eigen::Vector3d& p_WB);

}  // namespace rtbus::config
