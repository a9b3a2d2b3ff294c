#include "haptic_node/rendering/direct.hpp"

#include <algorithm>
#include <utility>

namespace haptic {

namespace {
/// Slides per cycle. One settles a plane; the rest is for edges, and for spheres whose tangent plane turns on the way.
constexpr int kMaxSlides = 6;
/// Alternating projections onto the planes of neighbouring bodies within one slide (a corner needs three).
constexpr int kMaxProjections = 8;
}  // namespace

Direct::Direct(double stiffness_n_per_m, double damping_n_s_per_m, const Mapping& mapping,
               std::vector<rtbus::shapes::PlacedShape> shapes)
    : stiffness_n_per_m_(stiffness_n_per_m),
      damping_n_s_per_m_(damping_n_s_per_m),
      mapping_(mapping),
      shapes_(std::move(shapes)),
      surfaces_(shapes_.size()) {}

bool Direct::outside_all(const Eigen::Vector3d& p_W) const noexcept {
  return std::none_of(shapes_.begin(), shapes_.end(),
                      [&](const auto& shape) { return nearest_surface(shape, p_W).distance_m < 0.0; });
}

void Direct::follow(const Eigen::Vector3d& tip_W) noexcept {
  // In free air the god-object is the tip. Losing contact the same way would let the tip through a thin body: then the
  // slides below have to find the way round first.
  if (!touching_ && outside_all(tip_W)) {
    god_W_ = tip_W;
    return;
  }
  for (int slide = 0; slide < kMaxSlides; ++slide) {
    // All bodies are convex: each lies behind the tangent plane at its point nearest to the god-object, so whatever is
    // in front of all these planes can be reached in a straight line.
    Eigen::Vector3d goal = tip_W;
    for (std::size_t i = 0; i < shapes_.size(); ++i) surfaces_[i] = nearest_surface(shapes_[i], god_W_);
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
    const double step = (goal - god_W_).norm();
    god_W_ = goal;
    if (step < 1e-9) break;
  }
  touching_ = (god_W_ - tip_W).squaredNorm() > 1e-24;
}

RenderOutput Direct::render(const RenderInput& input) noexcept {
  const Eigen::Vector3d tip_W = mapping_.position_to_world(input.position_m);
  if (!placed_) {
    // The first cycle may find the tip inside a body: leave it by the nearest face.
    god_W_ = tip_W;
    for (const auto& shape : shapes_) {
      const auto surface = nearest_surface(shape, god_W_);
      if (surface.distance_m < 0.0) god_W_ = surface.point_m;
    }
    touching_ = (god_W_ - tip_W).squaredNorm() > 0.0;
    placed_ = true;
  }
  follow(tip_W);

  RenderOutput out;
  out.proxy_position_m = mapping_.position_to_device(god_W_);
  const Eigen::Vector3d depth = out.proxy_position_m - input.position_m;
  const double depth_m = depth.norm();
  if (!touching_ || depth_m <= 0.0) return out;
  const Eigen::Vector3d normal = depth / depth_m;
  const double force = stiffness_n_per_m_ * depth_m - damping_n_s_per_m_ * normal.dot(input.velocity_m_s);
  out.force_n = std::max(force, 0.0) * normal;
  return out;
}

}  // namespace haptic
