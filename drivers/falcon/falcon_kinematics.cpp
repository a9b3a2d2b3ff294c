#include "drivers/falcon/falcon_kinematics.hpp"

#include <Eigen/Geometry>
#include <Eigen/LU>

#include <cmath>
#include <numbers>

namespace drivers::falcon {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

constexpr double kDegree = std::numbers::pi / 180.0;
constexpr double kCountsPerTurn = 1280.0;  // 320 slots, four edges each
constexpr std::array<double, 3> kLegAngle{105.0 * kDegree, -15.0 * kDegree, -135.0 * kDegree};

// Millimetres in the sources.
constexpr std::array kGeometries{
    // libnifalcon, FalconGeometry.h: the values that most programs use.
    Geometry{"libnifalcon", 0.060, 0.1025, 0.01443, 2 * 0.01125, 0.0400, -0.00191, 110.0 / 14.25, 35.0 * kDegree},
    // Martin and Hillier, ACRA 2009, as quoted by others; θ0 is disputed there (35°, 40°, 50°).
    Geometry{"martin_hillier", 0.060, 0.1025, 0.0157, 2 * 0.0115, 0.0366, 0.0010, 7.62, 35.0 * kDegree},
};

}  // namespace

double Geometry::rad_per_count() const noexcept { return 2.0 * std::numbers::pi / kCountsPerTurn / drive_ratio; }

std::span<const Geometry> geometries() noexcept { return kGeometries; }

Kinematics::Kinematics(const Geometry& geometry) noexcept : geometry_(geometry) {
  for (std::size_t leg = 0; leg < 3; ++leg) {
    cos_phi_[leg] = std::cos(kLegAngle[leg]);
    sin_phi_[leg] = std::sin(kLegAngle[leg]);
  }
}

Vector3d Kinematics::angles_rad(const Counts& counts) const noexcept {
  const Vector3d n(counts[0], counts[1], counts[2]);
  return Vector3d::Constant(geometry_.zero_angle_rad) + geometry_.rad_per_count() * n;
}

Vector3d Kinematics::counts(const Vector3d& angles_rad) const noexcept {
  return (angles_rad - Vector3d::Constant(geometry_.zero_angle_rad)) / geometry_.rad_per_count();
}

// In the leg's own frame: U radial from the hip axis, V sideways, W along z. The shin spans D + sqrt(b² − V²) in the
// plane of the thigh.
Kinematics::Closure Kinematics::closure(std::size_t leg, const Vector3d& position_m, double cos_theta,
                                        double sin_theta) const noexcept {
  const Geometry& k = geometry_;
  const double c = cos_phi_[leg];
  const double s = sin_phi_[leg];
  const double u = c * position_m.x() + s * position_m.y() - k.base_m + k.platform_m;
  const double v = -s * position_m.x() + c * position_m.y() + k.lateral_m;
  const double du = u - k.thigh_m * cos_theta;
  const double dw = position_m.z() - k.thigh_m * sin_theta;
  const double q_squared = k.shin_m * k.shin_m - v * v;
  Closure out;
  out.gradient.setZero();
  if (!(q_squared > 0.0)) return out;
  const double q = std::sqrt(q_squared);
  const double span = k.joint_offsets_m + q;
  const double gu = 2.0 * du;
  const double gv = 2.0 * span * v / q;
  out.g = du * du + dw * dw - span * span;
  out.gradient = {c * gu - s * gv, s * gu + c * gv, 2.0 * dw};
  out.by_angle = 2.0 * k.thigh_m * (du * sin_theta - dw * cos_theta);
  out.reachable = true;
  return out;
}

// Were the shins rigid rods of length D + b, the grip would lie on three spheres around the knees.
std::optional<Vector3d> Kinematics::three_spheres(const Vector3d& cos_theta, const Vector3d& sin_theta) const noexcept {
  const Geometry& k = geometry_;
  const double radius_m = k.joint_offsets_m + k.shin_m;
  std::array<Vector3d, 3> centre;
  for (int leg = 0; leg < 3; ++leg) {
    const double reach = k.thigh_m * cos_theta[leg] + k.base_m - k.platform_m;
    const auto i = static_cast<std::size_t>(leg);
    // V = 0 includes the lateral offset.
    centre[i] = {cos_phi_[i] * reach + sin_phi_[i] * k.lateral_m, sin_phi_[i] * reach - cos_phi_[i] * k.lateral_m,
                 k.thigh_m * sin_theta[leg]};
  }
  const Vector3d ab = centre[1] - centre[0];
  const Vector3d ac = centre[2] - centre[0];
  const Vector3d normal = ab.cross(ac);
  const double normal_squared = normal.squaredNorm();
  constexpr double kSmallestTriangle = 1e-10;  // m⁴: below, the knees are in a line
  if (!(normal_squared > kSmallestTriangle)) return std::nullopt;
  // Centre of the circle through the knees; the grip stands above it along the normal.
  const Vector3d to_centre =
      (ab.squaredNorm() * ac.cross(normal) + ac.squaredNorm() * normal.cross(ab)) / (2.0 * normal_squared);
  const double height_squared = radius_m * radius_m - to_centre.squaredNorm();
  if (!(height_squared > 0.0)) return std::nullopt;
  Vector3d up = normal / std::sqrt(normal_squared);
  if (up.z() < 0.0) up = -up;
  return centre[0] + to_centre + std::sqrt(height_squared) * up;
}

std::optional<Vector3d> Kinematics::position_m(const Vector3d& angles_rad) const noexcept {
  if (!angles_rad.allFinite()) return std::nullopt;
  // No thigh turns so far; and beyond, the equations have solutions with a leg folded through the base.
  constexpr double kLowest = -90.0 * kDegree;
  constexpr double kHighest = 130.0 * kDegree;
  if ((angles_rad.array() < kLowest).any() || (angles_rad.array() > kHighest).any()) return std::nullopt;
  const Vector3d cos_theta = angles_rad.array().cos();
  const Vector3d sin_theta = angles_rad.array().sin();
  std::optional<Vector3d> x = three_spheres(cos_theta, sin_theta);
  if (!x) return std::nullopt;

  constexpr int kMaxSteps = 12;
  constexpr double kSmallestStepM = 1e-12;
  constexpr double kLargestStepM = 0.05;
  for (int step = 0; step < kMaxSteps; ++step) {
    Vector3d g;
    Matrix3d gradient;
    for (int leg = 0; leg < 3; ++leg) {
      const Closure closed = closure(static_cast<std::size_t>(leg), *x, cos_theta[leg], sin_theta[leg]);
      if (!closed.reachable) return std::nullopt;
      g[leg] = closed.g;
      gradient.row(leg) = closed.gradient.transpose();
    }
    Matrix3d inverse;
    bool invertible = false;
    gradient.computeInverseWithCheck(inverse, invertible, 1e-9);  // m³; about 1e-3 in the workspace
    if (!invertible) return std::nullopt;
    const Vector3d move = inverse * g;
    const double size_m = move.norm();
    if (!(size_m < kLargestStepM)) return std::nullopt;
    *x -= move;
    if (size_m < kSmallestStepM) return x;
  }
  return std::nullopt;
}

std::optional<Vector3d> Kinematics::inverse_rad(const Vector3d& position_m) const noexcept {
  if (!position_m.allFinite()) return std::nullopt;
  const Geometry& k = geometry_;
  Vector3d out;
  for (int leg = 0; leg < 3; ++leg) {
    const auto i = static_cast<std::size_t>(leg);
    const double c = cos_phi_[i];
    const double s = sin_phi_[i];
    const double u = c * position_m.x() + s * position_m.y() - k.base_m + k.platform_m;
    const double v = -s * position_m.x() + c * position_m.y() + k.lateral_m;
    const double w = position_m.z();
    const double q_squared = k.shin_m * k.shin_m - v * v;
    if (!(q_squared > 0.0)) return std::nullopt;
    const double span = k.joint_offsets_m + std::sqrt(q_squared);
    const double along = (u * u + w * w + k.thigh_m * k.thigh_m - span * span) / (2.0 * k.thigh_m);
    const double distance = std::hypot(u, w);
    if (!(std::abs(along) <= distance) || distance == 0.0) return std::nullopt;
    out[leg] = std::atan2(w, u) - std::acos(along / distance);
  }
  return out;
}

std::optional<Matrix3d> Kinematics::jacobian(const Vector3d& position_m, const Vector3d& angles_rad) const noexcept {
  if (!position_m.allFinite() || !angles_rad.allFinite()) return std::nullopt;
  // ∂θ/∂x has the rows −(∂g/∂x)/(∂g/∂θ); J is its inverse: J = −(∂g/∂x)⁻¹ diag(∂g/∂θ).
  Matrix3d gradient;
  Vector3d by_angle;
  for (int leg = 0; leg < 3; ++leg) {
    const double angle = angles_rad[leg];
    const Closure closed = closure(static_cast<std::size_t>(leg), position_m, std::cos(angle), std::sin(angle));
    if (!closed.reachable) return std::nullopt;
    gradient.row(leg) = closed.gradient.transpose();
    by_angle[leg] = closed.by_angle;
  }
  Matrix3d inverse;
  bool invertible = false;
  gradient.computeInverseWithCheck(inverse, invertible, 1e-9);
  constexpr double kSmallestLever = 1e-5;  // m²/rad; about 1e-2 in the workspace
  if (!invertible || !(by_angle.array().abs() > kSmallestLever).all()) return std::nullopt;
  return -inverse * by_angle.asDiagonal();
}

}  // namespace drivers::falcon
