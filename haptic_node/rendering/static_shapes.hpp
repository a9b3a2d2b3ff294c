#pragma once
/// @file static_shapes.hpp
/// Static bodies whose true shape the loop knows. Frame W, SI units.
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include <Eigen/Core>

#include "haptic_node/rendering/tuning.hpp"
#include "rtbus/realtime.hpp"
#include "rtbus/shapes/standing_shape.hpp"

namespace haptic {

/// @realtime Everything but the constructor.
class StaticShapes {
 public:
  /// Of one surface in one step. A smooth one has one, a crease two, a corner three.
  static constexpr std::size_t kMinima = 8;
  using Minima = std::array<rtbus::shapes::Surface::Minimum, kMinima>;
  /// A proxy whose centre is this near to a surface has no normal of its own: its contact stays as it was.
  static constexpr double kSurface_m = 1e-6;

  /// A surface that the last answer named.
  struct Named {
    bool named = false;
    std::size_t body = 0;  ///< Its place among the bodies of the local world.
    double friction = 0.0;
  };

  StaticShapes(std::vector<rtbus::shapes::StandingShape> shapes, const Tuning& tuning)
      : tuning_(tuning), shapes_(std::move(shapes)), nearest_(shapes_.size()), named_(shapes_.size()) {}

  /// @returns which one that body of the scene is; −1: none.
  [[nodiscard]] int index_of(std::uint32_t body) const noexcept RTBUS_NONBLOCKING;
  [[nodiscard]] bool is_surface(int index) const noexcept { return shape(index).surface() != nullptr; }

  /// The point of a hull that is nearest to the proxy, and the direction from there to the proxy.
  /// @returns false inside of it, on it, and where it is no hull.
  [[nodiscard]] bool nearest_of_hull(int index, const Eigen::Vector3d& proxy_m, Eigen::Vector3d& point_m,
                                     Eigen::Vector3d& normal) noexcept RTBUS_NONBLOCKING;

  /// Where the distance of a surface to the proxy has a minimum, within `reach_m`; points in W. @returns how many.
  [[nodiscard]] std::size_t minima(std::size_t index, const Eigen::Vector3d& proxy_m, double reach_m,
                                   Minima& out) const noexcept RTBUS_NONBLOCKING;

  /// A surface of triangles has no inside: whether a proxy of that size can be held by it.
  [[nodiscard]] bool holds(double radius_m) const noexcept { return radius_m >= tuning_.least_proxy_m; }

  void forget_names() noexcept RTBUS_NONBLOCKING;
  void name(int index, const Named& named) noexcept RTBUS_NONBLOCKING;
  [[nodiscard]] bool any_named() const noexcept { return any_named_; }
  [[nodiscard]] const std::vector<Named>& named() const noexcept { return named_; }

  /// How far from the proxy a step looks for surfaces. @param speed_m_s Of the proxy.
  [[nodiscard]] double look_m(double speed_m_s, double h) const noexcept RTBUS_NONBLOCKING;
  /// How far along `way_m` the proxy can go: the rows of a step know surfaces as far as `seen_m`.
  [[nodiscard]] Eigen::Vector3d free_way_m(const Eigen::Vector3d& proxy_m, double radius_m,
                                           const Eigen::Vector3d& way_m,
                                           double seen_m) const noexcept RTBUS_NONBLOCKING;

 private:
  [[nodiscard]] const rtbus::shapes::StandingShape& shape(int index) const noexcept {
    return shapes_[static_cast<std::size_t>(index)];
  }

  Tuning tuning_;
  std::vector<rtbus::shapes::StandingShape> shapes_;
  std::vector<rtbus::shapes::NearestFeature> nearest_;  ///< Of the last query of each hull.
  std::vector<Named> named_;                            ///< Of each; hulls are none.
  bool any_named_ = false;
};

}  // namespace haptic
