#pragma once
/// @file node_config.hpp
/// One entry of `haptic:` in a session file, checked. config/README.md lists every key.
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "drivers/registry/registry.hpp"
#include "haptic_node/gains.hpp"
#include "haptic_node/link_monitor.hpp"
#include "haptic_node/rendering/mapping.hpp"
#include "haptic_node/safety.hpp"
#include "haptic_node/velocity.hpp"
#include "haptic_node/workspace_walls.hpp"
#include "rtbus/config/document.hpp"
#include "rtbus/config/session.hpp"
#include "rtbus/config/shared_keys.hpp"
#include "rtbus/realtime.hpp"
#include "rtbus/shapes/known_shape.hpp"
#include "rtbus/shapes/shapes.hpp"

namespace haptic {

enum class LoopClock : std::uint8_t { kTimer, kDevice };

/// Another haptic node of the session.
struct OtherHandConfig {
  std::uint32_t number = 0;  ///< In the session's order.
  std::string name;
};

struct HapticConfig {
  std::string name;  ///< "haptic0"
  double rate_hz = 1000.0;
  LoopClock clock = LoopClock::kTimer;
  std::string method;                    ///< A row of rendering/registry.cpp.
  rtbus::config::LinkConfig wire;        ///< Form of the method, and how packets go to physics.
  double set_point_delay_s = 0.0;        ///< Over a network: from the hand to the set-point that answers it; else 0.
  double prediction_periods = 0.0;       ///< Horizon of eq. (4), in physics steps.
  rtbus::config::ProxyBodyConfig proxy;  ///< The mass is read by methods that simulate the proxy themselves.
  double stiffness_requested_n_per_m = 0.0;
  double stiffness_n_per_m = 0.0;  ///< Rendered: lowered to what device and rate allow.
  double damping_requested_n_s_per_m = 0.0;
  /// Rendered: lowered to what mass, rate and velocity filter can carry; of `remote_virtual_coupling`, as improved, at
  /// least a fifth of critical where physics is slow, two fifths over a network.
  double damping_n_s_per_m = 0.0;
  GainLimits gain_limits;
  bool adjustable_stiffness = false, adjustable_damping = false;  ///< `adjustable`: orders may change them.
  double extra_force_max_n = 0.0;  ///< Orders may add so much to the force on the hand; 0: none.
  MappingConfig mapping;
  int clutch_button = -1;  ///< −1: no clutch.
  int enable_button = -1;  ///< −1: forces act from the start; else only while this button is held.
  int estop_button = -1;   ///< −1: none. Pressed: zero force until re-armed by an order.
  double velocity_cutoff_hz = 100.0;
  VelocityConfig velocity;
  SafetyConfig safety;
  WorkspaceWalls walls;
  LinkMonitorConfig link;
  bool realtime_enforce = false;
  rtbus::RealtimeRequest realtime;
  double spin_s = 0.0;  ///< Tail of each sleep that is spent spinning.
  std::unique_ptr<drivers::DeviceConfig> device;
  std::vector<rtbus::shapes::PlacedShape> shapes;  ///< Static analytic bodies of the scene.
  std::vector<rtbus::shapes::KnownShape> known;    ///< Of the scene, for a method that finds contacts by itself …
  std::uint64_t shape_hash = 0;  ///< … and Scene::shape_hash(), which answers of physics must have; 0: any.
  std::vector<OtherHandConfig> other_hands;  ///< For a method that feels them.
  bool telemetry_always = false;             ///< Not of the file: telemetry is published though nobody observes it.
  std::vector<std::string> warnings;         ///< About what the file allows and hardly means: sentences for the user.

  [[nodiscard]] std::uint64_t period_ns() const noexcept;
  [[nodiscard]] bool asks_physics() const noexcept;  ///< Its method needs one.
  [[nodiscard]] Gains gains() const noexcept { return {stiffness_n_per_m, damping_n_s_per_m}; }
  /// K_max = 2(b − |B|)/T [N/m]: the stiffest sampled wall that this device renders passively by its own viscous
  /// damping alone; negative: none (J. E. Colgate, G. Schenkel, "Passivity of a class of sampled-data systems", J.
  /// Robotic Systems 14(1), 1997).
  [[nodiscard]] double passive_stiffness_n_per_m() const noexcept;
};

/// Reads entry `index` of the session. Throws rtbus::config::Error.
[[nodiscard]] HapticConfig read_haptic_config(rtbus::config::SessionConfig& session, std::size_t index);

}  // namespace haptic
