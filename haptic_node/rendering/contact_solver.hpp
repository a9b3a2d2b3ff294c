#pragma once
/// @file contact_solver.hpp
/// A small contact problem in velocities: a few bodies, a few contacts with friction, solved in bounded time.
#include <array>
#include <cstddef>
#include <limits>

#include <Eigen/Core>

#include "rtbus/realtime.hpp"

namespace haptic {

/// One body of the problem; the proxy is one without inertia tensor (a hand holds it: it does not turn).
struct SolverBody {
  Eigen::Vector3d velocity_m_s = Eigen::Vector3d::Zero();
  Eigen::Vector3d angular_velocity_rad_s = Eigen::Vector3d::Zero();
  double inverse_mass_per_kg = 0.0;
  Eigen::Matrix3d inverse_inertia_per_kg_m2 = Eigen::Matrix3d::Zero();
};

/// A contact between body `a`, which the normal points to, and body `b`. Impulses act on `a`, their opposite on `b`.
struct SolverContact {
  static constexpr int kFixed = -1;  ///< In place of `b`: what moves with surface_velocity_m_s whatever pushes.
  int a = 0;
  int b = kFixed;
  Eigen::Vector3d normal = Eigen::Vector3d::UnitY();
  Eigen::Vector3d from_a_m = Eigen::Vector3d::Zero();  ///< From a's centre to the contact point.
  Eigen::Vector3d from_b_m = Eigen::Vector3d::Zero();
  Eigen::Vector3d surface_velocity_m_s = Eigen::Vector3d::Zero();  ///< At the point, beyond that of `b`.
  double closing_m_s = 0.0;  ///< The normal velocity must not be below minus this: the gap over the step.
  double friction = 0.0;     ///< Coulomb coefficient [1].
  double held_n_s = 0.0;     ///< Added to the normal impulse in the friction cone alone.
  /// Gives way along the normal by `softness_per_kg` times what the impulse is more than `expected_n_s`.
  double softness_per_kg = 0.0;
  double expected_n_s = 0.0;
  /// However little pushes against it, what gives way does not come along the normal faster than this.
  double advance_m_s = std::numeric_limits<double>::infinity();
  /// A patch of this radius also resists spin about the normal; 0: a point. The two share friction times the normal
  /// impulse: |tangential|^2 + (torsion/radius)^2 is at most its square (R. D. Howe, M. R. Cutkosky, "Practical
  /// force-motion models for sliding manipulation", IJRR 15(6), 1996).
  double torsion_radius_m = 0.0;

  Eigen::Vector3d impulse_n_s = Eigen::Vector3d::Zero();  ///< On `a`. In: the last step's; out: the solution.
  double normal_n_s = 0.0;                                ///< Its normal part …
  Eigen::Vector2d tangent_n_s = Eigen::Vector2d::Zero();  ///< … and those along the tangents.
  double torsion_n_m_s = 0.0;                             ///< On `a`, about the normal.

  /// What an impulse along one direction does to both bodies.
  struct Direction {
    Eigen::Vector3d along = Eigen::Vector3d::Zero();  ///< Unit.
    /// Of the impulse, about the centres.
    Eigen::Vector3d arm_a = Eigen::Vector3d::Zero(), arm_b = Eigen::Vector3d::Zero();
    Eigen::Vector3d turn_a_per_kg_m = Eigen::Vector3d::Zero(), turn_b_per_kg_m = Eigen::Vector3d::Zero();
  };
  // Made by prepare_contacts().
  std::array<Direction, 3> directions{};  ///< The normal, and two tangents where there is friction.
  double inverse_mass_normal_per_kg = 0.0;
  double mass_normal_kg = 0.0;                             ///< With the softness.
  Eigen::Vector2d slip_per_n_s = Eigen::Vector2d::Zero();  ///< m/s along the tangents for an impulse along the normal.
  Eigen::Matrix2d mass_tangent_kg = Eigen::Matrix2d::Zero();
  double least_mass_tangent_kg = 0.0;
  double inertia_torsion_kg_m2 = 0.0;
};

/// Masses and geometry of contacts, before any of the solvers below: they may follow several times. @realtime Yes.
void prepare_contacts(const SolverBody* bodies, SolverContact* contacts, std::size_t count) noexcept RTBUS_NONBLOCKING;
/// Instead of that where only the points have moved a little: arms follow them, masses stay.
void move_points(const SolverBody* bodies, SolverContact* contacts, std::size_t count) noexcept RTBUS_NONBLOCKING;

/// Projected Gauss-Seidel, J. J. Moreau's sweeping process in impulses (M. Jean, "The non-smooth contact dynamics
/// method", CMAME 177, 1999): each contact in turn gets the normal impulse ≥ 0 that keeps its gap, and the tangential
/// one, at most friction times it, that stops its slip. Begins with the impulses found in `contacts`; adds all of them
/// to the velocities. At most `max_sweeps`, fewer once no velocity at a contact changes by more than `tolerance_m_s`.
/// @returns the sweeps made. @realtime Yes.
int relax_contacts(SolverBody* bodies, SolverContact* contacts, std::size_t count, int max_sweeps,
                   double tolerance_m_s) noexcept RTBUS_NONBLOCKING;

/// relax_contacts() for light bodies that push no other. Where its sweeps end far from a solution, all contacts that
/// stick are one linear problem (contact_subspace.hpp), and four sweeps follow. @returns all sweeps made. @realtime
/// Yes.
int relax_alone(SolverBody* bodies, SolverContact* contacts, std::size_t count, int max_sweeps,
                double tolerance_m_s) noexcept RTBUS_NONBLOCKING;

/// relax_contacts() for bodies that push each other, where one sweep after the other gets nowhere: each goes on along
/// the ways of those before (M. Silcowitz-Hansen, S. Niebe, K. Erleben, "A nonsmooth nonlinear conjugate gradient
/// method for interactive contact force problems", The Visual Computer 26, 2010). Where all stick, one linear problem
/// helps (contact_subspace.hpp). @param count At most kMostRowsTogether.
int relax_together(SolverBody* bodies, SolverContact* contacts, std::size_t count, int max_sweeps,
                   double tolerance_m_s) noexcept RTBUS_NONBLOCKING;
inline constexpr std::size_t kMostRowsTogether = 84;

}  // namespace haptic
