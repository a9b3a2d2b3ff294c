#include "haptic_node/rendering/load_shares.hpp"

#include <cstddef>

namespace haptic {
namespace {

/// Corners on a line leave a direction open. [m²]
constexpr double kLine_m2 = 1e-12;

}  // namespace

std::array<double, rtbus::shapes::FacePoints::kMost> load_shares(const rtbus::shapes::FacePoints& corners,
                                                                 const Eigen::Vector3d& at_m) noexcept {
  constexpr std::size_t kMost = rtbus::shapes::FacePoints::kMost;
  const Eigen::Vector3d u = corners.normal.unitOrthogonal(), v = corners.normal.cross(u);
  std::array<double, kMost> x_m{}, y_m{}, out{};
  std::array<bool, kMost> bears{};
  for (std::size_t i = 0; i < corners.count; ++i) {
    x_m[i] = u.dot(corners.point_m[i] - at_m);
    y_m[i] = v.dot(corners.point_m[i] - at_m);
    bears[i] = true;
  }
  for (std::size_t left = corners.count; left > 0; --left) {
    // The shares are a + b·x + c·y (Lagrange), with Σ = 1 and Σ·x = Σ·y = 0.
    double n = 0.0, x = 0.0, y = 0.0, xx = kLine_m2, yy = kLine_m2, xy = 0.0;
    for (std::size_t i = 0; i < corners.count; ++i) {
      if (!bears[i]) continue;
      n += 1.0, x += x_m[i], y += y_m[i];
      xx += x_m[i] * x_m[i], yy += y_m[i] * y_m[i], xy += x_m[i] * y_m[i];
    }
    const double a = xx * yy - xy * xy, b = xy * y - x * yy, c = x * xy - xx * y;
    const double sum = n * a + x * b + y * c;
    std::size_t least = 0;
    for (std::size_t i = 0; i < corners.count; ++i) {
      out[i] = bears[i] ? (a + b * x_m[i] + c * y_m[i]) / sum : 0.0;
      if (out[i] < out[least]) least = i;
    }
    if (out[least] >= 0.0) break;
    bears[least] = false;
    out[least] = 0.0;
  }
  return out;
}

}  // namespace haptic
