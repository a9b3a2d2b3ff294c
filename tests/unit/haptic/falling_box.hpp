#pragma once
/// @file falling_box.hpp
/// A tall box that stands on its edge and falls over, as an answer of physics tells it.
#include <cmath>
#include <vector>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "rtbus/contact_messages.hpp"
#include "rtbus/eigen.hpp"
#include "rtbus/shapes/known_shape.hpp"

namespace tests {

/// It leans towards +x, over its edge along z, on a floor.
struct FallingBox {
  static constexpr double kGravity_m_s2 = 9.81, kMass_kg = 0.2;
  inline static const Eigen::Vector3d kHalf_m{0.01, 0.04, 0.02};
  inline static const Eigen::Vector3d kEdge_m{0.0, -0.06, 0.0};
  /// It leans so much where its centre is above the edge.
  inline static const double kBalanced_rad = std::atan2(kHalf_m.x(), kHalf_m.y());
  /// A rod that is held at its end falls over as cosh(λ·t): of length 2d its moment of inertia there is m·(2d)²/3, and
  /// so it is with this box.
  inline static const double kLambda_per_s = std::sqrt(0.75 * kGravity_m_s2 / std::hypot(kHalf_m.x(), kHalf_m.y()));

  /// The box, and the floor.
  static std::vector<rtbus::shapes::KnownShape> shapes() {
    return {{rtbus::shapes::Box{kHalf_m}, 0, false},
            {rtbus::shapes::Plane{}, 1, true, Eigen::Quaterniond::Identity(), kEdge_m}};
  }

  /// From the edge to the centre, in the axes of the box.
  static Eigen::Vector3d centre_B_m() { return {-kHalf_m.x(), kHalf_m.y(), 0.0}; }

  /// At rest, `past_rad` past its balance, of the instant `sample_ns`.
  static rtbus::ProxyContacts answer(double past_rad, std::uint64_t sample_ns) {
    using Eigen::Matrix3d;
    using Eigen::Vector3d;
    using rtbus::array_of;
    const Eigen::Quaterniond q_WB(Eigen::AngleAxisd(-kBalanced_rad - past_rad, Vector3d::UnitZ()));
    const Vector3d from_edge_m = q_WB * centre_B_m();
    const Vector3d square = 4.0 * kHalf_m.cwiseAbs2();
    const Vector3d inertia_kg_m2 =
        kMass_kg / 12.0 * Vector3d(square.y() + square.z(), square.x() + square.z(), square.x() + square.y());
    const Matrix3d R = q_WB.toRotationMatrix();
    const Matrix3d inverse = R * Matrix3d(inertia_kg_m2.cwiseInverse().asDiagonal()) * R.transpose();
    const double weight_n = kMass_kg * kGravity_m_s2;
    rtbus::ProxyContacts out;
    out.device_sequence = 1;
    out.device_time_ns = sample_ns;
    out.step_s = 0.1;
    out.contacts = out.bodies = out.supports = 1;
    // Its face on that side.
    out.contact_point_m[0] = array_of(Vector3d(kEdge_m + q_WB * Vector3d(0.0, kHalf_m.y(), 0.0)));
    out.contact_normal[0] = array_of(Vector3d(q_WB * Vector3d::UnitX()));
    out.body_kind[0] = 2;
    out.body_centre_m[0] = array_of(Vector3d(kEdge_m + from_edge_m));
    out.body_orientation_wxyz[0] = {q_WB.w(), q_WB.x(), q_WB.y(), q_WB.z()};
    out.body_inverse_mass_per_kg[0] = 1.0 / kMass_kg;
    out.body_inverse_inertia_per_kg_m2[0] = {inverse(0, 0), inverse(0, 1), inverse(0, 2),
                                             inverse(1, 1), inverse(1, 2), inverse(2, 2)};
    // Of all forces: the weight, and the floor's on the edge.
    out.body_external_torque_n_m[0] = array_of(Vector3d((-from_edge_m).cross(Vector3d(0, weight_n, 0))));
    out.support_normal[0] = {0, 1, 0};
    out.support_point_m[0] = array_of(kEdge_m);
    out.support_force_n[0] = weight_n;
    out.support_friction[0] = 1.0;
    out.support_points[0] = 2;
    return out;
  }
};

}  // namespace tests
