#pragma once
/// @file contact_rows.hpp
/// What the parts of the contact solver share: how bodies go at a contact, and what an impulse there does to them.
#include <Eigen/Core>
#include <Eigen/Geometry>

#include "haptic_node/rendering/contact_solver.hpp"

namespace haptic::contact_rows {

using Eigen::Vector2d;
using Eigen::Vector3d;
using Direction = SolverContact::Direction;

template <bool kBoth>
[[gnu::always_inline]] inline void push(SolverBody* bodies, const SolverContact& contact, double normal_n_s) noexcept {
  const Direction& normal = contact.directions[0];
  SolverBody& a = bodies[contact.a];
  a.velocity_m_s += (a.inverse_mass_per_kg * normal_n_s) * normal.along;
  a.angular_velocity_rad_s += normal_n_s * normal.turn_a_per_kg_m;
  if constexpr (!kBoth) return;
  SolverBody& b = bodies[contact.b];
  b.velocity_m_s -= (b.inverse_mass_per_kg * normal_n_s) * normal.along;
  b.angular_velocity_rad_s -= normal_n_s * normal.turn_b_per_kg_m;
}

/// Along all three directions at once.
template <bool kBoth>
[[gnu::always_inline]] inline void push(SolverBody* bodies, const SolverContact& contact, double normal_n_s,
                                        const Vector2d& tangent_n_s) noexcept {
  const auto& [normal, first, second] = contact.directions;
  const Vector3d impulse_n_s =
      normal_n_s * normal.along + tangent_n_s.x() * first.along + tangent_n_s.y() * second.along;
  SolverBody& a = bodies[contact.a];
  a.velocity_m_s += a.inverse_mass_per_kg * impulse_n_s;
  a.angular_velocity_rad_s += normal_n_s * normal.turn_a_per_kg_m + tangent_n_s.x() * first.turn_a_per_kg_m +
                              tangent_n_s.y() * second.turn_a_per_kg_m;
  if constexpr (!kBoth) return;
  SolverBody& b = bodies[contact.b];
  b.velocity_m_s -= b.inverse_mass_per_kg * impulse_n_s;
  b.angular_velocity_rad_s -= normal_n_s * normal.turn_b_per_kg_m + tangent_n_s.x() * first.turn_b_per_kg_m +
                              tangent_n_s.y() * second.turn_b_per_kg_m;
}

inline void push(SolverBody* bodies, const SolverContact& contact, double normal_n_s) noexcept {
  contact.b >= 0 ? push<true>(bodies, contact, normal_n_s) : push<false>(bodies, contact, normal_n_s);
}

inline void push(SolverBody* bodies, const SolverContact& contact, double normal_n_s,
                 const Vector2d& tangent_n_s) noexcept {
  contact.b >= 0 ? push<true>(bodies, contact, normal_n_s, tangent_n_s)
                 : push<false>(bodies, contact, normal_n_s, tangent_n_s);
}

inline void spin(SolverBody* bodies, const SolverContact& contact, double impulse) noexcept {
  SolverBody& a = bodies[contact.a];
  a.angular_velocity_rad_s += a.inverse_inertia_per_kg_m2 * (contact.normal * impulse);
  if (contact.b < 0) return;
  SolverBody& b = bodies[contact.b];
  b.angular_velocity_rad_s -= b.inverse_inertia_per_kg_m2 * (contact.normal * impulse);
}

/// How the bodies go at a contact, beyond its surface.
struct Going {
  Vector3d apart_m_s;
  Vector3d a_rad_s, b_rad_s;
};

template <bool kBoth>
[[gnu::always_inline]] inline Going going(const SolverBody* bodies, const SolverContact& contact) noexcept {
  const SolverBody& a = bodies[contact.a];
  Going out{a.velocity_m_s - contact.surface_velocity_m_s, a.angular_velocity_rad_s, Vector3d::Zero()};
  if constexpr (kBoth) {
    out.apart_m_s -= bodies[contact.b].velocity_m_s;
    out.b_rad_s = bodies[contact.b].angular_velocity_rad_s;
  }
  return out;
}

template <bool kBoth>
[[gnu::always_inline]] inline double slip_m_s(const Going& going, const Direction& direction) noexcept {
  double turning_m_s = direction.arm_a.dot(going.a_rad_s);
  if constexpr (kBoth) turning_m_s -= direction.arm_b.dot(going.b_rad_s);
  return direction.along.dot(going.apart_m_s) + turning_m_s;
}

/// Below this impulse what gives way would come faster than it may.
inline double advance_impulse(const SolverContact& contact) noexcept {
  const double over_m_s = contact.normal.dot(contact.surface_velocity_m_s) - contact.advance_m_s;
  return over_m_s > 0.0 && contact.softness_per_kg > 0.0 ? contact.expected_n_s + over_m_s / contact.softness_per_kg
                                                         : 0.0;
}

/// Of one contact: along the normal, along both tangents, about the normal.
using RowImpulse = Eigen::Vector4d;

inline RowImpulse impulses_of(const SolverContact& contact) noexcept {
  return {contact.normal_n_s, contact.tangent_n_s.x(), contact.tangent_n_s.y(), contact.torsion_n_m_s};
}

inline void give(SolverBody* bodies, SolverContact& contact, const RowImpulse& more) noexcept {
  if (contact.inverse_mass_normal_per_kg <= 0.0) return;
  contact.normal_n_s += more[0];
  if (contact.friction <= 0.0) {
    push(bodies, contact, more[0]);
    return;
  }
  contact.tangent_n_s += more.segment<2>(1);
  push(bodies, contact, more[0], more.segment<2>(1));
  if (contact.inertia_torsion_kg_m2 <= 0.0) return;
  contact.torsion_n_m_s += more[3];
  spin(bodies, contact, more[3]);
}

}  // namespace haptic::contact_rows
