#pragma once
/// @file remote_virtual_coupling.hpp
/// The paper's method (He & Choi 2013, section III.C, Fig. 5): a spring-damper at each end of the link.
#include "haptic_node/rendering/renderer.hpp"

namespace haptic {

/// F = K(A − x) + B(V_A − v), A being the newest proxy that physics sent. The paper's form damps the absolute velocity
/// (−B·v), which costs drag in free air; damping the relative one does not.
class RemoteVirtualCoupling final : public Renderer {
 public:
  RemoteVirtualCoupling(double stiffness_n_per_m, double damping_n_s_per_m, bool paper = false) noexcept
      : stiffness_n_per_m_(stiffness_n_per_m), damping_n_s_per_m_(damping_n_s_per_m), paper_(paper) {}

  [[nodiscard]] std::string_view name() const noexcept override { return "remote_virtual_coupling"; }
  [[nodiscard]] bool needs_physics() const noexcept override { return true; }
  [[nodiscard]] RenderOutput render(const RenderInput& input) noexcept RTBUS_NONBLOCKING override;
  void reset() noexcept RTBUS_NONBLOCKING override {}

 private:
  double stiffness_n_per_m_;
  double damping_n_s_per_m_;
  bool paper_;
};

}  // namespace haptic
