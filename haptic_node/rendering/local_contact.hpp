#pragma once
/// @file local_contact.hpp
/// The method `local_contact`: the proxy and the bodies that it meets are simulated in the haptic loop, from what
/// physics says about the contacts near the proxy.
#include <cstdint>
#include <utility>

#include "haptic_node/rendering/local_world.hpp"
#include "haptic_node/rendering/mapping.hpp"
#include "haptic_node/rendering/method.hpp"
#include "rtbus/messages.hpp"

namespace haptic {

/// F = K(p − x) + B(v_p − v), p being a massless proxy that is solved with its contacts every tick (local_world.hpp):
/// zero in free air, full stiffness at a surface, however old the last answer of physics is. What the hand felt goes to
/// physics body by body (DeviceState::hand_impulse_…), and there takes the place of a proxy that pushes.
class LocalContact final : public Method {
 public:
  /// @param mapping Must outlive this object.
  /// @param known Shapes of bodies. @param other_hands How many the session has besides.
  LocalContact(double stiffness_n_per_m, double damping_n_s_per_m, const Mapping& mapping, KnownShapes known = {},
               std::size_t other_hands = 0)
      : stiffness_n_per_m_(stiffness_n_per_m),
        damping_n_s_per_m_(damping_n_s_per_m),
        mapping_(mapping),
        world_(std::move(known), other_hands) {}

  [[nodiscard]] std::string_view name() const noexcept override { return "local_contact"; }
  [[nodiscard]] bool needs_physics() const noexcept override { return true; }
  [[nodiscard]] RenderOutput render(const RenderInput& input) noexcept RTBUS_NONBLOCKING override;
  void felt(const Eigen::Vector3d& force_n) noexcept RTBUS_NONBLOCKING override;
  void tell(rtbus::DeviceState& out) const noexcept RTBUS_NONBLOCKING override;
  void set_gains(double stiffness_n_per_m, double damping_n_s_per_m) noexcept RTBUS_NONBLOCKING override {
    stiffness_n_per_m_ = stiffness_n_per_m;
    damping_n_s_per_m_ = damping_n_s_per_m;
  }
  void reset() noexcept RTBUS_NONBLOCKING override { placed_ = false; }

 private:
  [[nodiscard]] double step_to(std::uint64_t sample_ns, double dt_s) noexcept;

  double stiffness_n_per_m_;
  double damping_n_s_per_m_;
  const Mapping& mapping_;
  LocalWorld world_;
  bool placed_ = false;
  std::uint64_t sample_ns_ = 0;
  std::uint64_t world_ns_ = 0;  ///< So far the world has been advanced: beyond a sample that was repeated.
  double step_s_ = 0.0;         ///< Of the last tick.
};

}  // namespace haptic
