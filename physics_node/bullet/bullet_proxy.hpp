#pragma once
/// @file bullet_proxy.hpp
/// The tool of one haptic device as a rigid body of Bullet's.
#include <memory>

#include "physics_node/bullet/units.hpp"
#include "physics_node/engine/world.hpp"

namespace physics::bullet {

/// A sphere on an implicit spring-damper. It feels no gravity (a tool that the hand lets go must not fall), does not
/// turn (a hand holds it), never sleeps, and does not collide with other proxies.
///
/// The spring. Implicit Euler asks of the step of h seconds
///   (m + h·B + h²·K)·v⁺ = m·v + h·(K·(x_T − x) + B·v_T) + contact impulses.
/// A ghost body of mass m_g = h·(h·K + B) and velocity v_g = (K·(x_T − x) + B·v_T)/(h·K + B) on a rigid joint at the
/// sphere's centre is that equation, and since the joint lets neither turn the other, the two are one body of mass
/// m + m_g and velocity (m·v + m_g·v_g)/(m + m_g). So no joint is needed: before each step the sphere gets that mass
/// and that velocity. Bullet's contact solver then sees the effective mass and needs no iteration for the spring; in
/// free air the result is exact to rounding.
///
/// A constant force F of the target joins the ghost's momentum: m_g·v_g + h·F, with m_g = 0 when it stands alone.
///
/// Newton's law holds to rounding: coupling force m_g·(v_g − v⁺)/h (+ F), and contact force m·(v⁺ − v)/h minus that.
///
/// Bullet finds contacts where a step begins, so a fast proxy would enter a body first and be thrown out afterwards.
/// Continuous detection is therefore on for it: along the way that spring and damper alone would take it, the first
/// body hit becomes a contact at its distance, before the solver runs.
class BulletProxy {
 public:
  static constexpr double kMaxVelocityMS = 1e5;  ///< Limits beyond which finite inputs are clamped, as of analytic.
  static constexpr double kMaxStiffnessNPerM = 1e8;
  static constexpr double kMaxDampingNSPerM = 1e8;
  static constexpr double kMaxForceN = 1e6;
  /// Bullet takes a body out of the world whose bounding box, with the way of one step, is 10⁶ units long.
  static constexpr double kMaxUnits = 1e5;

  /// `radius_m` > 0. Throws std::invalid_argument as World::add_proxy() of the analytic engine does.
  BulletProxy(const ProxyParameters& parameters, double radius_m, double scale);

  /// By value: the place may be that of state(), which is cleared.
  void reset(const Eigen::Vector3d& position_m);
  /// Somebody else moves it: there, without pulling. reset() takes that back.
  void put(const Eigen::Vector3d& position_m, const Eigen::Vector3d& velocity_m_s);
  /// Of such a one: the forces on its tool in the last step.
  void bear(const ProxyReadout& tool) noexcept;
  void set_target(const ProxyTarget& target);

  /// Mass and velocity for a step of `h` seconds.
  void before_step(double h);
  /// What became of it; `contacts()` is asked only when a contact acted.
  template <class CountContacts>
  void after_step(double h, CountContacts&& contacts) {
    read_step(h);
    state_.contacts = touched_ ? contacts() : 0;
  }

  [[nodiscard]] btRigidBody& body() noexcept { return *body_; }
  [[nodiscard]] const btRigidBody& body() const noexcept { return *body_; }
  [[nodiscard]] double mass_kg() const noexcept { return mass_kg_; }
  /// Radius as Bullet has it [units].
  [[nodiscard]] double radius() const noexcept { return static_cast<double>(shape_->getRadius()); }
  /// Out of the world: BulletWorld takes it out and puts it back.
  [[nodiscard]] bool released() const noexcept { return released_; }
  void set_released(bool released) noexcept { released_ = released; }
  /// Out of the world as well; placed by a method that simulates it.
  [[nodiscard]] bool placed() const noexcept { return placed_; }
  void set_placed(bool placed) noexcept { placed_ = placed; }
  [[nodiscard]] const ProxyTarget& target() const noexcept { return target_; }
  [[nodiscard]] const ProxyReadout& state() const noexcept { return state_; }

 private:
  void read_step(double h);
  void place(const Eigen::Vector3d& position_m, const Eigen::Vector3d& velocity_m_s);
  [[nodiscard]] Eigen::Vector3d clamped(const Eigen::Vector3d& position_m) const;

  double mass_kg_;
  double scale_;
  ProxyTarget target_;
  ProxyReadout state_;
  std::unique_ptr<btSphereShape> shape_;
  std::unique_ptr<btRigidBody> body_;

  double body_mass_kg_ = 0.0;                                 // what Bullet's body has: m + m_g
  double ghost_mass_kg_ = 0.0;                                // m_g of the running step
  Eigen::Vector3d ghost_momentum_ = Eigen::Vector3d::Zero();  // m_g·v_g
  btVector3 free_velocity_{0, 0, 0};                          // as handed to Bullet
  bool touched_ = false;
  bool released_ = false;
  bool placed_ = false;
};

}  // namespace physics::bullet
