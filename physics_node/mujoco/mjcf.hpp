#pragma once
/// @file mjcf.hpp
/// A scene of ours as MuJoCo's XML (MJCF). Geoms are named b0, b1, … in the scene's order, as are
/// the bodies that move; tools t0, t1, …
#include <string>
#include <vector>

#include "rtbus/config/scene.hpp"

namespace mujoco {

/// A tool: a ball that can be moved along three axes.
struct ToolShape {
  double radius_m = 0.0;  ///< 0: a point, which becomes a ball of kPoint_m.
  double mass_kg = 0.1;
};
inline constexpr double kPoint_m = 1e-4;

/// Throws rtbus::config::Error, which names the body, for what MuJoCo 2.2 cannot do: soft bodies, concave meshes,
/// restitution, bodies that move by themselves.
[[nodiscard]] std::string mjcf_of(const rtbus::config::Scene& scene, const std::vector<ToolShape>& tools,
                                  double timestep_s, double reach_m);

}  // namespace mujoco
