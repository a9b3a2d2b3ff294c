#pragma once
/// @file world.hpp
/// The physics abstraction: what a node may ask of any engine. No engine type leaks through it.
/// Frame W: right-handed, y up. SI units. One thread per World.
#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "physics_node/engine/contact_set.hpp"

namespace physics {

/// The tool that a haptic device holds in the world: a sphere on a spring.
struct ProxyParameters {
  std::string device;                                    ///< Haptic node it belongs to, "haptic0".
  double mass_kg = 0.1;                                  ///< In the world.
  double radius_m = 0.0;                                 ///< 0: a point.
  double friction = 0.0;                                 ///< Coulomb coefficient, multiplied with the body's.
  Eigen::Vector3d position_m = Eigen::Vector3d::Zero();  ///< p_WP at start.
  double tick_s = 0.0;                                   ///< Period of the haptic loop; 0: none is known.
};

/// Where the proxy is pulled to, and how hard. Set before each step.
struct ProxyTarget {
  Eigen::Vector3d position_m = Eigen::Vector3d::Zero();    ///< p_WT.
  Eigen::Vector3d velocity_m_s = Eigen::Vector3d::Zero();  ///< v_WT: the damper acts on the relative velocity.
  double stiffness_n_per_m = 0.0;  ///< In the world (device stiffness · force_scale / position_scale).
  double damping_n_s_per_m = 0.0;  ///< In the world, likewise.
  /// Besides the spring: constant over the step, whatever the proxy does meanwhile (an explicit spring, `form: paper`).
  Eigen::Vector3d force_n = Eigen::Vector3d::Zero();
  /// Only of drive_tool(), more of the same. Once the tool has left, those parts that it touched last get it directly.
  Eigen::Vector3d owed_n = Eigen::Vector3d::Zero();
  /// Where the hand is, up to the rotation and the offset of the mapping: how far it moves is what counts.
  Eigen::Vector3d hand_m = Eigen::Vector3d::Zero();
};

/// The proxy after the last step.
struct ProxyReadout {
  Eigen::Vector3d position_m = Eigen::Vector3d::Zero();
  Eigen::Vector3d velocity_m_s = Eigen::Vector3d::Zero();
  Eigen::Quaterniond orientation = Eigen::Quaterniond::Identity();
  Eigen::Vector3d angular_velocity_rad_s = Eigen::Vector3d::Zero();
  Eigen::Vector3d coupling_force_n = Eigen::Vector3d::Zero();  ///< By the spring and the force, mean over the step.
  Eigen::Vector3d contact_force_n = Eigen::Vector3d::Zero();   ///< By the bodies, mean over the step.
  std::uint32_t contacts = 0;
};

/// Where a body is: X_WB.
struct BodyPose {
  Eigen::Vector3d position_m = Eigen::Vector3d::Zero();  ///< p_WB.
  Eigen::Quaterniond orientation = Eigen::Quaterniond::Identity();
};

/// What a kinematic body with `motion: target` is to do.
struct BodyTarget {
  enum class Kind : std::uint8_t { kStay, kPose, kTwist };
  Kind kind = Kind::kStay;
  BodyPose pose;                                           ///< X_WB to go to …
  Eigen::Vector3d velocity_m_s = Eigen::Vector3d::Zero();  ///< … or v_WB to move at.
  Eigen::Vector3d angular_velocity_rad_s = Eigen::Vector3d::Zero();
};

/// In K·tick²: a lighter body than 1 goes farther in a tick than the hand that pushes it. Where a scene has more than
/// kMostTogether bodies below this, they yield (drive_tool): the loop cannot simulate a bed of them.
inline constexpr double kLightest = 2.0;

/// A simulated world. Made by an engine's factory from a checked scene.
class World {
 public:
  virtual ~World() = default;

  /// Adds a proxy; the handle counts from 0 in the order of calls.
  virtual std::size_t add_proxy(const ProxyParameters& parameters) = 0;

  /// Moves a proxy to `position_m` at rest and forgets its contacts: the set-point is re-based at zero stored energy.
  /// Brings back one that was released.
  virtual void reset_proxy(std::size_t proxy, const Eigen::Vector3d& position_m) = 0;

  /// Releases the tool: it stays where it is, at rest, pulls nothing and touches nothing until reset_proxy().
  virtual void release_proxy(std::size_t proxy) = 0;

  /// Places the tool of a method that simulates it itself. It pulls nothing and touches nothing that drive_tool() does
  /// not name; contacts() lists what is around it. Holds until reset_proxy(). A released tool stays released.
  virtual void place_proxy(std::size_t proxy, const Eigen::Vector3d& position_m,
                           const Eigen::Vector3d& velocity_m_s) = 0;

  /// In the next step such a tool takes room among what yields to it: soft bodies, and, where a scene has many of them,
  /// bodies whose mass is below kLightest·K·tick². Of these contacts() says nothing. It has no mass there: `target`
  /// pulls it to where it is placed, and pushes with what the hand felt of them. Its ProxyReadout tells the forces of
  /// that. Without effect where nothing yields.
  virtual void drive_tool(std::size_t proxy, const ProxyTarget& target);

  /// What that did to the tool, and will do within `ahead_s` if the tool goes on at `velocity_m_s`. Empty where nothing
  /// yields, or is farther than `radius_m`. Later steps are bit-identical with and without this call.
  virtual void tool_reaction(std::size_t proxy, double radius_m, double ahead_s, const Eigen::Vector3d& velocity_m_s,
                             ToolReaction& out);

  /// Force of such a tool on a body in the next step: at its centre of mass, constant over the step, and a torque.
  /// Wakes the body. Without effect on a body that no force moves. Several calls for one body add up.
  virtual void apply_hand_force(std::size_t proxy, std::size_t body, const Eigen::Vector3d& force_n,
                                const Eigen::Vector3d& torque_n_m) = 0;

  /// The spring is integrated implicitly together with the contacts: any stiffness and step stay stable.
  virtual void set_proxy_target(std::size_t proxy, const ProxyTarget& target) = 0;

  /// Holds until the next call. Within the speeds and the reach of its motion, so that no order makes it jump. Without
  /// effect on other bodies.
  virtual void set_body_target(std::size_t body, const BodyTarget& target);

  /// Advances the world by `step_s` > 0 seconds as one step.
  virtual void step(double step_s) = 0;

  [[nodiscard]] virtual ProxyReadout proxy(std::size_t proxy) const = 0;

  /// Contacts of the proxy within `radius_m`, and the bodies behind them; none for a released proxy. Does not change
  /// the world: later steps are bit-identical with and without this call.
  virtual void contacts(std::size_t proxy, double radius_m, ContactSet& out) const = 0;

  /// Of the scene, static ones included, proxies not.
  [[nodiscard]] virtual std::size_t bodies() const noexcept = 0;

  /// Pose of body i in the scene's order (grids unrolled); i < bodies().
  [[nodiscard]] virtual BodyPose body_pose(std::size_t body) const = 0;

  /// Nodes of all soft bodies of the scene, in its order.
  [[nodiscard]] virtual std::size_t soft_nodes() const noexcept { return 0; }

  /// Where node i is, p_WN [m]; i < soft_nodes(). Always finite.
  [[nodiscard]] virtual Eigen::Vector3d soft_node(std::size_t node) const;

  /// How often a body became non-finite or turned inside out and was put back to its place in the scene, at rest.
  [[nodiscard]] virtual std::uint64_t recoveries() const noexcept { return 0; }

  /// Movable bodies that are not asleep: the cost of a step grows with them.
  [[nodiscard]] virtual std::size_t awake_bodies() const noexcept = 0;

  /// Contact points that the last step solved: the cost grows with them too.
  [[nodiscard]] virtual std::size_t solved_contacts() const noexcept = 0;

  /// What a user should know before steps of at most `longest_step_s` are taken: one sentence each, with the remedy.
  [[nodiscard]] virtual std::vector<std::string> warnings(double longest_step_s) const = 0;
};

inline void World::set_body_target(std::size_t, const BodyTarget&) {}
inline void World::drive_tool(std::size_t, const ProxyTarget&) {}
inline void World::tool_reaction(std::size_t, double, double, const Eigen::Vector3d&, ToolReaction& out) { out = {}; }
inline Eigen::Vector3d World::soft_node(std::size_t) const { return Eigen::Vector3d::Zero(); }

}  // namespace physics
