#pragma once
/// @file direct.hpp
/// The 1 kHz reference (paper, Fig. 8): the proxy is found in the haptic loop itself, on analytic surfaces.
#include <vector>

#include "haptic_node/mapping.hpp"
#include "haptic_node/rendering/renderer.hpp"
#include "rtbus/shapes/shapes.hpp"

namespace haptic {

/// F = K(P − x) − B·v_n while touching, P being the god-object: the point outside all bodies that the hand can reach by
/// sliding (C. Zilles, J. K. Salisbury, "A constraint-based god-object method for haptic display", IROS 1995).
/// No friction. The damper acts along the contact normal and never pulls the hand in.
class Direct final : public Renderer {
 public:
  /// @param mapping Must outlive this object; followed when the clutch re-bases it.
  Direct(double stiffness_n_per_m, double damping_n_s_per_m, const Mapping& mapping,
         std::vector<rtbus::shapes::PlacedShape> shapes);

  [[nodiscard]] std::string_view name() const noexcept override { return "direct"; }
  [[nodiscard]] bool needs_physics() const noexcept override { return false; }
  [[nodiscard]] RenderOutput render(const RenderInput& input) noexcept RTBUS_NONBLOCKING override;
  void reset() noexcept RTBUS_NONBLOCKING override {
    touching_ = false;
    placed_ = false;
  }

 private:
  /// Moves god_W_ as near to `tip_W` as the bodies allow.
  void follow(const Eigen::Vector3d& tip_W) noexcept RTBUS_NONBLOCKING;
  [[nodiscard]] bool outside_all(const Eigen::Vector3d& p_W) const noexcept RTBUS_NONBLOCKING;

  double stiffness_n_per_m_;
  double damping_n_s_per_m_;
  const Mapping& mapping_;
  std::vector<rtbus::shapes::PlacedShape> shapes_;
  std::vector<rtbus::shapes::SurfacePoint> surfaces_;  ///< Of each shape, nearest to the god-object; sized once.
  bool placed_ = false;                                ///< god_W_ is meaningful.
  bool touching_ = false;                              ///< The god-object was held back in the last cycle.
  Eigen::Vector3d god_W_ = Eigen::Vector3d::Zero();
};

}  // namespace haptic
