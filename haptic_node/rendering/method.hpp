#pragma once
/// @file method.hpp
/// A force-rendering method: computes the force on the hand from device position and proxy. One method per file in this
/// folder.
#include <cstdint>
#include <optional>
#include <span>
#include <string_view>

#include <Eigen/Core>

#include "rtbus/contact_messages.hpp"
#include "rtbus/realtime.hpp"
#include "rtbus/sample.hpp"

namespace haptic {

/// The newest answer of physics, mapped W→D. All lengths, velocities and forces are at the device.
struct ProxyView {
  bool valid = false;                ///< False until physics has answered a sample of the present mapping epoch.
  bool fresh = false;                ///< True in the first cycle that uses this answer.
  std::uint64_t sequence = 0;        ///< Of the ProxyState.
  std::uint64_t device_time_ns = 0;  ///< Of the device sample it answers.
  std::uint64_t arrived_ns = 0;      ///< Cycle time when it was first seen.
  double period_s = 0.0;             ///< Simulated time between this proxy and the one before it.
  Eigen::Vector3d position_m = Eigen::Vector3d::Zero();    ///< p_DP: virtual object A of the paper's Fig. 5.
  Eigen::Vector3d velocity_m_s = Eigen::Vector3d::Zero();  ///< v_DP.
  double work_j = 0.0;  ///< Energy that the world has put into the coupling at the proxy since the answer before.
  Eigen::Vector3d server_force_n =
      Eigen::Vector3d::Zero();  ///< On the hand, computed by physics; zero unless the method asks for it.
};

/// Another hand of the session.
struct OtherHand {
  std::uint32_t number = 0;                  ///< In the session's order.
  bool fresh = false;                        ///< True in the first cycle that sees this state.
  rtbus::Stamped<rtbus::DeviceState> state;  ///< Its newest.
};

/// Input of a method, every tick.
struct RenderInput {
  std::uint64_t now_ns = 0;
  std::uint64_t sample_time_ns = 0;                        ///< When the device measured the pose.
  double dt_s = 0.0;                                       ///< Period of the loop, > 0.
  Eigen::Vector3d position_m = Eigen::Vector3d::Zero();    ///< p_DT.
  Eigen::Vector3d velocity_m_s = Eigen::Vector3d::Zero();  ///< v_DT, estimated.
  ProxyView proxy;
  /// Set in the cycle that sees them first, and only for a method that asks for them (registry.hpp); in W.
  const rtbus::ProxyContacts* contacts = nullptr;
  std::span<const OtherHand> other_hands;  ///< Likewise: for a method that asks for contacts.
};

/// Output of a method.
struct RenderOutput {
  Eigen::Vector3d force_n = Eigen::Vector3d::Zero();           ///< On the hand, in D, before any safety.
  Eigen::Vector3d proxy_position_m = Eigen::Vector3d::Zero();  ///< The proxy that the method uses, in D.
  Eigen::Vector3d proxy_velocity_m_s = Eigen::Vector3d::Zero();
  /// Work of kinematic bodies on the coupling in this cycle, and of other hands, of a method that simulates the proxy.
  /// For the others it comes from physics (ProxyView::work_j).
  double world_work_j = 0.0;
  /// In a cycle that takes an answer while something is touched, of a method that simulates what is touched: how far
  /// the answer moves that, against what had been made of it, at the device.
  std::optional<double> correction_m;
};

/// One method. One instance per loop; keeps its own history.
class Method {
 public:
  virtual ~Method() = default;

  /// Name in YAML.
  [[nodiscard]] virtual std::string_view name() const noexcept = 0;

  /// False for a method that computes the proxy itself (`direct`): it runs without physics.
  [[nodiscard]] virtual bool needs_physics() const noexcept = 0;

  /// @realtime Yes, bounded, no allocation.
  [[nodiscard]] virtual RenderOutput render(const RenderInput& input) noexcept RTBUS_NONBLOCKING = 0;

  /// The force that was sent after render(), in D: the force after the ladder, or zero. @realtime Yes.
  virtual void felt(const Eigen::Vector3d& /*force_n*/) noexcept RTBUS_NONBLOCKING {}

  /// Adds the method's data for physics to the device sample. @realtime Yes.
  virtual void tell(rtbus::DeviceState& /*out*/) const noexcept RTBUS_NONBLOCKING {}

  /// New gains at the device, in small steps (gains.hpp). A method without a spring of its own ignores them.
  /// @realtime Yes.
  virtual void set_gains(double /*stiffness_n_per_m*/, double /*damping_n_s_per_m*/) noexcept RTBUS_NONBLOCKING {}

  /// Forgets history: each time forces are enabled, physics comes back, or the mapping is re-based. @realtime Yes.
  virtual void reset() noexcept RTBUS_NONBLOCKING = 0;
};

}  // namespace haptic
