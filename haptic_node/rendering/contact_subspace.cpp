#include "haptic_node/rendering/contact_subspace.hpp"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>
#include <span>

#include "haptic_node/rendering/contact_rows.hpp"

namespace haptic {
namespace {

using namespace contact_rows;  // NOLINT(google-build-using-namespace): of the solver

constexpr int kMostUnknowns = 6 * kMostInSubspace;
using Matrix = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::ColMajor, kMostUnknowns, kMostUnknowns>;
using Vector = Eigen::Matrix<double, Eigen::Dynamic, 1, Eigen::ColMajor, kMostUnknowns, 1>;
using Jacobian = Eigen::Matrix<double, 6, 3>;  ///< Of one body: a column for each direction.

/// Share of a contact's inverse mass by which it gives way in the linear problem. From 1e-4 to 1e-2 a stack of four
/// comes to rest as fast; with 1e-6 rounding shows.
constexpr double kGives = 1e-3;
/// What is so near to its cone slides.
constexpr double kSlides = 0.999;
/// In place of a mass or an inertia that is infinite.
constexpr double kHeavy = 1e6;
/// A body on a patch turns about one axis alone. About the others its inertia is so many times as large.
constexpr double kRigid = 1e6;

/// A contact that sticks.
struct Stuck {
  SolverContact* contact = nullptr;
  Jacobian a, b;
  Vector3d stiffness = Vector3d::Zero();  ///< D, along the three directions …
  Vector3d off_m_s = Vector3d::Zero();    ///< … and g.
  double twist_stiffness = 0.0, twist_rad_s = 0.0;
};

Jacobian jacobian(const SolverContact& contact, Vector3d Direction::*arm) noexcept {
  Jacobian out = Jacobian::Zero();
  const int directions = contact.friction > 0.0 ? 3 : 1;
  for (int k = 0; k < directions; ++k) {
    const Direction& direction = contact.directions[static_cast<std::size_t>(k)];
    out.col(k) << direction.along, direction.*arm;
  }
  return out;
}

/// @returns false: it slides, gives way at a bounded speed, or is held by what another row presses.
bool sticks(const SolverBody* bodies, SolverContact& contact, Stuck& out) noexcept {
  if (contact.normal_n_s <= 0.0 || advance_impulse(contact) > 0.0) return false;
  const bool patch = contact.inertia_torsion_kg_m2 > 0.0;
  const double cone_n_s = kSlides * contact.friction * (contact.normal_n_s + contact.held_n_s);
  const double spun_n_s = patch ? contact.torsion_n_m_s / contact.torsion_radius_m : 0.0;
  if (contact.friction > 0.0 && contact.tangent_n_s.squaredNorm() + spun_n_s * spun_n_s >= cone_n_s * cone_n_s) {
    return false;
  }
  out.contact = &contact;
  out.a = jacobian(contact, &Direction::arm_a);
  const Going at = contact.b >= 0 ? going<true>(bodies, contact) : going<false>(bodies, contact);
  Eigen::Matrix<double, 6, 1> a_goes;
  a_goes << at.apart_m_s, at.a_rad_s;
  out.off_m_s = out.a.transpose() * a_goes;
  if (contact.b >= 0) {
    out.b = -jacobian(contact, &Direction::arm_b);
    out.off_m_s += out.b.bottomRows<3>().transpose() * at.b_rad_s;
  }
  const double soft_per_kg = contact.softness_per_kg;
  const double gives_per_kg = kGives * contact.inverse_mass_normal_per_kg;
  out.off_m_s[0] += contact.closing_m_s + soft_per_kg * (contact.normal_n_s - contact.expected_n_s);
  out.stiffness = {1.0 / (soft_per_kg + gives_per_kg), 1.0 / gives_per_kg, 1.0 / gives_per_kg};
  if (patch) {
    out.twist_rad_s = contact.normal.dot(at.a_rad_s - at.b_rad_s);
    out.twist_stiffness = contact.inertia_torsion_kg_m2 / kGives;
  }
  return true;
}

void begin_masses(const SolverBody* bodies, Eigen::Index count, Matrix& A) noexcept {
  A.setZero(6 * count, 6 * count);
  for (Eigen::Index k = 0; k < count; ++k) {
    const SolverBody& body = bodies[k];
    const double inverse_mass_per_kg = body.inverse_mass_per_kg;
    A.diagonal().segment<3>(6 * k).setConstant(inverse_mass_per_kg > 0.0 ? 1.0 / inverse_mass_per_kg : kHeavy);
    auto turns = A.block<3, 3>(6 * k + 3, 6 * k + 3);
    const double turns_by = body.inverse_inertia_per_kg_m2.trace();
    if (turns_by > 0.0) {
      turns = (body.inverse_inertia_per_kg_m2 + turns_by / kRigid * Eigen::Matrix3d::Identity()).inverse();
    } else {
      turns.diagonal().setConstant(kHeavy);
    }
  }
}

/// Adds Jᵀ·D·J to the lower half of `A`, and −Jᵀ·D·g to `right`.
void add(const Stuck& stuck, Matrix& A, Vector& right) noexcept {
  const int a = 6 * stuck.contact->a, b = 6 * stuck.contact->b;
  const Vector3d& normal = stuck.contact->normal;
  const Jacobian a_holds = stuck.a * stuck.stiffness.asDiagonal();
  const Eigen::Matrix3d twist = stuck.twist_stiffness * normal * normal.transpose();
  const Vector3d twist_n_m_s = stuck.twist_stiffness * stuck.twist_rad_s * normal;
  A.block<6, 6>(a, a).noalias() += a_holds * stuck.a.transpose();
  A.block<3, 3>(a + 3, a + 3) += twist;
  right.segment<6>(a) -= a_holds * stuck.off_m_s;
  right.segment<3>(a + 3) -= twist_n_m_s;
  if (b < 0) return;
  const Jacobian b_holds = stuck.b * stuck.stiffness.asDiagonal();
  A.block<6, 6>(b, b).noalias() += b_holds * stuck.b.transpose();
  A.block<3, 3>(b + 3, b + 3) += twist;
  if (b > a) {
    A.block<6, 6>(b, a).noalias() += b_holds * stuck.a.transpose();
  } else {
    A.block<6, 6>(a, b).noalias() += a_holds * stuck.b.transpose();
  }
  A.block<3, 3>(std::max(a, b) + 3, std::min(a, b) + 3) -= twist;
  right.segment<6>(b) -= b_holds * stuck.off_m_s;
  right.segment<3>(b + 3) += twist_n_m_s;
}

/// Gives the contact what it needs to hold, as far as its cone allows. @param change_m_s Δv of all bodies.
void hold(const Stuck& stuck, const Vector& change_m_s, SolverBody* bodies) noexcept {
  SolverContact& contact = *stuck.contact;
  const int a = 6 * contact.a, b = 6 * contact.b;
  Vector3d off_m_s = stuck.off_m_s + stuck.a.transpose() * change_m_s.segment<6>(a);
  double twist_rad_s = stuck.twist_rad_s + contact.normal.dot(change_m_s.segment<3>(a + 3));
  if (b >= 0) {
    off_m_s += stuck.b.transpose() * change_m_s.segment<6>(b);
    twist_rad_s -= contact.normal.dot(change_m_s.segment<3>(b + 3));
  }
  const RowImpulse before = impulses_of(contact);
  RowImpulse after = before;
  after.head<3>() -= stuck.stiffness.cwiseProduct(off_m_s);
  after[3] -= stuck.twist_stiffness * twist_rad_s;
  after[0] = std::max(0.0, after[0]);
  const double cone_n_s = contact.friction * (after[0] + contact.held_n_s);
  const double spun_n_s = stuck.twist_stiffness > 0.0 ? after[3] / contact.torsion_radius_m : 0.0;
  const double length_n_s = std::sqrt(after.segment<2>(1).squaredNorm() + spun_n_s * spun_n_s);
  if (length_n_s > cone_n_s) after.tail<3>() *= cone_n_s / length_n_s;
  give(bodies, contact, after - before);
}

}  // namespace

bool solve_what_sticks(SolverBody* bodies, SolverContact* contacts, std::size_t count) noexcept {
  std::array<Stuck, kMostRowsTogether> stuck;
  std::size_t stuck_count = 0;
  int body_count = 0;
  if (count > kMostRowsTogether) return false;
  for (std::size_t i = 0; i < count; ++i) {
    SolverContact& contact = contacts[i];
    if (contact.inverse_mass_normal_per_kg <= 0.0) continue;
    if (contact.normal_n_s <= 0.0 && contact.held_n_s <= 0.0) continue;
    body_count = std::max({body_count, contact.a + 1, contact.b + 1});
    if (body_count > kMostInSubspace || !sticks(bodies, contact, stuck[stuck_count])) return false;
    ++stuck_count;
  }
  if (stuck_count == 0) return false;
  Matrix A;
  Vector change_m_s;
  begin_masses(bodies, body_count, A);
  change_m_s.setZero(A.rows());
  const std::span all(stuck.data(), stuck_count);
  for (const Stuck& each : all) add(each, A, change_m_s);
  const Eigen::LLT<Eigen::Ref<Matrix>> factors(A);
  if (factors.info() != Eigen::Success) return false;
  factors.solveInPlace(change_m_s);
  if (!change_m_s.allFinite()) return false;
  for (const Stuck& each : all) hold(each, change_m_s, bodies);
  return true;
}

}  // namespace haptic
