#include "tools/view/session_scene.hpp"

#include <algorithm>
#include <optional>
#include <utility>

#include "haptic_node/node_config.hpp"
#include "physics_node/node_config.hpp"
#include "rtbus/eigen.hpp"
#include "tools/view/scene_document.hpp"

namespace view {

namespace {

SceneHand scene_hand(const haptic::HapticConfig& config, const tools::StillHandConfig& hand) {
  const drivers::DeviceInfo& device = config.device->info();
  SceneHand out;
  out.name = config.name;
  out.device = device.model;
  out.method = config.method;
  out.rate_hz = config.rate_hz;
  out.radius_m = hand.radius_m;
  out.force_limit_n = config.safety.max_force_n;
  out.q_WD = hand.q_WD;
  out.position_scale = hand.position_scale;
  out.workspace_min_m = rtbus::vector_of(device.workspace_min_m);
  out.workspace_max_m = rtbus::vector_of(device.workspace_max_m);
  return out;
}

}  // namespace

SessionScene scene_of(rtbus::config::SessionConfig& session) {
  std::optional<physics::NodeConfig> physics;
  if (session.physics) physics = physics::read_node_config(session);
  SessionScene out;
  std::vector<SceneHand> shown;
  for (std::size_t i = 0; i < session.haptic.size(); ++i) {
    const haptic::HapticConfig config = haptic::read_haptic_config(session, i);
    tools::StillHandConfig hand = tools::hand_config(config, physics ? &*physics : nullptr);
    shown.push_back(scene_hand(config, hand));
    out.hands.push_back({std::move(hand), config.safety.max_force_n, {}});
    if (!session.physics) out.hands.back().shapes = session.scene.static_shapes();
  }
  out.scene = make_view_scene(session.scene, session.session.name, shown);
  const auto& bodies = session.scene.bodies;
  out.moving = std::any_of(bodies.begin(), bodies.end(),
                           [](const auto& body) { return body.type != rtbus::config::BodyType::kStatic; });
  out.yields = !session.scene.soft_bodies.empty();
  return out;
}

}  // namespace view
