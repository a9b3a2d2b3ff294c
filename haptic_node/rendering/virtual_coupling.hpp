#pragma once
/// @file virtual_coupling.hpp
/// Virtual coupling in one process (He & Choi 2013, Fig. 4; J. E. Colgate, M. C. Stanley, J. M. Brown, "Issues in the
/// haptic display of tool use", IROS 1995): one spring-damper between the hand and a simulated proxy.
#include <vector>

#include "haptic_node/rendering/god_object.hpp"
#include "haptic_node/rendering/mapping.hpp"
#include "haptic_node/rendering/method.hpp"

namespace haptic {

/// The proxy is a point mass in the world, simulated in the haptic loop itself on analytic bodies, one step per cycle:
/// no physics process. What pulls it, pulls the hand back: F = K(P − x) + B(V − v). It feels neither gravity nor
/// friction, and bodies take the speed towards them away.
///
/// The step is implicit in spring and damper, (m + hB + h²K)·v⁺ = m·v + h(K(x − P) + B·v_T), so that any stiffness and
/// any mass are stable. Paper's form: the force of the step's beginning (explicit), and dampers on absolute velocities,
/// −B·V on the proxy and −B·v on the hand; it diverges for h²·K > 4m or h·B > 2m.
///
/// With B = 0 a proxy in free air oscillates at √(K/m) without end. B near √(2·K·m) damps it.
class VirtualCoupling final : public Method {
 public:
  /// @param mapping Must outlive this object. @param mass_kg In the world, > 0.
  VirtualCoupling(double stiffness_n_per_m, double damping_n_s_per_m, double mass_kg, bool paper,
                  const Mapping& mapping, std::vector<rtbus::shapes::PlacedShape> shapes);

  [[nodiscard]] std::string_view name() const noexcept override { return "virtual_coupling"; }
  [[nodiscard]] bool needs_physics() const noexcept override { return false; }
  [[nodiscard]] RenderOutput render(const RenderInput& input) noexcept RTBUS_NONBLOCKING override;
  void set_gains(double stiffness_n_per_m, double damping_n_s_per_m) noexcept RTBUS_NONBLOCKING override {
    stiffness_n_per_m_ = stiffness_n_per_m;
    damping_n_s_per_m_ = damping_n_s_per_m;
  }
  void reset() noexcept RTBUS_NONBLOCKING override { placed_ = false; }

 private:
  void step(const Eigen::Vector3d& tip_W, const Eigen::Vector3d& tip_velocity_W, double h) noexcept RTBUS_NONBLOCKING;

  double stiffness_n_per_m_;
  double damping_n_s_per_m_;
  double mass_kg_;
  bool paper_;
  const Mapping& mapping_;
  GodObject proxy_;
  Eigen::Vector3d velocity_W_ = Eigen::Vector3d::Zero();
  bool placed_ = false;  ///< proxy_ is meaningful.
};

}  // namespace haptic
