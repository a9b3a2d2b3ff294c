#include "haptic_node/rendering/contact_solver.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>

#include "haptic_node/rendering/contact_rows.hpp"
#include "haptic_node/rendering/contact_subspace.hpp"

namespace haptic {
namespace {

using namespace contact_rows;  // NOLINT(google-build-using-namespace): its other half

/// As Eigen's product, which GCC 12 does not write in line.
Vector3d times(const Eigen::Matrix3d& m, const Vector3d& v) noexcept {
  return m.col(0) * v.x() + m.col(1) * v.y() + m.col(2) * v.z();
}

void turn_arms(const SolverBody* bodies, const SolverContact& contact, Direction& out) noexcept {
  out.arm_a = contact.from_a_m.cross(out.along);
  out.turn_a_per_kg_m = times(bodies[contact.a].inverse_inertia_per_kg_m2, out.arm_a);
  if (contact.b < 0) return;
  out.arm_b = contact.from_b_m.cross(out.along);
  out.turn_b_per_kg_m = times(bodies[contact.b].inverse_inertia_per_kg_m2, out.arm_b);
}

void prepare(const SolverBody* bodies, const SolverContact& contact, const Vector3d& along, Direction& out) noexcept {
  out.along = along;
  turn_arms(bodies, contact, out);
}

/// The velocity along `felt` that a unit impulse along `pushed` makes.
double inverse_mass(const SolverBody* bodies, const SolverContact& contact, const Direction& pushed,
                    const Direction& felt) noexcept {
  const double along = pushed.along.dot(felt.along);
  double out = along * bodies[contact.a].inverse_mass_per_kg + felt.arm_a.dot(pushed.turn_a_per_kg_m);
  if (contact.b >= 0) out += along * bodies[contact.b].inverse_mass_per_kg + felt.arm_b.dot(pushed.turn_b_per_kg_m);
  return out;
}

void prepare(const SolverBody* bodies, SolverContact& contact) noexcept {
  auto& [normal, first, second] = contact.directions;
  prepare(bodies, contact, contact.normal, normal);
  contact.inverse_mass_normal_per_kg = inverse_mass(bodies, contact, normal, normal);
  contact.mass_normal_kg = 1.0 / (contact.inverse_mass_normal_per_kg + contact.softness_per_kg);
  contact.inertia_torsion_kg_m2 = 0.0;
  if (contact.friction <= 0.0) return;
  const Vector3d tangent = contact.normal.unitOrthogonal();
  prepare(bodies, contact, tangent, first);
  prepare(bodies, contact, contact.normal.cross(tangent), second);
  contact.slip_per_n_s = {inverse_mass(bodies, contact, normal, first), inverse_mass(bodies, contact, normal, second)};
  const double w00 = inverse_mass(bodies, contact, first, first);
  const double w01 = inverse_mass(bodies, contact, first, second);
  const double w11 = inverse_mass(bodies, contact, second, second);
  const double determinant = w00 * w11 - w01 * w01;
  if (determinant > 0.0) {
    contact.mass_tangent_kg << w11, -w01, -w01, w00;
    contact.mass_tangent_kg /= determinant;
  } else {
    contact.mass_tangent_kg.setZero();
  }
  const double largest = 0.5 * (w00 + w11) + std::sqrt(0.25 * (w00 - w11) * (w00 - w11) + w01 * w01);
  contact.least_mass_tangent_kg = largest > 0.0 ? 1.0 / largest : 0.0;
  if (contact.torsion_radius_m <= 0.0) return;
  double about_normal = contact.normal.dot(bodies[contact.a].inverse_inertia_per_kg_m2 * contact.normal);
  if (contact.b >= 0) about_normal += contact.normal.dot(bodies[contact.b].inverse_inertia_per_kg_m2 * contact.normal);
  contact.inertia_torsion_kg_m2 = about_normal > 0.0 ? 1.0 / about_normal : 0.0;
}

/// One contact in turn. @param kBoth Whether it has a body `b`. @returns how much the velocities there have changed.
template <bool kBoth>
double relax(SolverBody* bodies, SolverContact& contact) noexcept {
  if (contact.inverse_mass_normal_per_kg <= 0.0) return 0.0;
  const auto& [along_normal, first, second] = contact.directions;
  const Going at = going<kBoth>(bodies, contact);
  const double soft = contact.softness_per_kg;
  const double normal_velocity =
      slip_m_s<kBoth>(at, along_normal) + contact.closing_m_s + soft * (contact.normal_n_s - contact.expected_n_s);
  double normal = std::max(0.0, contact.normal_n_s - normal_velocity * contact.mass_normal_kg);
  if (const double least = advance_impulse(contact); normal < least) {
    const double held_m_s = normal_velocity - soft * (contact.normal_n_s - contact.expected_n_s) +
                            contact.normal.dot(contact.surface_velocity_m_s) - contact.advance_m_s;
    normal = std::clamp(contact.normal_n_s - held_m_s / contact.inverse_mass_normal_per_kg, 0.0, least);
  }
  const double step = normal - contact.normal_n_s;
  double change = std::abs(step) * contact.inverse_mass_normal_per_kg;
  contact.normal_n_s = normal;
  const double cone = contact.friction * (normal + contact.held_n_s);
  const Vector2d before = contact.tangent_n_s;
  if (contact.friction <= 0.0 || (cone <= 0.0 && before.isZero(0.0) && contact.torsion_n_m_s == 0.0)) {
    if (step != 0.0) push<kBoth>(bodies, contact, step);
    return change;
  }
  // The slip after the push along the normal, without waiting for it.
  const Vector2d slip = Vector2d(slip_m_s<kBoth>(at, first), slip_m_s<kBoth>(at, second)) + step * contact.slip_per_n_s;
  const bool patch = contact.inertia_torsion_kg_m2 > 0.0;
  const double radius_m = contact.torsion_radius_m;
  double rate_rad_s = 0.0, torsion = contact.torsion_n_m_s, spun = 0.0;
  if (patch) {
    rate_rad_s = contact.normal.dot(at.a_rad_s) - (kBoth ? contact.normal.dot(at.b_rad_s) : 0.0);
    torsion -= rate_rad_s * contact.inertia_torsion_kg_m2;
    spun = torsion / radius_m;
  }
  Vector2d after = before - contact.mass_tangent_kg * slip;
  if (after.squaredNorm() + spun * spun > cone * cone) {
    // What slides is braked against its slip. The matrix, which finds what sticks in one step, would turn that. A patch
    // that slides hardly resists spin: together both are at most friction times the normal impulse.
    const double mass_kg =
        patch ? std::min(contact.least_mass_tangent_kg, contact.inertia_torsion_kg_m2 / (radius_m * radius_m))
              : contact.least_mass_tangent_kg;
    after = before - mass_kg * slip;
    torsion = patch ? contact.torsion_n_m_s - rate_rad_s * mass_kg * radius_m * radius_m : 0.0;
    const double length = patch ? std::hypot(after.norm(), torsion / radius_m) : after.norm();
    if (length > cone) {
      const double shorter = length > 0.0 ? cone / length : 0.0;
      after *= shorter;
      torsion *= shorter;
    }
  }
  const Vector2d correction = after - before;
  push<kBoth>(bodies, contact, step, correction);
  contact.tangent_n_s = after;
  change = std::max(change, correction.cwiseAbs().maxCoeff() * contact.inverse_mass_normal_per_kg);
  if (patch) {
    spin(bodies, contact, torsion - contact.torsion_n_m_s);
    contact.torsion_n_m_s = torsion;
  }
  return change;
}

double relax(SolverBody* bodies, SolverContact& contact) noexcept {
  return contact.b >= 0 ? relax<true>(bodies, contact) : relax<false>(bodies, contact);
}

/// Takes the impulse apart, and lets it act. The normal may have turned since the last step.
void begin(SolverBody* bodies, SolverContact& contact) noexcept {
  const auto& [normal, first, second] = contact.directions;
  contact.normal_n_s = std::max(0.0, contact.normal.dot(contact.impulse_n_s));
  contact.tangent_n_s.setZero();
  if (contact.friction <= 0.0) {
    push(bodies, contact, contact.normal_n_s);
    contact.torsion_n_m_s = 0.0;
    return;
  }
  contact.tangent_n_s = {first.along.dot(contact.impulse_n_s), second.along.dot(contact.impulse_n_s)};
  push(bodies, contact, contact.normal_n_s, contact.tangent_n_s);
  if (contact.torsion_n_m_s != 0.0) spin(bodies, contact, contact.torsion_n_m_s);
}

void end(SolverContact& contact) noexcept {
  const auto& [normal, first, second] = contact.directions;
  contact.impulse_n_s = contact.normal_n_s * normal.along;
  if (contact.friction <= 0.0) return;
  contact.impulse_n_s += contact.tangent_n_s.x() * first.along + contact.tangent_n_s.y() * second.along;
}

/// After so many sweeps most of what slides, or has come off, is known.
constexpr int kSweepsToStick = 4;

/// A last sweep that still changes so many tolerances has not come near the solution: a body that is pressed by many
/// times its weight.
constexpr double kFarOff = 100.0;

struct Swept {
  int sweeps = 0;
  double change_m_s = 0.0;  ///< By the last one.
};
Swept sweep(SolverBody* bodies, SolverContact* contacts, std::size_t count, int most, double tolerance_m_s) noexcept {
  Swept out;
  while (out.sweeps < most) {
    ++out.sweeps;
    out.change_m_s = 0.0;
    for (std::size_t i = 0; i < count; ++i) out.change_m_s = std::max(out.change_m_s, relax(bodies, contacts[i]));
    if (out.change_m_s <= tolerance_m_s) break;
  }
  return out;
}

/// Twice the energy that such an impulse would give to what rests there.
double weighed_square(const SolverContact& contact, const RowImpulse& impulse) noexcept {
  const double spin =
      contact.inertia_torsion_kg_m2 > 0.0 ? impulse[3] * impulse[3] / contact.inertia_torsion_kg_m2 : 0.0;
  return contact.inverse_mass_normal_per_kg * impulse.head<3>().squaredNorm() + spin;
}

}  // namespace

void prepare_contacts(const SolverBody* bodies, SolverContact* contacts, std::size_t count) noexcept {
  for (std::size_t i = 0; i < count; ++i) prepare(bodies, contacts[i]);
}

void move_points(const SolverBody* bodies, SolverContact* contacts, std::size_t count) noexcept {
  for (std::size_t i = 0; i < count; ++i) {
    const std::size_t directions = contacts[i].friction > 0.0 ? 3 : 1;
    for (std::size_t k = 0; k < directions; ++k) turn_arms(bodies, contacts[i], contacts[i].directions[k]);
  }
}

int relax_contacts(SolverBody* bodies, SolverContact* contacts, std::size_t count, int max_sweeps,
                   double tolerance_m_s) noexcept {
  for (std::size_t i = 0; i < count; ++i) begin(bodies, contacts[i]);
  const Swept swept = sweep(bodies, contacts, count, max_sweeps, tolerance_m_s);
  for (std::size_t i = 0; i < count; ++i) end(contacts[i]);
  return swept.sweeps;
}

int relax_alone(SolverBody* bodies, SolverContact* contacts, std::size_t count, int max_sweeps,
                double tolerance_m_s) noexcept {
  for (std::size_t i = 0; i < count; ++i) begin(bodies, contacts[i]);
  const Swept swept = sweep(bodies, contacts, count, max_sweeps, tolerance_m_s);
  int sweeps = swept.sweeps;
  if (swept.change_m_s > kFarOff * tolerance_m_s && solve_what_sticks(bodies, contacts, count)) {
    sweeps += sweep(bodies, contacts, count, kSweepsToStick, tolerance_m_s).sweeps;
  }
  for (std::size_t i = 0; i < count; ++i) end(contacts[i]);
  return sweeps;
}

int relax_together(SolverBody* bodies, SolverContact* contacts, std::size_t count, int max_sweeps,
                   double tolerance_m_s) noexcept {
  count = std::min(count, kMostRowsTogether);
  std::array<RowImpulse, kMostRowsTogether> way, before;
  double last = 0.0;
  for (std::size_t i = 0; i < count; ++i) begin(bodies, contacts[i]);
  int sweeps = 0;
  while (sweeps < max_sweeps) {
    ++sweeps;
    for (std::size_t i = 0; i < count; ++i) before[i] = impulses_of(contacts[i]);
    double change = 0.0, square = 0.0;
    for (std::size_t i = 0; i < count; ++i) {
      change = std::max(change, relax(bodies, contacts[i]));
      before[i] = impulses_of(contacts[i]) - before[i];
      square += weighed_square(contacts[i], before[i]);
    }
    if (change <= tolerance_m_s || sweeps == max_sweeps) break;
    if (sweeps % kSweepsToStick == 0 && solve_what_sticks(bodies, contacts, count)) {
      for (std::size_t i = 0; i < count; ++i) way[i].setZero();
      last = 0.0;
      continue;
    }
    const double onward = sweeps > 1 && square <= last ? square / last : 0.0;
    for (std::size_t i = 0; i < count; ++i) {
      if (onward > 0.0) {
        const RowImpulse more = onward * way[i];
        give(bodies, contacts[i], more);
        way[i] = more + before[i];
      } else {
        way[i] = sweeps > 1 ? RowImpulse(RowImpulse::Zero()) : before[i];
      }
    }
    last = square;
  }
  for (std::size_t i = 0; i < count; ++i) end(contacts[i]);
  return sweeps;
}

}  // namespace haptic
