#include "haptic_node/rendering/contact_solver.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

namespace haptic {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

/// What an impulse at `r` does to the velocity there.
Matrix3d inverse_mass_at(const SolverBody& body, const Vector3d& r) noexcept {
  if (body.inverse_inertia_per_kg_m2.isZero(0.0)) return body.inverse_mass_per_kg * Matrix3d::Identity();
  Matrix3d cross;
  cross << 0, -r.z(), r.y(), r.z(), 0, -r.x(), -r.y(), r.x(), 0;
  return body.inverse_mass_per_kg * Matrix3d::Identity() - cross * body.inverse_inertia_per_kg_m2 * cross;
}

void push(SolverBody& body, const Vector3d& r, const Vector3d& impulse) noexcept {
  body.velocity_m_s += body.inverse_mass_per_kg * impulse;
  body.angular_velocity_rad_s += body.inverse_inertia_per_kg_m2 * r.cross(impulse);
}

void push(SolverBody* bodies, const SolverContact& contact, const Vector3d& impulse) noexcept {
  push(bodies[contact.a], contact.from_a_m, impulse);
  if (contact.b >= 0) push(bodies[contact.b], contact.from_b_m, -impulse);
}

void spin(SolverBody* bodies, const SolverContact& contact, double impulse) noexcept {
  SolverBody& a = bodies[contact.a];
  a.angular_velocity_rad_s += a.inverse_inertia_per_kg_m2 * (contact.normal * impulse);
  if (contact.b < 0) return;
  SolverBody& b = bodies[contact.b];
  b.angular_velocity_rad_s -= b.inverse_inertia_per_kg_m2 * (contact.normal * impulse);
}

Vector3d slip(const SolverBody* bodies, const SolverContact& contact) noexcept {
  const SolverBody& a = bodies[contact.a];
  const Vector3d velocity_a = a.velocity_m_s + a.angular_velocity_rad_s.cross(contact.from_a_m);
  if (contact.b < 0) return velocity_a - contact.surface_velocity_m_s;
  const SolverBody& b = bodies[contact.b];
  return velocity_a - contact.surface_velocity_m_s - b.velocity_m_s - b.angular_velocity_rad_s.cross(contact.from_b_m);
}

void prepare(const SolverBody* bodies, SolverContact& contact) noexcept {
  Matrix3d W = inverse_mass_at(bodies[contact.a], contact.from_a_m);
  if (contact.b >= 0) W += inverse_mass_at(bodies[contact.b], contact.from_b_m);
  contact.inverse_mass_normal_per_kg = contact.normal.dot(W * contact.normal);
  contact.inertia_torsion_kg_m2 = 0.0;
  if (contact.friction <= 0.0) return;
  contact.tangent[0] = contact.normal.unitOrthogonal();
  contact.tangent[1] = contact.normal.cross(contact.tangent[0]);
  const Vector3d along = W * contact.tangent[0];
  const double w00 = contact.tangent[0].dot(along);
  const double w01 = contact.tangent[1].dot(along);
  const double w11 = contact.tangent[1].dot(W * contact.tangent[1]);
  const double determinant = w00 * w11 - w01 * w01;
  if (determinant > 0.0) {
    contact.mass_tangent_kg << w11, -w01, -w01, w00;
    contact.mass_tangent_kg /= determinant;
  } else {
    contact.mass_tangent_kg.setZero();
  }
  const double largest = 0.5 * (w00 + w11) + std::hypot(0.5 * (w00 - w11), w01);
  contact.least_mass_tangent_kg = largest > 0.0 ? 1.0 / largest : 0.0;
  if (contact.torsion_radius_m <= 0.0) return;
  double about_normal = contact.normal.dot(bodies[contact.a].inverse_inertia_per_kg_m2 * contact.normal);
  if (contact.b >= 0) about_normal += contact.normal.dot(bodies[contact.b].inverse_inertia_per_kg_m2 * contact.normal);
  contact.inertia_torsion_kg_m2 = about_normal > 0.0 ? 1.0 / about_normal : 0.0;
}

/// Below this impulse what gives way would come faster than it may.
double advance_impulse(const SolverContact& contact) noexcept {
  const double over_m_s = contact.normal.dot(contact.surface_velocity_m_s) - contact.advance_m_s;
  return over_m_s > 0.0 && contact.softness_per_kg > 0.0 ? contact.expected_n_s + over_m_s / contact.softness_per_kg
                                                         : 0.0;
}

/// One contact in turn. @returns how much the velocities there have changed.
double relax(SolverBody* bodies, SolverContact& contact) noexcept {
  if (contact.inverse_mass_normal_per_kg <= 0.0) return 0.0;
  const double soft = contact.softness_per_kg;
  const double normal_velocity = contact.normal.dot(slip(bodies, contact)) + contact.closing_m_s +
                                 soft * (contact.normal_n_s - contact.expected_n_s);
  double normal = std::max(0.0, contact.normal_n_s - normal_velocity / (contact.inverse_mass_normal_per_kg + soft));
  if (const double least = advance_impulse(contact); normal < least) {
    const double held_m_s = normal_velocity - soft * (contact.normal_n_s - contact.expected_n_s) +
                            contact.normal.dot(contact.surface_velocity_m_s) - contact.advance_m_s;
    normal = std::clamp(contact.normal_n_s - held_m_s / contact.inverse_mass_normal_per_kg, 0.0, least);
  }
  const double step = normal - contact.normal_n_s;
  double change = std::abs(step) * contact.inverse_mass_normal_per_kg;
  if (step != 0.0) {
    push(bodies, contact, step * contact.normal);
    contact.impulse_n_s += step * contact.normal;
    contact.normal_n_s = normal;
  }

  if (contact.friction <= 0.0) return change;
  const double cone = contact.friction * (normal + contact.held_n_s);
  const Vector3d tangential = contact.impulse_n_s - contact.normal_n_s * contact.normal;
  if (cone <= 0.0 && tangential.isZero(0.0) && contact.torsion_n_m_s == 0.0) return change;
  const Vector3d u = slip(bodies, contact);
  const Eigen::Vector2d slip2(contact.tangent[0].dot(u), contact.tangent[1].dot(u));
  const Eigen::Vector2d before(contact.tangent[0].dot(tangential), contact.tangent[1].dot(tangential));
  Eigen::Vector2d after = before - contact.mass_tangent_kg * slip2;
  if (after.squaredNorm() > cone * cone) {
    // What slides is braked against its slip. The matrix, which finds what sticks in one step, would turn that.
    after = before - contact.least_mass_tangent_kg * slip2;
    if (const double length = after.norm(); length > cone) after *= length > 0.0 ? cone / length : 0.0;
  }
  const Vector3d correction =
      contact.tangent[0] * (after.x() - before.x()) + contact.tangent[1] * (after.y() - before.y());
  push(bodies, contact, correction);
  contact.impulse_n_s =
      contact.normal_n_s * contact.normal + contact.tangent[0] * after.x() + contact.tangent[1] * after.y();
  change = std::max(change, correction.cwiseAbs().maxCoeff() * contact.inverse_mass_normal_per_kg);

  if (contact.inertia_torsion_kg_m2 > 0.0) {
    const double rate = contact.normal.dot(bodies[contact.a].angular_velocity_rad_s) -
                        (contact.b >= 0 ? contact.normal.dot(bodies[contact.b].angular_velocity_rad_s) : 0.0);
    const double limit = cone * contact.torsion_radius_m;
    const double torsion = std::clamp(contact.torsion_n_m_s - rate * contact.inertia_torsion_kg_m2, -limit, limit);
    spin(bodies, contact, torsion - contact.torsion_n_m_s);
    contact.torsion_n_m_s = torsion;
  }
  return change;
}

}  // namespace

void prepare_contacts(const SolverBody* bodies, SolverContact* contacts, std::size_t count) noexcept {
  for (std::size_t i = 0; i < count; ++i) prepare(bodies, contacts[i]);
}

int relax_contacts(SolverBody* bodies, SolverContact* contacts, std::size_t count, int max_sweeps) noexcept {
  for (std::size_t i = 0; i < count; ++i) {
    SolverContact& contact = contacts[i];
    // The normal may have turned since the last step.
    contact.normal_n_s = std::max(0.0, contact.normal.dot(contact.impulse_n_s));
    if (contact.friction <= 0.0) {
      contact.impulse_n_s = contact.normal_n_s * contact.normal;
      contact.torsion_n_m_s = 0.0;
    }
    push(bodies, contact, contact.impulse_n_s);
    spin(bodies, contact, contact.torsion_n_m_s);
  }
  int sweeps = 0;
  while (sweeps < max_sweeps) {
    ++sweeps;
    double change = 0.0;
    for (std::size_t i = 0; i < count; ++i) change = std::max(change, relax(bodies, contacts[i]));
    if (change <= kTolerance_m_s) break;
  }
  return sweeps;
}

int solve_contacts(SolverBody* bodies, SolverContact* contacts, std::size_t count, int max_sweeps) noexcept {
  prepare_contacts(bodies, contacts, count);
  return relax_contacts(bodies, contacts, count, max_sweeps);
}

}  // namespace haptic
