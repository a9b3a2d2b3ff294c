#pragma once
/// @file contact_sweep.hpp
/// Where a sphere ends up that is pulled to a goal among static convex shapes: the geometry of the analytic engine.
#include <cstdint>
#include <vector>

#include <Eigen/Core>

#include "rtbus/shapes/shapes.hpp"

namespace physics::analytic {

/// The sphere that moves.
struct Mover {
  double radius_m = 0.0;
  double friction = 0.0;  ///< Multiplied with the shape's.
};

struct SweepResult {
  Eigen::Vector3d end_m = Eigen::Vector3d::Zero();
  std::uint32_t contacts = 0;  ///< Shapes that hold the mover back at the end. 0: `end_m` is the goal, bit for bit.
};

/// Moves from `start` towards `goal` in W and stops where contacts and friction stop it.
///
/// Every shape is convex, so the plane that supports it at its nearest point keeps the mover out of the *whole* shape,
/// however far it moves. Two phases use that:
///  1. straight towards the goal until the first touch (Newton's method on the convex distance along the line);
///  2. from there, repeatedly: take the supporting planes at the present point, move to the point nearest the goal that
///  they
///     allow (projected Gauss-Seidel, friction cones included), look again, until nothing changes.
/// Each intermediate point is free of penetration if `start` is, so stopping early is safe, only not yet at the
/// optimum. One plane is solved exactly in the first round. This is the god-object of Zilles and Salisbury (IROS 1995),
/// with friction.
///
/// With h the step and M the effective mass, the contact impulse is M·(end − goal)/h; its tangential part is bounded by
/// friction times its normal part. Friction opposes the motion since the touch, so a mover that arrives obliquely
/// sticks where it arrived and not beside its start, however long the step is.
[[nodiscard]] SweepResult sweep(const std::vector<rtbus::shapes::PlacedShape>& shapes, const Mover& mover,
                                const Eigen::Vector3d& start, const Eigen::Vector3d& goal);

/// `start` moved out of the shapes it penetrates, by at most `budget_m`; `start` itself when it is free.
[[nodiscard]] Eigen::Vector3d push_out(const std::vector<rtbus::shapes::PlacedShape>& shapes, double radius_m,
                                       const Eigen::Vector3d& start, double budget_m);

}  // namespace physics::analytic
