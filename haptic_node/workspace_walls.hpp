#pragma once
/// @file workspace_walls.hpp
/// Soft walls a little inside the workspace, so that the hand meets a spring before the end stops. Per axis of D:
/// F = K·d − B·v while the tip is beyond a wall by d, never pulling outward. Added to the method's force before the
/// safety ladder. Off unless the session asks for it.
#include <algorithm>
#include <cstddef>

#include <Eigen/Core>

#include "drivers/device.hpp"
#include "rtbus/realtime.hpp"

namespace haptic {

struct WorkspaceWalls {
  double stiffness_n_per_m = 0.0;  ///< 0: none.
  double damping_n_s_per_m = 0.0;
  drivers::Vec3 min_m{};  ///< Of the walls, frame D.
  drivers::Vec3 max_m{};

  [[nodiscard]] bool exist() const noexcept { return stiffness_n_per_m > 0.0; }

  /// [N], frame D. @realtime Yes.
  [[nodiscard]] Eigen::Vector3d force_n(const Eigen::Vector3d& position_m,
                                        const Eigen::Vector3d& velocity_m_s) const noexcept RTBUS_NONBLOCKING {
    Eigen::Vector3d out = Eigen::Vector3d::Zero();
    for (int axis = 0; axis < 3; ++axis) {
      const auto i = static_cast<std::size_t>(axis);
      const double below_m = min_m[i] - position_m[axis];
      const double above_m = position_m[axis] - max_m[i];
      const double damper_n = damping_n_s_per_m * velocity_m_s[axis];
      if (below_m > 0.0) out[axis] = std::max(0.0, stiffness_n_per_m * below_m - damper_n);
      if (above_m > 0.0) out[axis] = std::min(0.0, -stiffness_n_per_m * above_m - damper_n);
    }
    return out;
  }
};

}  // namespace haptic
