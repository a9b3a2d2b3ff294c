#pragma once
/// @file standing_shape.hpp
/// The true shape of a body that never moves.
#include <cstdint>
#include <memory>
#include <variant>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "rtbus/shapes/hull.hpp"
#include "rtbus/shapes/surface.hpp"

namespace rtbus::shapes {

/// A body that never moves: its shape, which one it is, and where.
struct StandingShape {
  std::variant<Hull, std::shared_ptr<const Surface>> shape;
  std::uint32_t body = 0;  ///< In the scene's order.
  Eigen::Quaterniond q_WB = Eigen::Quaterniond::Identity();
  Eigen::Vector3d p_WB = Eigen::Vector3d::Zero();

  /// @returns nullptr where it is no surface. @realtime Yes.
  [[nodiscard]] const Surface* surface() const noexcept {
    const auto* const held = std::get_if<std::shared_ptr<const Surface>>(&shape);
    return held != nullptr ? held->get() : nullptr;
  }
};

}  // namespace rtbus::shapes
