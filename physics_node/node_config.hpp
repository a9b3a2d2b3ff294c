#pragma once
/// @file node_config.hpp
/// What the physics node reads of a session file: the `physics` map, and of each haptic entry the `proxy` map.
/// config/README.md lists every key.
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "physics_node/engine/engine_module.hpp"
#include "rtbus/config/document.hpp"
#include "rtbus/config/session.hpp"
#include "rtbus/config/shared_keys.hpp"

namespace physics {

/// Relative damping of a proxy on its spring when the file gives none.
inline constexpr double kDefaultDampingRatio = 0.7;

/// What paces the steps.
enum class Pace : std::uint8_t {
  kFixed,  ///< One step of 1/rate_hz (or of 1/throttle_hz) in every such period.
  kFree,   ///< Steps back to back, each as long as the time since the last began: Node has the bounds.
};

/// `physics:`
struct PhysicsConfig {
  std::string engine = "analytic";  ///< A row of engine_registry.cpp.
  Pace pace = Pace::kFixed;
  double rate_hz = 1000.0;  ///< Steps per second; throttled: 1/rate_hz is the longest part of a step; free: step.
  std::optional<double> throttle_hz;  ///< Imitates a slow computer: so many steps per second.
  int substeps = 1;                   ///< Equal parts that each 1/rate_hz of simulated time is cut into.
  /// `step_on: packet`: no clock; each packet of the first haptic node, so many per second, makes a step.
  std::optional<double> packet_rate_hz;
  int solver_iterations = 10;              ///< Of an engine that solves contacts by iteration; analytic does not.
  bool contacts_always = false;            ///< Publish contact constraints also when no method asks for them.
  std::vector<std::string> command;        ///< `engine: external`: what `rtbus run` starts; empty: it waits for it.
  std::optional<double> contact_radius_m;  ///< How far around the proxy they reach; none: Stepper::contact_radius_m().

  [[nodiscard]] EngineSettings engine_settings() const noexcept { return {solver_iterations}; }
  /// Simulated time of one step, which is also the period in which it happens; pace free: the longest [s].
  [[nodiscard]] double step_s() const noexcept { return 1.0 / steps_per_s(); }
  /// Declared rate of the steps: the throttle's, the packets', or rate_hz.
  [[nodiscard]] double steps_per_s() const noexcept;
  /// Parts that one step is cut into.
  [[nodiscard]] int parts_per_step() const noexcept;
  [[nodiscard]] const char* clock() const noexcept;  ///< "fixed", "throttled" or "free", as NodeInfo says it.
};

/// `haptic.<n>.proxy:`. Gains are at the device; see Stepper for what they become in the world.
struct ProxyConfig {
  std::string device;                                           ///< Name of the haptic node.
  double mass_kg = rtbus::config::ProxyBodyConfig{}.mass_kg;    ///< In the world.
  double radius_m = rtbus::config::ProxyBodyConfig{}.radius_m;  ///< In the world; 0: a point.
  double friction = 1.0;                                        ///< Multiplied with the body's.
  double stiffness_n_per_m = 0.0;           ///< At the device; default: the entry's coupling.stiffness_n_per_m.
  std::optional<double> damping_n_s_per_m;  ///< At the device; none: kDefaultDampingRatio on the proxy's mass.
  double lead_steps = 0.0;  ///< The proxy is pulled to the device's predicted position so many steps later.
  Eigen::Vector3d position_m = Eigen::Vector3d::Zero();  ///< p_WP until the device first speaks.
  rtbus::config::LinkConfig wire;                        ///< Form of the method; how packets come.
  double rate_hz = 1000.0;                               ///< Of the haptic loop.
};

struct NodeConfig {
  rtbus::Session session;
  rtbus::config::Scene scene;
  PhysicsConfig physics;
  std::vector<ProxyConfig> proxies;  ///< One per haptic entry, in the file's order.
  std::vector<int> haptic_cores;     ///< CPUs of the haptic loops, likewise; −1: `auto`.
  std::string file;
  std::vector<std::string> warnings;  ///< About what the file allows and hardly means: sentences for the user.

  /// Of the scene that the world simulates; 0: the world is an external engine's own.
  [[nodiscard]] std::uint64_t shape_hash() const { return physics.engine == "external" ? 0 : scene.shape_hash(); }
};

/// Reads and finishes the `physics` map. Throws rtbus::config::Error.
/// @param wire Of the first haptic entry: with the paper's form, physics steps on packets unless told otherwise.
[[nodiscard]] PhysicsConfig read_physics_config(rtbus::config::Map& map, const rtbus::config::LinkConfig& wire = {});

/// Reads `proxy`, the keys of the link, and of `coupling` the stiffness. Leaves the rest of the entry, and its
/// finish(), to the haptic node's reader. Throws rtbus::config::Error.
[[nodiscard]] ProxyConfig read_proxy_config(rtbus::config::HapticEntry& entry);

/// All of it. A program that checks a whole session calls this and haptic::read_haptic_config() for each entry, in any
/// order: neither takes keys away from the other. Throws rtbus::config::Error, also when there is no `physics` map.
[[nodiscard]] NodeConfig read_node_config(rtbus::config::SessionConfig& session);

}  // namespace physics
