#pragma once
/// @file known_boxes.hpp
/// Boxes that forces move, and what stands under them: shapes that the scene tells, so that the loop finds by itself
/// where a box lies. Frame W, SI units.
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <utility>
#include <variant>
#include <vector>

#include <Eigen/Core>

#include "rtbus/realtime.hpp"
#include "rtbus/shapes/shapes.hpp"

namespace haptic {

/// @realtime Everything but the constructor.
class KnownBoxes {
 public:
  KnownBoxes() = default;
  /// @param holders Static bodies. @param boxes Around their bodies' centres; which body, in the scene's order.
  KnownBoxes(std::vector<rtbus::shapes::PlacedShape> holders,
             std::vector<std::pair<std::uint32_t, rtbus::shapes::Box>> boxes)
      : holders_(std::move(holders)), boxes_(std::move(boxes)) {}

  /// @returns nullptr where that body is no box.
  [[nodiscard]] const rtbus::shapes::Box* box_of(std::uint32_t body) const noexcept RTBUS_NONBLOCKING {
    const auto found = std::lower_bound(boxes_.begin(), boxes_.end(), body,
                                        [](const auto& each, std::uint32_t index) { return each.first < index; });
    return found != boxes_.end() && found->first == body ? &found->second : nullptr;
  }

  /// The plane or box whose surface is there and looks that way; nullptr: none that is known.
  [[nodiscard]] const rtbus::shapes::PlacedShape* holder_at(
      const Eigen::Vector3d& point_m, const Eigen::Vector3d& normal) const noexcept RTBUS_NONBLOCKING {
    for (const rtbus::shapes::PlacedShape& holder : holders_) {
      if (std::holds_alternative<rtbus::shapes::Sphere>(holder.shape)) continue;
      const rtbus::shapes::SurfacePoint nearest = rtbus::shapes::nearest_surface(holder, point_m);
      if (std::abs(nearest.distance_m) <= kAtSurface_m && nearest.normal.dot(normal) >= kSameWay) return &holder;
    }
    return nullptr;
  }

 private:
  static constexpr double kAtSurface_m = 1e-3;  ///< An engine lets bodies sink in, or keeps them apart, by less.
  static constexpr double kSameWay = 0.95;      ///< 18 degrees.

  std::vector<rtbus::shapes::PlacedShape> holders_;
  std::vector<std::pair<std::uint32_t, rtbus::shapes::Box>> boxes_;
};

}  // namespace haptic
