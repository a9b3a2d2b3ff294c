#include "drivers/phantom/phantom_kinematics.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "rtbus/eigen.hpp"

namespace drivers::phantom {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr double kGravityMS2 = 9.81;
constexpr double kDeadCentre = 1e-6;  // sine of the angle between rod and coupler

Vector3d to_device(const Vector3d& m) { return {m.y(), m.z(), m.x()}; }
Vector3d to_maker(const Vector3d& d) { return {d.z(), d.x(), d.y()}; }

Vector2d direction(double angle_rad) { return {std::cos(angle_rad), std::sin(angle_rad)}; }
Vector2d turned(const Vector2d& v) { return {-v.y(), v.x()}; }  // by +90°
double angle_of(const Vector2d& v) { return std::atan2(v.y(), v.x()); }

// The angle opposite to `c` in the triangle a, b, c; false when there is no such triangle.
bool triangle_angle(double a, double b, double c, double& out) {
  const double cosine = (a * a + b * b - c * c) / (2.0 * a * b);
  if (!(std::abs(cosine) <= 1.0)) return false;
  out = std::acos(cosine);
  return true;
}

// Pose from radius, height and how they change with b and c, in M; then to D.
void place(double yaw_rad, double radius_m, double height_m, const Vector2d& by_b, const Vector2d& by_c,
           const std::array<double, 3>& origin_m, ArmPose& out) {
  const double s = std::sin(yaw_rad);
  const double c = std::cos(yaw_rad);
  out.position_m = to_device({radius_m * c - origin_m[0], radius_m * s - origin_m[1], height_m - origin_m[2]});
  out.jacobian_m.col(0) = to_device({-radius_m * s, radius_m * c, 0.0});
  out.jacobian_m.col(1) = to_device({by_b.x() * c, by_b.x() * s, by_b.y()});
  out.jacobian_m.col(2) = to_device({by_c.x() * c, by_c.x() * s, by_c.y()});
}

Quat product(const Quat& a, const Quat& b) {
  return {a[0] * b[0] - a[1] * b[1] - a[2] * b[2] - a[3] * b[3], a[0] * b[1] + a[1] * b[0] + a[2] * b[3] - a[3] * b[2],
          a[0] * b[2] - a[1] * b[3] + a[2] * b[0] + a[3] * b[1], a[0] * b[3] + a[1] * b[2] - a[2] * b[1] + a[3] * b[0]};
}

// Rotation about axis 0, 1 or 2.
Quat about(std::size_t axis, double angle_rad) {
  Quat q{std::cos(angle_rad / 2.0), 0.0, 0.0, 0.0};
  q[axis + 1] = std::sin(angle_rad / 2.0);
  return q;
}

}  // namespace

Kinematics::Kinematics(const Model& model) : model_(model) {
  for (int i = 0; i < 3; ++i) {
    const auto k = static_cast<std::size_t>(i);
    angle_per_count_rad_[i] =
        model.direction[k] * 2.0 * std::numbers::pi / model.counts_per_turn * model.capstan_m[k] / model.body_m[k];
  }
}

JointAngles Kinematics::angles(const Counts& counts) const noexcept RTBUS_NONBLOCKING {
  JointAngles q;
  for (std::size_t i = 0; i < 3; ++i) {
    // In double: the sum of two 32-bit counts may not fit into one.
    const double count = static_cast<double>(counts[i]) + static_cast<double>(model_.home_counts[i]);
    q[static_cast<int>(i)] = angle_per_count_rad_[static_cast<int>(i)] * count;
  }
  return q;
}

Vector3d Kinematics::counts(const JointAngles& angles) const noexcept RTBUS_NONBLOCKING {
  Vector3d out = angles.cwiseQuotient(angle_per_count_rad_);
  for (std::size_t i = 0; i < 3; ++i) out[static_cast<int>(i)] -= static_cast<double>(model_.home_counts[i]);
  return out;
}

bool Kinematics::forward(const JointAngles& angles, ArmPose& out) const noexcept RTBUS_NONBLOCKING {
  return model_.five_bar ? five_bar(angles, out) : serial(angles, out);
}

bool Kinematics::serial(const JointAngles& q, ArmPose& out) const noexcept {
  const SerialArm& arm = model_.arm;
  const double radius_m = arm.upper_arm_m * std::sin(q[1]) + arm.forearm_m * std::sin(q[2]);
  const double height_m = arm.column_m + arm.upper_arm_m * std::cos(q[1]) - arm.forearm_m * std::cos(q[2]);
  if (!(radius_m > 0.0)) return false;
  place(q[0], radius_m, height_m, {arm.upper_arm_m * std::cos(q[1]), -arm.upper_arm_m * std::sin(q[1])},
        {arm.forearm_m * std::cos(q[2]), arm.forearm_m * std::sin(q[2])}, model_.origin_m, out);
  out.elevation_rad = q[2] - std::numbers::pi / 2.0;  // c counts from straight down
  return true;
}

bool Kinematics::five_bar(const JointAngles& q, ArmPose& out) const noexcept {
  const FiveBar& l = model_.linkage;
  const Vector2d crank = l.crank_m * direction(q[1]);
  const Vector2d lever = l.lever_m * direction(q[2]);
  const Vector2d b = Vector2d(l.pivots_m / 2.0, 0.0) + crank;
  const Vector2d e = Vector2d(-l.pivots_m / 2.0, 0.0) + lever;
  const Vector2d across = e - b;
  const double distance_m = across.norm();
  double at_b_rad = 0.0;
  if (!(distance_m > 0.0) || !triangle_angle(l.coupler_m, distance_m, l.rod_m, at_b_rad)) return false;
  const double elevation_rad = angle_of(across) - at_b_rad - std::numbers::pi;
  const Vector2d u = direction(elevation_rad);
  const Vector2d rod = b - l.coupler_m * u - e;  // from E to C

  // Closure |C − E|² = L3²: rod·(dB − L4 u' dλ − dE) = 0.
  const Vector2d du = turned(u);
  const double lever_arm_m = l.coupler_m * rod.dot(du);
  if (std::abs(lever_arm_m) < kDeadCentre * l.coupler_m * l.rod_m) return false;
  const Vector2d db = turned(crank);  // per rad of b
  const Vector2d de = turned(lever);  // per rad of c
  const double dlambda_b = rod.dot(db) / lever_arm_m;
  const double dlambda_c = -rod.dot(de) / lever_arm_m;

  const Vector2d tip = b + l.pen_m * u;
  if (!(tip.x() > 0.0)) return false;
  place(q[0], tip.x(), tip.y(), db + l.pen_m * dlambda_b * du, l.pen_m * dlambda_c * du, model_.origin_m, out);
  out.elevation_rad = std::remainder(elevation_rad, 2.0 * std::numbers::pi);
  return true;
}

bool Kinematics::inverse(const Vector3d& position_m, JointAngles& out) const noexcept RTBUS_NONBLOCKING {
  const Vector3d tip = to_maker(position_m) + rtbus::vector_of(model_.origin_m);
  const double radius_m = std::hypot(tip.x(), tip.y());
  if (!(radius_m > 0.0)) return false;
  JointAngles q;
  q[0] = std::atan2(tip.y(), tip.x());
  if (!model_.five_bar) {
    const SerialArm& arm = model_.arm;
    const double height_m = tip.z() - arm.column_m;
    const double reach_m = std::hypot(radius_m, height_m);
    double shoulder_rad = 0.0;
    if (!triangle_angle(arm.upper_arm_m, reach_m, arm.forearm_m, shoulder_rad)) return false;
    q[1] = std::atan2(radius_m, height_m) - shoulder_rad;
    q[2] = std::atan2(radius_m - arm.upper_arm_m * std::sin(q[1]), arm.upper_arm_m * std::cos(q[1]) - height_m);
    out = q;
    return true;
  }
  // Crank and pen reach the tip like two links; then rod and lever reach the coupler's end.
  const FiveBar& l = model_.linkage;
  const Vector2d in_plane(radius_m, tip.z());
  const Vector2d from_crank = in_plane - Vector2d(l.pivots_m / 2.0, 0.0);
  double at_crank_rad = 0.0;
  if (!triangle_angle(l.crank_m, from_crank.norm(), l.pen_m, at_crank_rad)) return false;
  q[1] = angle_of(from_crank) + at_crank_rad;
  const Vector2d b = Vector2d(l.pivots_m / 2.0, 0.0) + l.crank_m * direction(q[1]);
  const Vector2d c = b - l.coupler_m * (in_plane - b) / l.pen_m;
  const Vector2d from_lever = c - Vector2d(-l.pivots_m / 2.0, 0.0);
  double at_lever_rad = 0.0;
  if (!triangle_angle(l.lever_m, from_lever.norm(), l.rod_m, at_lever_rad)) return false;
  q[2] = angle_of(from_lever) + at_lever_rad;
  if (q[2] < 0.0) q[2] += 2.0 * std::numbers::pi;  // the counters run through π: home is at 4.16 rad
  ArmPose check;                                   // the rod's other side is another assembly
  if (!five_bar(q, check) || (check.position_m - position_m).norm() > 1e-6) return false;
  out = q;
  return true;
}

Vector3d Kinematics::currents_ma(const Vector3d& torques_n_m) const noexcept RTBUS_NONBLOCKING {
  Vector3d out;
  for (std::size_t i = 0; i < 3; ++i) {
    const int k = static_cast<int>(i);
    out[k] = 1e3 * torques_n_m[k] * model_.direction[i] * model_.capstan_m[i] / model_.body_m[i] /
             model_.torque_constant_n_m_per_a[i];
  }
  return out;
}

Vector3d Kinematics::torques_n_m(const Vector3d& currents_ma) const noexcept RTBUS_NONBLOCKING {
  Vector3d out;
  for (std::size_t i = 0; i < 3; ++i) {
    const int k = static_cast<int>(i);
    out[k] = 1e-3 * currents_ma[k] * model_.direction[i] * model_.body_m[i] / model_.capstan_m[i] *
             model_.torque_constant_n_m_per_a[i];
  }
  return out;
}

Vector3d Kinematics::gravity_torques_n_m(const JointAngles& q) const noexcept RTBUS_NONBLOCKING {
  const ArmWeight& w = model_.weight;
  return {
      0.0,
      -kGravityMS2 * (w.upper_arm_kg * w.upper_arm_centre_m + w.forearm_kg * model_.arm.upper_arm_m) * std::sin(q[1]),
      kGravityMS2 * w.forearm_kg * w.forearm_centre_m * std::sin(q[2])};
}

Quat Kinematics::orientation(double yaw_rad, double elevation_rad,
                             const std::array<double, 3>& gimbal_rad) const noexcept RTBUS_NONBLOCKING {
  const std::size_t first_axis = model_.gimbal == GimbalKind::kEncoder ? 2 : 0;
  Quat q = product(about(2, yaw_rad), about(1, -elevation_rad));
  q = product(q, about(first_axis, gimbal_rad[0]));
  q = product(q, about(1, gimbal_rad[1]));
  q = product(q, about(0, gimbal_rad[2]));
  const double norm = std::sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
  return {q[0] / norm, q[2] / norm, q[3] / norm, q[1] / norm};  // axes relabelled as the positions are
}

std::array<double, 3> Kinematics::gimbal_angles(const std::array<std::int32_t, 3>& counts) const noexcept
    RTBUS_NONBLOCKING {
  std::array<double, 3> out{};
  if (model_.gimbal_counts_per_turn == 0) return out;
  for (std::size_t i = 0; i < 3; ++i) {
    const double turns = (static_cast<double>(counts[i]) + static_cast<double>(model_.gimbal_home_counts[i])) /
                         model_.gimbal_counts_per_turn;
    out[i] = std::remainder(turns, 1.0) * 2.0 * std::numbers::pi;
  }
  return out;
}

Quat continuous(const Quat& q, const Quat& before) noexcept RTBUS_NONBLOCKING {
  const double alike = q[0] * before[0] + q[1] * before[1] + q[2] * before[2] + q[3] * before[3];
  return alike < 0.0 ? Quat{-q[0], -q[1], -q[2], -q[3]} : q;
}

}  // namespace drivers::phantom
