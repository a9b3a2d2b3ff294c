#pragma once
/// @file known_shape.hpp
/// The true shape of a body, for a loop that finds contacts by itself.
#include <cstdint>
#include <memory>
#include <variant>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "rtbus/shapes/hull.hpp"
#include "rtbus/shapes/shapes.hpp"
#include "rtbus/shapes/surface.hpp"

namespace rtbus::shapes {

/// A body of the scene: its shape, in the body's frame, which body it is, and where it stands, if it does.
struct KnownShape {
  std::variant<Plane, Box, Capsule, Cylinder, Hull, std::shared_ptr<const Surface>> shape;
  std::uint32_t body = 0;                                    ///< In the scene's order.
  bool stands = true;                                        ///< It never moves; so does every surface.
  Eigen::Quaterniond q_WB = Eigen::Quaterniond::Identity();  ///< Of what stands …
  Eigen::Vector3d p_WB = Eigen::Vector3d::Zero();            ///< … likewise.

  /// @returns nullptr where it is no surface. @realtime Yes.
  [[nodiscard]] const Surface* surface() const noexcept {
    const auto* const held = std::get_if<std::shared_ptr<const Surface>>(&shape);
    return held != nullptr ? held->get() : nullptr;
  }
};

}  // namespace rtbus::shapes
