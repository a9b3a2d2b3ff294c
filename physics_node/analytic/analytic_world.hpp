#pragma once
/// @file analytic_world.hpp
/// The reference engine: proxies against any number of static planes, spheres and boxes, exact where a closed form
/// exists.
#include <string>
#include <vector>

#include "physics_node/engine/world.hpp"
#include "rtbus/shapes/shapes.hpp"

namespace physics {

/// Proxies feel their spring and the shapes, nothing else: neither gravity (a tool that the hand lets go must not fall)
/// nor each other. Bodies never move.
///
/// One step of h seconds solves, in velocity, spring, damper and contacts together (implicit Euler):
///   (m + h·B + h²·K)·v⁺ = m·v + h·(K·(x_T − x) + B·v_T + F) + contact impulses,   x⁺ = x + h·v⁺,
/// with non-penetration, perfectly inelastic impact, and Coulomb friction (coefficient: proxy · body) against v⁺.
/// The left factor is a scalar, so in free air this is a division, and with contacts a projection of the free end point
/// onto what the bodies leave free; analytic/contact_sweep.hpp does that along the path, so that no speed and no step
/// makes a proxy tunnel. Newton's law holds to rounding: m·(v⁺ − v)/h = coupling_force + contact_force.
///
/// Exact at any step: force on and position of a proxy in contact, and its speed under a constant force, with friction.
/// Of first order in the step: position and time of moving things (tests: analytic_closed_form_test.cpp).
///
/// A proxy that starts inside a body is moved out at kRecoverySpeedMS or less, as a displacement without kinetic
/// energy. Finite inputs beyond the limits below are clamped to them; targets and steps that are not finite are
/// ignored.
class AnalyticWorld final : public World {
 public:
  static constexpr double kRecoverySpeedMS = 0.1;  ///< Of a proxy out of a body it started in.
  static constexpr double kMaxPositionM = 1e5;     ///< Each coordinate of targets and resets.
  static constexpr double kMaxVelocityMS = 1e5;    ///< Each coordinate of a target's velocity.
  static constexpr double kMaxStiffnessNPerM = 1e8;
  static constexpr double kMaxDampingNSPerM = 1e8;
  static constexpr double kMaxForceN = 1e6;
  static constexpr double kMinStepS = 1e-7, kMaxStepS = 10.0;

  explicit AnalyticWorld(std::vector<rtbus::shapes::PlacedShape> shapes);

  /// Throws std::invalid_argument for a mass ≤ 0, a negative radius or friction, or a value that is not finite.
  std::size_t add_proxy(const ProxyParameters& parameters) override;
  void reset_proxy(std::size_t proxy, const Eigen::Vector3d& position_m) override;
  void release_proxy(std::size_t proxy) override;
  void place_proxy(std::size_t proxy, const Eigen::Vector3d& position_m, const Eigen::Vector3d& velocity_m_s) override;
  void apply_hand_force(std::size_t, std::size_t, const Eigen::Vector3d&, const Eigen::Vector3d&) override {
  }  // none moves
  void set_proxy_target(std::size_t proxy, const ProxyTarget& target) override;
  void step(double step_s) override;
  [[nodiscard]] ProxyReadout proxy(std::size_t proxy) const override;
  void contacts(std::size_t proxy, double radius_m, ContactSet& out) const override;
  [[nodiscard]] std::size_t bodies() const noexcept override { return shapes_.size(); }
  [[nodiscard]] BodyPose body_pose(std::size_t body) const override;
  [[nodiscard]] std::size_t awake_bodies() const noexcept override { return 0; }
  [[nodiscard]] std::size_t solved_contacts() const noexcept override;
  [[nodiscard]] std::vector<std::string> warnings(double) const override { return {}; }

 private:
  struct Proxy {
    ProxyParameters parameters;
    ProxyTarget target;
    ProxyReadout state;
    bool released = false;
    bool placed = false;  // by somebody else
  };
  void step_proxy(Proxy& proxy, double h) const;

  std::vector<rtbus::shapes::PlacedShape> shapes_;
  std::vector<Proxy> proxies_;
};

}  // namespace physics
