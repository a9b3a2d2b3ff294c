#include "haptic_node/rendering/static_shapes.hpp"

#include <algorithm>

namespace haptic {
namespace {

using Eigen::Vector3d;
using rtbus::shapes::StandingShape;

/// What approaches by less than this share of its way slides along.
constexpr double kSlides = 1e-3;

Vector3d in_body(const StandingShape& standing, const Vector3d& p_W) {
  return standing.q_WB.conjugate() * (p_W - standing.p_WB);
}

}  // namespace

int StaticShapes::index_of(std::uint32_t body) const noexcept {
  for (std::size_t i = 0; i < shapes_.size(); ++i) {
    if (shapes_[i].body == body) return static_cast<int>(i);
  }
  return -1;
}

bool StaticShapes::nearest_of_hull(int index, const Vector3d& proxy_m, Vector3d& point_m, Vector3d& normal) noexcept {
  const StandingShape& standing = shape(index);
  const auto* const hull = std::get_if<rtbus::shapes::Hull>(&standing.shape);
  if (hull == nullptr) return false;
  const Vector3d proxy_B = in_body(standing, proxy_m);
  Vector3d nearest_B;
  if (!nearest_point(*hull, proxy_B, nearest_[static_cast<std::size_t>(index)], nearest_B)) return false;
  const Vector3d way_B = proxy_B - nearest_B;
  const double distance_m = way_B.norm();
  if (distance_m < kSurface_m) return false;  // the direction of what is left is rounding
  normal = standing.q_WB * Vector3d(way_B / distance_m);
  point_m = standing.p_WB + standing.q_WB * nearest_B;
  return true;
}

std::size_t StaticShapes::minima(std::size_t index, const Vector3d& proxy_m, double reach_m,
                                 Minima& out) const noexcept {
  const StandingShape& standing = shapes_[index];
  const std::size_t found = standing.surface()->minima(in_body(standing, proxy_m), reach_m, out);
  for (std::size_t m = 0; m < found; ++m) out[m].point_m = standing.p_WB + standing.q_WB * out[m].point_m;
  return found;
}

void StaticShapes::forget_names() noexcept {
  for (Named& each : named_) each.named = false;
  any_named_ = false;
}

void StaticShapes::name(int index, const Named& named) noexcept {
  named_[static_cast<std::size_t>(index)] = named;
  any_named_ = true;
}

double StaticShapes::look_m(double speed_m_s, double h) const noexcept {
  return h * std::clamp(2.0 * speed_m_s, tuning_.recovery_m_s, tuning_.fast_look_m_s);
}

Vector3d StaticShapes::free_way_m(const Vector3d& proxy_m, double radius_m, const Vector3d& way_m,
                                  double seen_m) const noexcept {
  const double length_m = way_m.norm();
  if (length_m <= seen_m) return way_m;
  const Vector3d along = way_m / length_m;
  double gone_m = seen_m;
  for (int look = 1; look < static_cast<int>(tuning_.parts) && gone_m < length_m; ++look) {
    const Vector3d at = proxy_m + gone_m * along;
    for (std::size_t index = 0; index < named_.size(); ++index) {
      if (!named_[index].named) continue;
      Minima found;
      const std::size_t count = minima(index, at, radius_m + seen_m, found);
      for (std::size_t m = 0; m < count; ++m) {
        if (found[m].distance_m < kSurface_m) return gone_m * along;
        const double approach_m = seen_m * (found[m].point_m - at).dot(along) / found[m].distance_m;
        if (approach_m > kSlides * seen_m && found[m].distance_m - radius_m < approach_m) return gone_m * along;
      }
    }
    gone_m = std::min(length_m, gone_m + seen_m);
  }
  return gone_m * along;
}

}  // namespace haptic
