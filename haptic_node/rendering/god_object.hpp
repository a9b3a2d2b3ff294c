#pragma once
/// @file god_object.hpp
/// A point that follows another one among analytic bodies without entering any of them.
#include <vector>

#include <Eigen/Core>

#include "rtbus/realtime.hpp"
#include "rtbus/shapes/shapes.hpp"

namespace haptic {

/// The god-object of C. Zilles and J. K. Salisbury, "A constraint-based god-object method for haptic display", IROS
/// 1995: the point outside all bodies that the goal can reach by sliding, without friction. All lengths in W.
/// @realtime Everything but construction: bounded, no allocation.
class GodObject {
 public:
  /// @param shapes Static, convex.
  explicit GodObject(std::vector<rtbus::shapes::PlacedShape> shapes);

  /// Puts it onto `p_W`, or onto the nearest face when that is inside a body.
  void place(const Eigen::Vector3d& p_W) noexcept RTBUS_NONBLOCKING;

  /// Moves it as near to `goal_W` as the bodies allow.
  void follow(const Eigen::Vector3d& goal_W) noexcept RTBUS_NONBLOCKING;

  [[nodiscard]] const Eigen::Vector3d& position_m() const noexcept { return position_W_; }
  /// The last follow() or place() was held back by a body.
  [[nodiscard]] bool touching() const noexcept { return touching_; }

 private:
  [[nodiscard]] bool outside_all(const Eigen::Vector3d& p_W) const noexcept RTBUS_NONBLOCKING;

  std::vector<rtbus::shapes::PlacedShape> shapes_;
  std::vector<rtbus::shapes::SurfacePoint> surfaces_;  ///< Of each shape, nearest to the object; sized once.
  bool touching_ = false;
  Eigen::Vector3d position_W_ = Eigen::Vector3d::Zero();
};

}  // namespace haptic
