#pragma once
/// @file renderer.hpp
/// A force law: from where the hand and the proxy are to the force on the hand. One law per file in this folder.
#include <cstdint>
#include <string_view>

#include <Eigen/Core>

#include "rtbus/contact_messages.hpp"
#include "rtbus/realtime.hpp"

namespace haptic {

/// The newest proxy that physics sent, mapped W→D. All lengths, velocities and forces are at the device.
struct ProxyView {
  bool valid = false;                ///< False until physics has answered a sample of the present mapping.
  bool fresh = false;                ///< First cycle that sees this proxy: a packet has just arrived.
  std::uint64_t sequence = 0;        ///< Of the ProxyState.
  std::uint64_t device_time_ns = 0;  ///< Of the device sample it answers.
  std::uint64_t arrived_ns = 0;      ///< Cycle time when it was first seen.
  double period_s = 0.0;             ///< Simulated time between this proxy and the one before it.
  Eigen::Vector3d position_m = Eigen::Vector3d::Zero();      ///< p_DP: virtual object A of the paper's Fig. 5.
  Eigen::Vector3d velocity_m_s = Eigen::Vector3d::Zero();    ///< v_DP.
  double work_j = 0.0;  ///< What the world has put into the coupling at the proxy between the one before and this.
  Eigen::Vector3d server_force_n = Eigen::Vector3d::Zero();  ///< On the hand, as physics made it; zero unless ordered.
};

/// What a law may look at, every tick.
struct RenderInput {
  std::uint64_t now_ns = 0;
  std::uint64_t sample_time_ns = 0;                        ///< When the device measured the pose.
  double dt_s = 0.0;                                       ///< Period of the loop, > 0.
  Eigen::Vector3d position_m = Eigen::Vector3d::Zero();    ///< p_DT.
  Eigen::Vector3d velocity_m_s = Eigen::Vector3d::Zero();  ///< v_DT, estimated.
  ProxyView proxy;
  /// Set in the cycle that sees them first, and only for a law that asks for them (registry.hpp); in W.
  const rtbus::ProxyContacts* contacts = nullptr;
};

/// What it answers.
struct RenderOutput {
  Eigen::Vector3d force_n = Eigen::Vector3d::Zero();           ///< On the hand, in D, before any safety.
  Eigen::Vector3d proxy_position_m = Eigen::Vector3d::Zero();  ///< Where the law takes the proxy to be, in D.
  Eigen::Vector3d proxy_velocity_m_s = Eigen::Vector3d::Zero();
  /// What moves by itself in the world has put into the coupling in this cycle, where the law integrates the proxy;
  /// with another law it comes from physics (ProxyView::work_j).
  double world_work_j = 0.0;
};

/// One force law. One instance per loop; keeps its own history.
class Renderer {
 public:
  virtual ~Renderer() = default;

  /// Name in YAML.
  [[nodiscard]] virtual std::string_view name() const noexcept = 0;

  /// False for a law that finds its surface by itself (`direct`): it runs, and stays alive, without physics.
  [[nodiscard]] virtual bool needs_physics() const noexcept = 0;

  /// @realtime Yes, bounded, no allocation.
  [[nodiscard]] virtual RenderOutput render(const RenderInput& input) noexcept RTBUS_NONBLOCKING = 0;

  /// What left for the hand after render(), in D: the force after the ladder, or zero. @realtime Yes.
  virtual void felt(const Eigen::Vector3d& /*force_n*/) noexcept RTBUS_NONBLOCKING {}

  /// Adds what physics has to know. @realtime Yes.
  virtual void tell(rtbus::DeviceState& /*out*/) const noexcept RTBUS_NONBLOCKING {}

  /// Forgets history: each time forces are enabled, physics comes back, or the mapping is re-based. @realtime Yes.
  virtual void reset() noexcept RTBUS_NONBLOCKING = 0;
};

}  // namespace haptic
