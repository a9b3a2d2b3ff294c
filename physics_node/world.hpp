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

#include "physics_node/contact_set.hpp"

namespace physics {

/// The tool that a haptic device holds in the world: a sphere on a spring.
struct ProxyParameters {
  std::string device;                                    ///< Haptic node it belongs to, "haptic0".
  double mass_kg = 0.1;                                  ///< In the world.
  double radius_m = 0.0;                                 ///< 0: a point.
  double friction = 0.0;                                 ///< Coulomb coefficient, multiplied with the body's.
  Eigen::Vector3d position_m = Eigen::Vector3d::Zero();  ///< p_WP at start.
};

/// Where the proxy is pulled to, and how hard. Set before each step.
struct ProxyTarget {
  Eigen::Vector3d position_m = Eigen::Vector3d::Zero();    ///< p_WT.
  Eigen::Vector3d velocity_m_s = Eigen::Vector3d::Zero();  ///< v_WT: the damper acts on the relative velocity.
  double stiffness_n_per_m = 0.0;  ///< In the world (device stiffness · force_scale / position_scale).
  double damping_n_s_per_m = 0.0;  ///< In the world, likewise.
  /// Besides the spring: constant over the step, whatever the proxy does meanwhile (an explicit spring, `form: paper`).
  Eigen::Vector3d force_n = Eigen::Vector3d::Zero();
};

/// What became of the proxy in the last step.
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

/// A simulated world. Made by an engine's factory from a checked scene.
class World {
 public:
  virtual ~World() = default;

  /// Adds a proxy; the handle counts from 0 in the order of calls.
  virtual std::size_t add_proxy(const ProxyParameters& parameters) = 0;

  /// Moves a proxy to `position_m` at rest and forgets its contacts: the set-point is re-based at zero stored energy.
  /// Brings back one that was released.
  virtual void reset_proxy(std::size_t proxy, const Eigen::Vector3d& position_m) = 0;

  /// Nobody holds the tool any more: it stays where it is, at rest, pulls nothing and touches nothing until
  /// reset_proxy().
  virtual void release_proxy(std::size_t proxy) = 0;

  /// Somebody else moves the tool: it is there, pulls nothing and touches nothing, and contacts() tells what is around it.
  /// Holds until reset_proxy(). A released one stays released.
  virtual void place_proxy(std::size_t proxy, const Eigen::Vector3d& position_m,
                           const Eigen::Vector3d& velocity_m_s) = 0;

  /// What the tool that somebody else moves does to a body in the next step: a force at its centre of mass, constant over
  /// the step, and a torque. Wakes it. Nothing for a body that no force moves. Several pushes of one body add up.
  virtual void push_body(std::size_t proxy, std::size_t body, const Eigen::Vector3d& force_n,
                         const Eigen::Vector3d& torque_n_m) = 0;

  /// The spring is integrated implicitly together with the contacts: any stiffness and step stay stable.
  virtual void set_proxy_target(std::size_t proxy, const ProxyTarget& target) = 0;

  /// Advances the world by `step_s` > 0 seconds as one step.
  virtual void step(double step_s) = 0;

  [[nodiscard]] virtual ProxyReadout proxy(std::size_t proxy) const = 0;

  /// What touches the proxy now or is nearer to it than `radius_m`, and what is behind it; nothing for a released one.
  /// Asks only: the world goes on bit for bit as if it had not been asked.
  virtual void contacts(std::size_t proxy, double radius_m, ContactSet& out) const = 0;

  /// Of the scene, static ones included, proxies not.
  [[nodiscard]] virtual std::size_t bodies() const noexcept = 0;

  /// Pose of body i in the scene's order (grids unrolled); i < bodies().
  [[nodiscard]] virtual BodyPose body_pose(std::size_t body) const = 0;

  /// Nodes of all soft bodies of the scene, in its order.
  [[nodiscard]] virtual std::size_t soft_nodes() const noexcept { return 0; }

  /// Where node i is, p_WN [m]; i < soft_nodes(). Always finite.
  [[nodiscard]] virtual Eigen::Vector3d soft_node(std::size_t node) const;

  /// How often a body had got numbers that are none, or had turned inside out, and was put back to where the scene places
  /// it, at rest.
  [[nodiscard]] virtual std::uint64_t recoveries() const noexcept { return 0; }

  /// Bodies that can move and have not been put to rest: what a step costs goes with them.
  [[nodiscard]] virtual std::size_t awake_bodies() const noexcept = 0;

  /// Contact points that the last step had to solve: the other part of its cost.
  [[nodiscard]] virtual std::size_t solved_contacts() const noexcept = 0;

  /// What a user should know before steps of at most `longest_step_s` are taken: one sentence each, with the remedy.
  [[nodiscard]] virtual std::vector<std::string> warnings(double longest_step_s) const = 0;
};

inline Eigen::Vector3d World::soft_node(std::size_t) const { return Eigen::Vector3d::Zero(); }

}  // namespace physics
