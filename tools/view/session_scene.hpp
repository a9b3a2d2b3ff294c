#pragma once
/// @file session_scene.hpp
/// From a session file to what the page shows of it.
#include <vector>

#include "rtbus/config/session.hpp"
#include "rtbus/shapes/shapes.hpp"
#include "tools/cli/still/still_frame.hpp"
#include "tools/view/frame_source.hpp"

namespace view {

/// Contacts that the viewer finds itself are shown when they are nearer than this [m].
inline constexpr double kReach_m = 2e-3;

struct SessionHand {
  tools::StillHandConfig config;
  double force_limit_n = 0.0;
  std::vector<rtbus::shapes::PlacedShape> shapes;  ///< Without physics: what the haptic loop knows of the world.
};

struct SessionScene {
  ViewScene scene;                 ///< Without its number.
  std::vector<SessionHand> hands;  ///< In the order of the scene document.
  bool moving = false;             ///< Some body is not static: there are poses.
  bool yields = false;             ///< There are soft bodies.
};

/// Reads the parts of the nodes, too. Throws rtbus::config::Error.
[[nodiscard]] SessionScene scene_of(rtbus::config::SessionConfig& session);

}  // namespace view
