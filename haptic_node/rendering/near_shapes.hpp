#pragma once
/// @file near_shapes.hpp
/// Where the known shapes of bodies are nearest to the proxy. Frame W, SI units.
#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <utility>
#include <vector>

#include <Eigen/Core>

#include "haptic_node/rendering/known_shapes.hpp"
#include "haptic_node/rendering/local_body.hpp"
#include "haptic_node/rendering/tuning.hpp"
#include "rtbus/contact_messages.hpp"
#include "rtbus/realtime.hpp"

namespace haptic {

/// @realtime Everything but the constructor.
class NearShapes {
 public:
  /// Of one surface in one step.
  using Minima = std::array<rtbus::shapes::Surface::Minimum, rtbus::shapes::Surface::kMostMinima>;
  /// A proxy whose centre is this near to a surface has no normal of its own: its contact stays as it was.
  static constexpr double kSurface_m = 1e-6;

  /// A surface that the last answer named.
  struct Named {
    int shape = -1;
    std::size_t body = 0;  ///< Its place among the bodies of the local world.
    double friction = 0.0;
  };

  NearShapes(KnownShapes known, const Tuning& tuning)
      : tuning_(tuning), known_(std::make_shared<const KnownShapes>(std::move(known))), nearest_(known_->size()) {}

  [[nodiscard]] const KnownShapes& known() const noexcept { return *known_; }
  [[nodiscard]] bool is_surface(int shape) const noexcept {
    return shape >= 0 && (*known_)[shape].surface() != nullptr;
  }

  /// The point of a body's convex shape that is nearest to the proxy, and the direction from there to the proxy.
  /// @returns false inside of it, on it, and where the body has no such shape.
  [[nodiscard]] bool nearest(const LocalBody& body, const Eigen::Vector3d& proxy_m, Eigen::Vector3d& point_m,
                             Eigen::Vector3d& normal) noexcept RTBUS_NONBLOCKING;

  /// Where the distance of a surface to the proxy has a minimum, within `reach_m`; points in W. @returns how many.
  /// A tick with an answer asks twice, with it and without it: surfaces stand, so the second time is a copy.
  [[nodiscard]] std::size_t minima(int shape, const Eigen::Vector3d& proxy_m, double reach_m,
                                   Minima& out) noexcept RTBUS_NONBLOCKING;

  /// A surface of triangles has no inside: whether a proxy of that size can be held by it.
  [[nodiscard]] bool holds(double radius_m) const noexcept { return radius_m >= tuning_.least_proxy_m; }

  void forget_names() noexcept RTBUS_NONBLOCKING { named_count_ = 0; }
  void name(const Named& named) noexcept RTBUS_NONBLOCKING;
  [[nodiscard]] bool is_named(int shape) const noexcept RTBUS_NONBLOCKING;
  [[nodiscard]] std::span<const Named> named() const noexcept { return {named_.data(), named_count_}; }

  /// How far from the proxy a step looks for surfaces. @param speed_m_s Of the proxy.
  [[nodiscard]] double look_m(double speed_m_s, double h) const noexcept RTBUS_NONBLOCKING;
  /// How far along `way_m` the proxy can go: the rows of a step know surfaces as far as `seen_m`.
  [[nodiscard]] Eigen::Vector3d free_way_m(const Eigen::Vector3d& proxy_m, double radius_m,
                                           const Eigen::Vector3d& way_m, double seen_m) noexcept RTBUS_NONBLOCKING;

 private:
  Tuning tuning_;
  std::shared_ptr<const KnownShapes> known_;            ///< Bodies point into it, those of a copy too.
  std::vector<rtbus::shapes::NearestFeature> nearest_;  ///< Of the last query of each hull.
  struct Asked {
    int shape = -1;
    Eigen::Vector3d proxy_m = Eigen::Vector3d::Zero();
    double reach_m = 0.0;
    std::size_t found = 0;
    Minima minima;
  };
  Asked asked_;  ///< Last.
  std::array<Named, rtbus::kContactSlots> named_{};
  std::size_t named_count_ = 0;
};

}  // namespace haptic
