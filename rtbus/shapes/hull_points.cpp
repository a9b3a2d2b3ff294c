#include "rtbus/shapes/hull_points.hpp"

#include <algorithm>
#include <array>
#include <cstddef>
#include <limits>

namespace rtbus::shapes {

using Eigen::Vector3d;

/// A point that is lower by less than this part of `higher_m` is as high: what lies on many keeps its four.
constexpr double kSame = 1e-3;

void hull_points(const Hull& held, const Eigen::Quaterniond& q_WB, const Vector3d& p_WB, const Face& face,
                 FacePoints& out, double higher_m) noexcept {
  out.count = 0;
  if (held.points_m.empty()) return;
  out.normal = face.normal;
  // In the hull's frame, where each point is looked at once for its height.
  const Vector3d up = q_WB.conjugate() * out.normal;
  const double origin_m = out.normal.dot(p_WB - face.centre_m);
  const std::size_t count = std::min(held.points_m.size(), Hull::kMost);
  std::array<double, Hull::kMost> height_m;
  std::size_t lowest = 0;
  double low_m = std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < count; ++i) {
    height_m[i] = up.dot(held.points_m[i]);
    if (height_m[i] >= low_m) continue;
    low_m = height_m[i];
    lowest = i;
  }
  Eigen::Index axis = 0;
  (void)up.cwiseAbs().minCoeff(&axis);
  const Vector3d u = up.cross(Vector3d::Unit(axis)).normalized(), v = up.cross(u);
  // Ahead, back, and to the sides along the diagonals of u and v.
  std::array<std::size_t, FacePoints::kMost> far;
  far.fill(lowest);
  std::array<double, FacePoints::kMost> far_height_m;
  far_height_m.fill(low_m);
  std::array<double, FacePoints::kMost> most_m;
  most_m.fill(-std::numeric_limits<double>::infinity());
  for (std::size_t i = 0; i < count; ++i) {
    if (height_m[i] > low_m + higher_m) continue;
    const double along_m = u.dot(held.points_m[i]), across_m = v.dot(held.points_m[i]);
    const std::array<double, FacePoints::kMost> way_m{along_m + across_m, along_m - across_m, -along_m - across_m,
                                                      across_m - along_m};
    for (std::size_t k = 0; k < way_m.size(); ++k) {
      if (way_m[k] <= most_m[k]) continue;
      most_m[k] = way_m[k];
      far[k] = i;
      far_height_m[k] = height_m[i];
    }
  }
  const auto [least, most] = std::minmax_element(far_height_m.begin(), far_height_m.end());
  if (*least > low_m + kSame * higher_m) {
    const auto highest = static_cast<std::size_t>(most - far_height_m.begin());
    far[highest] = lowest;
    far_height_m[highest] = low_m;
  }
  for (std::size_t k = 0; k < far.size(); ++k) {
    if (std::find(far.begin(), far.begin() + static_cast<std::ptrdiff_t>(k), far[k]) !=
        far.begin() + static_cast<std::ptrdiff_t>(k)) {
      continue;
    }
    out.point_m[out.count] = p_WB + q_WB * held.points_m[far[k]];
    out.gap_m[out.count++] = origin_m + far_height_m[k];
  }
}

}  // namespace rtbus::shapes
