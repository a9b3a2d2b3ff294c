#include "rtbus/shapes/hull_points.hpp"

#include <algorithm>
#include <array>
#include <cstddef>
#include <limits>
#include <variant>

namespace rtbus::shapes {
namespace {

using Eigen::Vector3d;

/// So much higher a point may be: what tips back touches with it again before it has sunk in.
constexpr double kHigher_m = 1e-3;

}  // namespace

void hull_points(const Hull& held, const Eigen::Quaterniond& q_WB, const Vector3d& p_WB, const PlacedShape& plane,
                 FacePoints& out) noexcept {
  out.count = 0;
  if (!std::holds_alternative<Plane>(plane.shape) || held.points_m.empty()) return;
  out.normal = plane.q_WB * Vector3d(Vector3d::UnitY());
  // In the hull's frame: each point is looked at once for its height, and once for the way.
  const Vector3d up = q_WB.conjugate() * out.normal;
  const double origin_m = out.normal.dot(p_WB - plane.p_WB);
  std::size_t lowest = 0;
  for (std::size_t i = 1; i < held.points_m.size(); ++i) {
    if (up.dot(held.points_m[i]) < up.dot(held.points_m[lowest])) lowest = i;
  }
  const double most_m = up.dot(held.points_m[lowest]) + kHigher_m;
  Eigen::Index axis = 0;
  (void)up.cwiseAbs().minCoeff(&axis);
  const Vector3d u = up.cross(Vector3d::Unit(axis)).normalized(), v = up.cross(u);
  const std::array<Vector3d, FacePoints::kMost> ways{u + v, u - v, -u - v, v - u};
  std::array<std::size_t, FacePoints::kMost> far;
  far.fill(lowest);
  for (std::size_t i = 0; i < held.points_m.size(); ++i) {
    if (up.dot(held.points_m[i]) > most_m) continue;
    for (std::size_t k = 0; k < ways.size(); ++k) {
      if (ways[k].dot(held.points_m[i]) > ways[k].dot(held.points_m[far[k]])) far[k] = i;
    }
  }
  if (std::find(far.begin(), far.end(), lowest) == far.end()) {
    *std::max_element(far.begin(), far.end(), [&](std::size_t a, std::size_t b) {
      return up.dot(held.points_m[a]) < up.dot(held.points_m[b]);
    }) = lowest;
  }
  for (std::size_t k = 0; k < far.size(); ++k) {
    if (std::find(far.begin(), far.begin() + static_cast<std::ptrdiff_t>(k), far[k]) !=
        far.begin() + static_cast<std::ptrdiff_t>(k)) {
      continue;
    }
    out.point_m[out.count] = p_WB + q_WB * held.points_m[far[k]];
    out.gap_m[out.count++] = origin_m + up.dot(held.points_m[far[k]]);
  }
}

}  // namespace rtbus::shapes
