#pragma once
/// @file known_boxes.hpp
/// Boxes that forces move, and what stands under them: shapes that the scene tells, so that the loop finds by itself
/// where a box lies. Frame W, SI units.
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <utility>
#include <vector>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "rtbus/realtime.hpp"
#include "rtbus/shapes/face_points.hpp"
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

  /// The plane or box whose surface is there and on which `box` lies, by a contact that looks that way; nullptr: none
  /// that is known. @param corners Of the contact.
  [[nodiscard]] const rtbus::shapes::PlacedShape* holder_of(
      const rtbus::shapes::Box& box, const Eigen::Quaterniond& q_WB, const Eigen::Vector3d& centre_m,
      const Eigen::Vector3d& point_m, const Eigen::Vector3d& normal,
      rtbus::shapes::FacePoints& corners) const noexcept RTBUS_NONBLOCKING {
    for (const rtbus::shapes::PlacedShape& holder : holders_) {
      if (std::abs(rtbus::shapes::nearest_surface(holder, point_m).distance_m) > kAtSurface_m) continue;
      if (!rtbus::shapes::face_points(box, q_WB, centre_m, holder, corners)) continue;
      if (corners.normal.dot(normal) >= kSameWay) return &holder;
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
