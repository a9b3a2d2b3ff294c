#pragma once
/// @file known_shapes.hpp
/// The shapes that the scene tells, by body: so the loop finds by itself where a body is met, and where a box lies.
/// Frame W, SI units.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <span>
#include <utility>
#include <variant>
#include <vector>

#include <Eigen/Core>

#include "rtbus/realtime.hpp"
#include "rtbus/shapes/known_shape.hpp"

namespace haptic {

/// Does not change once it is made. @realtime Everything but the constructor.
class KnownShapes {
 public:
  using Shape = rtbus::shapes::KnownShape;

  KnownShapes() = default;
  /// @param shapes At most one for each body.
  KnownShapes(std::vector<Shape> shapes) : shapes_(std::move(shapes)) {  // NOLINT(google-explicit-constructor)
    const auto by_body = [](const Shape& a, const Shape& b) { return a.body < b.body; };
    std::stable_sort(shapes_.begin(), shapes_.end(), by_body);
    for (const Shape& each : shapes_) {
      if (!each.stands) continue;
      if (std::holds_alternative<rtbus::shapes::Plane>(each.shape)) {
        holders_.push_back({rtbus::shapes::Plane{}, each.q_WB, each.p_WB});
      } else if (const auto* const box = std::get_if<rtbus::shapes::Box>(&each.shape)) {
        holders_.push_back({*box, each.q_WB, each.p_WB});
      }
    }
    for (std::size_t i = 0; i < shapes_.size(); ++i) {
      if (shapes_[i].surface() != nullptr) meshes_.push_back(i);
    }
  }

  [[nodiscard]] std::size_t size() const noexcept { return shapes_.size(); }
  [[nodiscard]] const Shape& operator[](int index) const noexcept { return shapes_[static_cast<std::size_t>(index)]; }

  /// @returns which one that body of the scene is; −1: none.
  [[nodiscard]] int index_of(std::uint32_t body) const noexcept RTBUS_NONBLOCKING {
    const auto found = std::lower_bound(shapes_.begin(), shapes_.end(), body,
                                        [](const Shape& each, std::uint32_t wanted) { return each.body < wanted; });
    return found != shapes_.end() && found->body == body ? static_cast<int>(found - shapes_.begin()) : -1;
  }

  /// @returns the shape of a body that moves; nullptr: it is none, or not known.
  [[nodiscard]] const Shape* mover_of(std::uint32_t body) const noexcept RTBUS_NONBLOCKING {
    const int index = index_of(body);
    return index < 0 || (*this)[index].stands ? nullptr : &(*this)[index];
  }

  /// Whether that body moves, and its corners are known: those of a box or a hull, or the rim of a cylinder.
  [[nodiscard]] bool has_corners(std::uint32_t body) const noexcept RTBUS_NONBLOCKING {
    const Shape* const mover = mover_of(body);
    return mover != nullptr && (std::holds_alternative<rtbus::shapes::Box>(mover->shape) ||
                                std::holds_alternative<rtbus::shapes::Hull>(mover->shape) ||
                                std::holds_alternative<rtbus::shapes::Cylinder>(mover->shape));
  }

  /// Planes and boxes that stand.
  [[nodiscard]] std::span<const rtbus::shapes::PlacedShape> holders() const noexcept { return holders_; }

  /// The plane or box that stands, whose surface is there, and that `holds` what is asked for; nullptr: none that is
  /// known.
  template <class Holds>
  [[nodiscard]] const rtbus::shapes::PlacedShape* holder_at(const Eigen::Vector3d& point_m,
                                                            const Holds& holds) const noexcept RTBUS_NONBLOCKING {
    for (const rtbus::shapes::PlacedShape& holder : holders_) {
      if (std::abs(rtbus::shapes::nearest_surface(holder, point_m).distance_m) > kAtSurface_m) continue;
      if (holds(holder)) return &holder;
    }
    return nullptr;
  }

  /// Whether a mesh is there, and looks along `normal`. @param point_m In W. @param normal Unit, in W.
  [[nodiscard]] bool has_mesh_at(const Eigen::Vector3d& point_m,
                                 const Eigen::Vector3d& normal) const noexcept RTBUS_NONBLOCKING {
    const Eigen::Vector3d above_m = point_m + kAtSurface_m * normal;
    return std::any_of(meshes_.begin(), meshes_.end(), [&](std::size_t mesh) {
      const Shape& each = shapes_[mesh];
      const Eigen::Vector3d p_m = each.q_WB.conjugate() * (above_m - each.p_WB);
      std::array<rtbus::shapes::Surface::Minimum, 1> nearest;
      if (each.surface()->minima(p_m, 2.0 * kAtSurface_m, nearest) == 0) return false;
      const Eigen::Vector3d way_m = each.q_WB * (p_m - nearest[0].point_m);
      return normal.dot(way_m) > kFlat * nearest[0].distance_m;
    });
  }

 private:
  static constexpr double kAtSurface_m = 1e-3;  ///< An engine lets bodies sink in, or keeps them apart, by less.
  static constexpr double kFlat = 0.9998;       ///< A cosine: 20 mrad.

  std::vector<Shape> shapes_;  ///< By body.
  std::vector<rtbus::shapes::PlacedShape> holders_;
  std::vector<std::size_t> meshes_;  ///< Their places in shapes_.
};

}  // namespace haptic
