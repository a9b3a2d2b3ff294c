#include "haptic_node/rendering/god_object.hpp"

#include <algorithm>
#include <utility>

namespace haptic {

namespace {
/// Slides per cycle. One settles a plane; the rest is for edges, and for spheres whose tangent plane turns on the way.
constexpr int kMaxSlides = 6;
/// Alternating projections onto the planes of neighbouring bodies within one slide (a corner needs three).
constexpr int kMaxProjections = 8;
}  // namespace

GodObject::GodObject(std::vector<rtbus::shapes::PlacedShape> shapes)
    : shapes_(std::move(shapes)), surfaces_(shapes_.size()) {}

bool GodObject::outside_all(const Eigen::Vector3d& p_W) const noexcept {
  return std::none_of(shapes_.begin(), shapes_.end(),
                      [&](const auto& shape) { return nearest_surface(shape, p_W).distance_m < 0.0; });
}

void GodObject::place(const Eigen::Vector3d& p_W) noexcept {
  position_W_ = p_W;
  for (const auto& shape : shapes_) {
    const auto surface = nearest_surface(shape, position_W_);
    if (surface.distance_m < 0.0) position_W_ = surface.point_m;
  }
  touching_ = (position_W_ - p_W).squaredNorm() > 0.0;
}

void GodObject::follow(const Eigen::Vector3d& goal_W) noexcept {
  // In free air the object is at its goal. Losing contact the same way would let it through a thin body: then the
  // slides below have to find the way round first.
  if (!touching_ && outside_all(goal_W)) {
    position_W_ = goal_W;
    return;
  }
  for (int slide = 0; slide < kMaxSlides; ++slide) {
    // All bodies are convex: each lies behind the tangent plane at its point nearest to the object, so whatever is in
    // front of all these planes can be reached in a straight line.
    Eigen::Vector3d goal = goal_W;
    for (std::size_t i = 0; i < shapes_.size(); ++i) surfaces_[i] = nearest_surface(shapes_[i], position_W_);
    for (int pass = 0; pass < kMaxProjections; ++pass) {
      bool moved = false;
      for (const auto& surface : surfaces_) {
        const double behind = surface.normal.dot(goal - surface.point_m);
        if (behind < -1e-12) {
          goal -= behind * surface.normal;
          moved = true;
        }
      }
      if (!moved) break;
    }
    const double step = (goal - position_W_).norm();
    position_W_ = goal;
    if (step < 1e-9) break;
  }
  touching_ = (position_W_ - goal_W).squaredNorm() > 1e-24;
}

}  // namespace haptic
