#pragma once
/// @file stepper.hpp
/// The core of the physics node without process, clock or bus: device states in, proxy states out. The node drives it
/// by its clock; the deterministic harness drives it by a simulated one.
#include <array>
#include <cstdint>
#include <memory>
#include <vector>

#include "physics_node/node_config.hpp"
#include "physics_node/world.hpp"
#include "rtbus/contact_messages.hpp"
#include "rtbus/messages.hpp"

namespace physics {

/// Holds the world and one proxy per haptic node, in the order of `proxies`.
///
/// Gains are configured at the device. In the world they are K·force_scale/position_scale, and the damping likewise,
/// with the scales that came with the device state; a damping that follows from the damping ratio is 2ζ√(K_world·mass).
/// Form of the method (ProxyConfig::wire.paper). Improved: the engine solves the spring implicitly, the damper acts on
/// the velocity relative to the hand, the target moves during the step. Paper (He & Choi 2013, section III): the force
/// of the spring is computed once, at the step's beginning, F = K(P_h − P_p) − B·V_p with the absolute velocity, and
/// held over the step: an explicit spring, which diverges when h²·K or h·B of the whole step is large against the mass.
///
/// A device whose law moves the proxy by itself (DeviceState::wants, kOwnsProxy) pulls at none here: the proxy is put where
/// the law has it, pushes nothing, and each body gets in a step the impulse that the hand has felt from it since the step
/// before (touched_…), spread around the time when it was felt. That is Newton's third law: nothing is lost, nothing doubled.
///
/// A device that orders it (DeviceState::hand_stiffness_n_per_m …) also gets the force on the hand, eq. (3) and (4):
/// K(P_p + n·h·V_p − P_h) − B·V_p with n = prediction_periods; in the improved form the damper is relative, B(V_p −
/// V_h). One thread.
class Stepper {
 public:
  Stepper(std::unique_ptr<World> world, const std::vector<ProxyConfig>& proxies, int substeps);

  /// The newest state of a device; `sequence` is its number in the topic.
  ///  - The first state, the first after release(), a new mapping_epoch, and every state with enabled == 0 re-base
  ///    the proxy: it is put onto the target at rest, so whatever begins then begins at zero stored energy.
  ///  - A state with a value that is not finite, or a scale ≤ 0, is ignored and counted.
  void set_device(std::size_t proxy, const rtbus::DeviceState& device, std::uint64_t sequence);

  /// The device has been silent for long, nobody may hold it any more: its proxy lets go (World::release_proxy). Its
  /// next state is a new start.
  void release(std::size_t proxy);

  /// Advances the world by `dt_s` in `substeps` equal parts.
  void step(double dt_s) { step(dt_s, substeps_); }

  /// The same with another number of parts. During the step a target moves in a straight line from where it was at the
  /// end of the step before to where it is now: the proxy at the end of the step is the one that belongs to the device
  /// sample it answers, however long the step is. A proxy without a device yet stays where it is.
  ///
  /// With `lead_steps` the target is the device's position moved on by lead_steps·dt_s at its velocity. The loop that
  /// feels the proxy has it a while later and meanwhile moves on; of a proxy that moves at v with the device it feels
  /// K·v·age more than the world received. A lead as long as that (remote_virtual_coupling: 1 step,
  /// throttled 2) makes the two equal again.
  void step(double dt_s, int substeps);

  /// What became of the proxy in the last step. `step_compute_s` is left 0: this class measures nothing.
  [[nodiscard]] rtbus::ProxyState answer(std::size_t proxy) const;

  /// True while the newest state of the device asks for contacts().
  [[nodiscard]] bool wants_contacts(std::size_t proxy) const { return links_.at(proxy).wants_contacts; }

  /// What touches the proxy now, or is nearer than the validity radius, and what is behind it: `radius_m`, or, when
  /// that is 0, contact_radius_m(). Changes nothing.
  void contacts(std::size_t proxy, double radius_m, rtbus::ProxyContacts& out);

  /// As far as the proxy may come in two steps (the next answer takes that long to be in use): at its own speed, its
  /// target's or kHandSpeed_m_s of the device, whichever is largest, and falling; kRestRadius_m of the device at least.
  static constexpr double kHandSpeed_m_s = 0.2, kFall_m_s2 = 9.81;
  static constexpr double kRestRadius_m = 1e-3;
  [[nodiscard]] double contact_radius_m(std::size_t proxy) const;

  [[nodiscard]] std::size_t proxies() const noexcept { return links_.size(); }
  [[nodiscard]] const ProxyConfig& proxy(std::size_t proxy) const { return links_[proxy].config; }
  [[nodiscard]] std::uint64_t steps() const noexcept { return steps_; }
  [[nodiscard]] double simulated_s() const noexcept { return simulated_s_; }
  [[nodiscard]] std::uint64_t ignored_states() const noexcept { return ignored_states_; }  ///< Not finite, or no scale.
  [[nodiscard]] const World& world() const noexcept { return *world_; }

 private:
  /// DeviceState::touched_… and when.
  struct Touched {
    std::array<std::uint32_t, rtbus::kTouchedRows> body{}, turn{};
    std::array<Eigen::Vector3d, rtbus::kTouchedRows> impulse_n_s, angular_n_m_s, travel_n_s2;
    std::uint64_t time_ns = 0;
  };
  /// What a body is given in the next step.
  struct Given {
    std::size_t body = 0;
    Eigen::Vector3d impulse_n_s = Eigen::Vector3d::Zero();
    Eigen::Vector3d angular_n_m_s = Eigen::Vector3d::Zero();
    double middle = 0.5;  ///< When in the step, as a share of it.
  };
  /// Between one device and its proxy.
  struct Link {
    ProxyConfig config;
    ProxyTarget target;                                           // as last told by the device
    Eigen::Vector3d previous_target_m = Eigen::Vector3d::Zero();  // at the end of the step before
    Eigen::Vector3d coupling_force_n = Eigen::Vector3d::Zero();   // means over the last step
    Eigen::Vector3d contact_force_n = Eigen::Vector3d::Zero();
    std::uint32_t contacts = 0;
    bool connected = false;  // has ever spoken
    bool silent = true;      // and not been silent since
    bool enabled = false;
    bool wants_contacts = false;
    double position_scale = 1.0;
    std::uint32_t mapping_epoch = 0;
    std::uint64_t device_sequence = 0;
    std::uint64_t device_time_ns = 0;
    double hand_stiffness_n_per_m = 0.0;  // the order, in the world
    double hand_damping_n_s_per_m = 0.0;
    double prediction_periods = 0.0;
    bool owns_proxy = false;  // the device does: bodies get what it gives them, nothing else
    Touched touched;          // as of its newest state
    std::array<Given, rtbus::kTouchedRows> given;  // by the next step
  };
  void take_touched(Link& link, const rtbus::DeviceState& device, bool begins);
  void give(std::size_t proxy, double from, double to, double dt_s);
  [[nodiscard]] ProxyTarget explicit_spring(std::size_t proxy) const;
  [[nodiscard]] Eigen::Vector3d hand_force_n(const Link& link, const ProxyReadout& readout) const;
  void rebase(std::size_t proxy);

  std::unique_ptr<World> world_;
  int substeps_;
  std::vector<Link> links_;
  ContactSet contacts_;  // kept for its memory
  double step_s_ = 0.0;
  double simulated_s_ = 0.0;
  std::uint64_t steps_ = 0;
  std::uint64_t ignored_states_ = 0;
};

}  // namespace physics
