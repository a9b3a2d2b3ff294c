#pragma once
/// @file remote_virtual_coupling.hpp
/// The paper's method (He & Choi 2013, section III.C, Fig. 5): a spring-damper at each end of the link.
#include "haptic_node/rendering/echo.hpp"
#include "haptic_node/rendering/method.hpp"

namespace haptic {

/// F = K(A − x) + B(V_A − v), A being the newest proxy that physics sent. The paper's form damps the absolute velocity
/// (−B·v), which adds drag in free air; relative damping does not. The delay still drags: F ≈ K·v·age of the answer.
///
/// Where physics is slower than the loop, A moves to each new proxy in a straight line, over one of physics' periods,
/// and V_A is its velocity on that line. A set-point that jumps makes a step of the force with every answer and excites
/// the tip on its spring (decision 0011). The line costs half a period of delay on average. The paper's form holds and
/// jumps.
///
/// Over a network A lags behind that line besides, so that the tip's own echo dies out (echo.hpp).
class RemoteVirtualCoupling final : public Method {
 public:
  RemoteVirtualCoupling(double stiffness_n_per_m, double damping_n_s_per_m, bool paper = false,
                        const Echo& echo = {}) noexcept
      : paper_(paper), echo_(echo) {
    set_gains(stiffness_n_per_m, damping_n_s_per_m);
  }

  [[nodiscard]] std::string_view name() const noexcept override { return "remote_virtual_coupling"; }
  [[nodiscard]] bool needs_physics() const noexcept override { return true; }
  [[nodiscard]] RenderOutput render(const RenderInput& input) noexcept RTBUS_NONBLOCKING override;
  void set_gains(double stiffness_n_per_m, double damping_n_s_per_m) noexcept RTBUS_NONBLOCKING override {
    stiffness_n_per_m_ = stiffness_n_per_m;
    damping_n_s_per_m_ = damping_n_s_per_m;
    lag_s_ = echo_.lag_s(stiffness_n_per_m, damping_n_s_per_m);
  }
  void reset() noexcept RTBUS_NONBLOCKING override { placed_ = false; }

 private:
  void follow(const RenderInput& input) noexcept RTBUS_NONBLOCKING;
  void lag_behind(bool from_here, double dt_s) noexcept RTBUS_NONBLOCKING;

  double stiffness_n_per_m_ = 0.0;
  double damping_n_s_per_m_ = 0.0;

  bool paper_;
  Echo echo_;
  double lag_s_ = 0.0;            ///< Of echo_ at these gains.
  bool placed_ = false;           ///< at_m_ is meaningful.
  double cycles_per_step_ = 1.0;  ///< Cycles that the way takes …
  double cycle_ = 0.0;            ///< … and that have passed since the answer came.
  Eigen::Vector3d from_m_ = Eigen::Vector3d::Zero();
  Eigen::Vector3d at_m_ = Eigen::Vector3d::Zero();
  Eigen::Vector3d lagging_m_ = Eigen::Vector3d::Zero();  ///< A.
  Eigen::Vector3d velocity_m_s_ = Eigen::Vector3d::Zero();
};

}  // namespace haptic
