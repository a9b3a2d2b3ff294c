#pragma once
/// @file contact_subspace.hpp
/// All contacts that hold, solved at once: what sweeps over them find slowly.
#include <cstddef>

#include "haptic_node/rendering/contact_solver.hpp"
#include "rtbus/realtime.hpp"

namespace haptic {

/// Subspace minimization (M. Silcowitz, S. Niebe, K. Erleben, "Projected Gauss-Seidel subspace minimization method for
/// interactive rigid body dynamics", GRAPP 2010). Between sweeps: contacts that push are taken to go on doing so, and
/// to stick. That makes the problem linear,
///
///   (M + Jᵀ·D·J)·Δv = −Jᵀ·D·g,   Δλ = −D·(g + J·Δv),   D = 1/(softness + ε),
///
/// with g how far each contact is from holding. The small ε slows it down a little, and changes no solution: there g is
/// 0. Impulses are kept in their cones; the next sweep finds what pushes no more, and what slides.
/// @param contacts Prepared and begun; velocities have their impulses. @returns whether it did anything. Not where a
/// contact slides, or gives way at a bounded speed, and not with more than kMostInSubspace bodies or kMostRowsTogether
/// contacts. @realtime Yes.
bool solve_what_sticks(SolverBody* bodies, SolverContact* contacts, std::size_t count) noexcept RTBUS_NONBLOCKING;
inline constexpr int kMostInSubspace = 8;  ///< A group, the proxy, and one more.

}  // namespace haptic
