#include "physics_node/analytic/contact_sweep.hpp"

#include <algorithm>
#include <cmath>

namespace physics::analytic {
namespace {

using Eigen::Vector3d;
using rtbus::shapes::PlacedShape;

constexpr int kMaxAdvances = 48;  // rounds of the straight phase; Newton needs about 5, a grazing pass more
constexpr int kMaxRounds =
    48;  // rounds of the sliding phase; the error shrinks by (depth / radius) per round on a sphere
constexpr int kMaxSweeps = 64;  // Gauss-Seidel; one plane needs 2, orthogonal planes 2 or 3
constexpr int kPushOutSweeps = 8;
constexpr double kTouchM = 1e-9;  // nearer than this is touching: far below any encoder, far above rounding

/// The supporting plane of one shape, and how it pushes.
struct Contact {
  Vector3d normal = Vector3d::UnitY();
  double gap_m = 0.0;                  // of the mover's surface; negative: penetrates
  double push_m = 0.0;                 // displacement along the normal, ≥ 0
  Vector3d drag_m = Vector3d::Zero();  // displacement by friction, at most friction·push_m long
  double friction = 0.0;  // 0 until touched: a plane that only keeps the path safe is not there to rub against
  bool touched = false;
  Vector3d touch_m = Vector3d::Zero();  // where the mover was when it first touched the shape: slip counts from there
};

/// Takes the supporting plane anew at `position`; what was touched stays touched.
void look(const PlacedShape& shape, const Mover& mover, const Vector3d& position, Contact& contact) {
  const rtbus::shapes::SurfacePoint nearest = rtbus::shapes::nearest_surface(shape, position);
  contact.normal = nearest.normal;
  contact.gap_m = nearest.distance_m - mover.radius_m;
  contact.push_m = 0.0;
  contact.drag_m.setZero();
  if (!contact.touched && contact.gap_m <= kTouchM) {
    contact.touched = true;
    contact.touch_m = position;
    contact.friction = mover.friction * shape.friction;
  }
}

/// Phase 1. Returns true when the goal was reached without touching; else `position` is where it first touched.
bool advance_straight(const std::vector<PlacedShape>& shapes, const Mover& mover, const Vector3d& goal,
                      Vector3d& position) {
  for (int round = 0; round < kMaxAdvances; ++round) {
    const Vector3d way = goal - position;
    // The distance along the line is convex: the first crossing of a supporting plane is never beyond the surface.
    double fraction = 1.0;
    for (const PlacedShape& shape : shapes) {
      const rtbus::shapes::SurfacePoint nearest = rtbus::shapes::nearest_surface(shape, position);
      const double gap_m = nearest.distance_m - mover.radius_m;
      const double approach_m = -nearest.normal.dot(way);
      if (approach_m <= 0.0) continue;
      if (gap_m <= kTouchM && approach_m > gap_m) return false;
      fraction = std::min(fraction, gap_m / approach_m);
    }
    if (fraction >= 1.0) return true;
    position += fraction * way;
  }
  return false;  // still grazing something: let phase 2 decide from here
}

/// The point nearest `goal` that the contacts' planes (taken at `position`) and friction allow.
Vector3d project(std::vector<Contact>& contacts, const Vector3d& position, const Vector3d& goal) {
  Vector3d end = goal;
  for (int sweep_index = 0; sweep_index < kMaxSweeps; ++sweep_index) {
    double change_m = 0.0;
    for (Contact& contact : contacts) {
      // Friction first, so that each sweep ends with the normals satisfied.
      const double cone_m = contact.friction * contact.push_m;
      if (cone_m > 0.0 || !contact.drag_m.isZero(0.0)) {
        const Vector3d moved = end - contact.touch_m;
        const Vector3d slip = moved - contact.normal * contact.normal.dot(moved);
        Vector3d drag = contact.drag_m - slip;
        const double length_m = drag.norm();
        if (length_m > cone_m) drag *= cone_m / length_m;
        const Vector3d step = drag - contact.drag_m;
        end += step;
        contact.drag_m = drag;
        change_m = std::max(change_m, step.cwiseAbs().maxCoeff());
      }
      // Not beyond the plane; where the mover already penetrates, no deeper.
      const double clearance_m = contact.normal.dot(end - position) + std::max(contact.gap_m, 0.0);
      const double push_m = std::max(0.0, contact.push_m - clearance_m);
      const double step_m = push_m - contact.push_m;
      if (step_m != 0.0) {
        end += step_m * contact.normal;
        contact.push_m = push_m;
        change_m = std::max(change_m, std::abs(step_m));
      }
    }
    if (change_m <= 1e-15 * std::max(1e-3, (goal - position).cwiseAbs().maxCoeff())) break;
  }
  return end;
}

/// The part of the way from `position` to `end` that violates no plane. All of it when the sweeps converged; narrow
/// wedges with friction may need more of them than there are, and then the mover stops short instead of entering a
/// body.
Vector3d keep_outside(const std::vector<Contact>& contacts, const Vector3d& position, const Vector3d& end) {
  const Vector3d way = end - position;
  double fraction = 1.0;
  for (const Contact& contact : contacts) {
    const double room_m = std::max(contact.gap_m, 0.0);
    const double approach_m = -contact.normal.dot(way);
    if (approach_m > room_m + kTouchM) fraction = std::min(fraction, room_m / approach_m);
  }
  return fraction < 1.0 ? Vector3d(position + fraction * way) : end;
}

}  // namespace

SweepResult sweep(const std::vector<PlacedShape>& shapes, const Mover& mover, const Vector3d& start,
                  const Vector3d& goal) {
  Vector3d position = start;
  if (advance_straight(shapes, mover, goal, position)) return {goal, 0};

  std::vector<Contact> contacts(shapes.size());
  SweepResult result{position, 0};
  for (int round = 0; round < kMaxRounds; ++round) {
    for (std::size_t i = 0; i < shapes.size(); ++i) look(shapes[i], mover, position, contacts[i]);
    const Vector3d end = keep_outside(contacts, position, project(contacts, position, goal));
    const double moved_m = (end - position).norm();
    position = end;
    // A plane solved in the first round stays as it is; a curved surface has turned its normal a little: look again.
    if (moved_m <= 1e-13 * std::max(1.0, position.cwiseAbs().maxCoeff())) break;
  }
  result.end_m = position;
  for (const Contact& contact : contacts) result.contacts += contact.push_m > 0.0 ? 1U : 0U;
  return result;
}

Vector3d push_out(const std::vector<PlacedShape>& shapes, double radius_m, const Vector3d& start, double budget_m) {
  Vector3d position = start;
  for (int round = 0; round < kPushOutSweeps && budget_m > 0.0; ++round) {
    bool inside = false;
    for (const PlacedShape& shape : shapes) {
      const rtbus::shapes::SurfacePoint nearest = rtbus::shapes::nearest_surface(shape, position);
      const double depth_m = radius_m - nearest.distance_m;
      if (depth_m <= 0.0) continue;
      const double step_m = std::min(depth_m, budget_m);
      position += step_m * nearest.normal;
      budget_m -= step_m;
      inside = true;
    }
    if (!inside) break;
  }
  return position;
}

}  // namespace physics::analytic
