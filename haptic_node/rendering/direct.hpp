#pragma once
/// @file direct.hpp
/// The 1 kHz reference (paper, Fig. 8): the proxy is found in the haptic loop itself, on analytic surfaces.
#include <vector>

#include "haptic_node/rendering/god_object.hpp"
#include "haptic_node/rendering/mapping.hpp"
#include "haptic_node/rendering/method.hpp"
#include "rtbus/shapes/shapes.hpp"

namespace haptic {

/// F = K(P − x) − B·v_n while touching, P being the god-object (god_object.hpp): the point outside all bodies that the
/// hand can reach by sliding. No friction. The damper acts along the contact normal and never pulls the hand in.
class Direct final : public Method {
 public:
  /// @param mapping Must outlive this object; followed when the clutch re-bases it.
  Direct(double stiffness_n_per_m, double damping_n_s_per_m, const Mapping& mapping,
         std::vector<rtbus::shapes::PlacedShape> shapes);

  [[nodiscard]] std::string_view name() const noexcept override { return "direct"; }
  [[nodiscard]] bool needs_physics() const noexcept override { return false; }
  [[nodiscard]] RenderOutput render(const RenderInput& input) noexcept RTBUS_NONBLOCKING override;
  void set_gains(double stiffness_n_per_m, double damping_n_s_per_m) noexcept RTBUS_NONBLOCKING override {
    stiffness_n_per_m_ = stiffness_n_per_m;
    damping_n_s_per_m_ = damping_n_s_per_m;
  }
  void reset() noexcept RTBUS_NONBLOCKING override { placed_ = false; }

 private:
  double stiffness_n_per_m_;
  double damping_n_s_per_m_;
  const Mapping& mapping_;
  GodObject god_;
  bool placed_ = false;  ///< god_ is meaningful.
};

}  // namespace haptic
