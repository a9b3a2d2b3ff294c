#include "haptic_node/rendering/near_shapes.hpp"

#include <algorithm>
#include <variant>

namespace haptic {
namespace {

using Eigen::Vector3d;
using rtbus::shapes::KnownShape;
using rtbus::shapes::SurfacePoint;

/// What approaches by less than this share of its way slides along.
constexpr double kSlides = 1e-3;

/// Where a body's shape is.
struct Pose {
  Eigen::Quaterniond q_WB;
  Vector3d p_WB;

  [[nodiscard]] Vector3d in_body(const Vector3d& p_W) const noexcept { return q_WB.conjugate() * (p_W - p_WB); }
  [[nodiscard]] Vector3d in_world(const Vector3d& p_B) const noexcept { return p_WB + q_WB * p_B; }
};

Pose pose_of(const KnownShape& known) noexcept { return {known.q_WB, known.p_WB}; }

Pose pose_of(const KnownShape& known, const LocalBody& body) noexcept {
  if (known.stands) return pose_of(known);
  return {body.motion.q_WB, body.motion.centre_m + body.motion.q_WB * body.origin_B_m};
}

/// Outside of an analytic shape. get_if instead of visit: visit has a throwing path.
bool nearest_outside(const KnownShape& known, const Vector3d& p_B, SurfacePoint& out) noexcept {
  if (const auto* const box = std::get_if<rtbus::shapes::Box>(&known.shape)) {
    out = nearest_surface(*box, p_B);
  } else if (const auto* const capsule = std::get_if<rtbus::shapes::Capsule>(&known.shape)) {
    out = nearest_surface(*capsule, p_B);
  } else if (const auto* const cylinder = std::get_if<rtbus::shapes::Cylinder>(&known.shape)) {
    out = nearest_surface(*cylinder, p_B);
  } else {
    return false;  // a told plane is exact
  }
  return out.distance_m > NearShapes::kSurface_m;
}

}  // namespace

bool NearShapes::nearest(const LocalBody& body, const Vector3d& proxy_m, Vector3d& point_m, Vector3d& normal) noexcept {
  if (body.shape < 0) return false;
  const KnownShape& known = (*known_)[body.shape];
  const Pose pose = pose_of(known, body);
  const Vector3d proxy_B = pose.in_body(proxy_m);
  SurfacePoint nearest_B;
  if (const auto* const hull = std::get_if<rtbus::shapes::Hull>(&known.shape)) {
    if (!nearest_point(*hull, proxy_B, nearest_[static_cast<std::size_t>(body.shape)], nearest_B.point_m)) return false;
    const Vector3d way_B = proxy_B - nearest_B.point_m;
    nearest_B.distance_m = way_B.norm();
    if (nearest_B.distance_m < kSurface_m) return false;  // the direction of what is left is rounding
    nearest_B.normal = way_B / nearest_B.distance_m;
  } else if (!nearest_outside(known, proxy_B, nearest_B)) {
    return false;
  }
  normal = pose.q_WB * nearest_B.normal;
  point_m = pose.in_world(nearest_B.point_m);
  return true;
}

std::size_t NearShapes::minima(int shape, const Vector3d& proxy_m, double reach_m, Minima& out) noexcept {
  if (asked_.shape != shape || asked_.proxy_m != proxy_m || asked_.reach_m != reach_m) {
    const KnownShape& known = (*known_)[shape];
    const Pose pose = pose_of(known);
    asked_.found = known.surface()->minima(pose.in_body(proxy_m), reach_m, asked_.minima);
    for (std::size_t m = 0; m < asked_.found; ++m) asked_.minima[m].point_m = pose.in_world(asked_.minima[m].point_m);
    asked_.shape = shape, asked_.proxy_m = proxy_m, asked_.reach_m = reach_m;
  }
  std::copy_n(asked_.minima.begin(), asked_.found, out.begin());
  return asked_.found;
}

void NearShapes::name(const Named& named) noexcept {
  if (!is_named(named.shape) && named_count_ < named_.size()) named_[named_count_++] = named;
}

bool NearShapes::is_named(int shape) const noexcept {
  const auto each = named();
  return std::any_of(each.begin(), each.end(), [shape](const Named& known) { return known.shape == shape; });
}

double NearShapes::look_m(double speed_m_s, double h) const noexcept {
  return h * std::clamp(2.0 * speed_m_s, tuning_.recovery_m_s, tuning_.fast_look_m_s);
}

Vector3d NearShapes::free_way_m(const Vector3d& proxy_m, double radius_m, const Vector3d& way_m,
                                double seen_m) noexcept {
  const double length_m = way_m.norm();
  if (length_m <= seen_m) return way_m;
  const Vector3d along = way_m / length_m;
  double gone_m = seen_m;
  for (int look = 1; look < static_cast<int>(tuning_.parts) && gone_m < length_m; ++look) {
    const Vector3d at = proxy_m + gone_m * along;
    for (const Named& each : named()) {
      Minima found;
      const std::size_t count = minima(each.shape, at, radius_m + seen_m, found);
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
