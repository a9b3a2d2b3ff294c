#pragma once
/// @file stepper.hpp
/// The core of the physics node, without process, clock or bus: device states in, proxy states out. The node drives it
/// by its clock, the harness by a simulated clock.
#include <array>
#include <cstdint>
#include <memory>
#include <vector>

#include "physics_node/engine/world.hpp"
#include "physics_node/impulse_queue.hpp"
#include "physics_node/node_config.hpp"
#include "rtbus/contact_messages.hpp"
#include "rtbus/longest_gap.hpp"
#include "rtbus/messages.hpp"
#include "rtbus/order_messages.hpp"

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
/// A method that simulates the proxy itself (DeviceState::wants, kOwnsProxy) needs no spring here. The proxy is placed
/// where the method has it, and pushes nothing. In each step a body receives the impulse that the hand felt from it
/// since the step before (hand_impulse_…), each at its time: Newton's third law. What yields (World::drive_tool) gets
/// it through the tool: that is pushed by these impulses, and a spring keeps it at the proxy. What the spring gives
/// besides is taken back within kPaysBack_s.
///
/// A device that asks for it (DeviceState::hand_stiffness_n_per_m …) also gets the force on the hand, eq. (3) and (4):
/// K(P_p + n·h·V_p − P_h) − B·V_p with n = prediction_periods; in the improved form the damper is relative, B(V_p −
/// V_h). One thread.
class Stepper {
 public:
  /// @param shape_hash Scene::shape_hash() of the scene that the world simulates; 0: it is of none.
  Stepper(std::unique_ptr<World> world, const std::vector<ProxyConfig>& proxies, int substeps,
          std::uint64_t shape_hash = 0);

  /// The newest state of a device; `sequence` is its number in the topic.
  ///  - The first state, the first after release(), a new mapping_epoch, and every state with enabled == 0 re-base
  ///    the proxy: it is put onto the target at rest, so whatever begins then begins at zero stored energy.
  ///  - A state with a value that is not finite, or a scale ≤ 0, is ignored and counted.
  void set_device(std::size_t proxy, const rtbus::DeviceState& device, std::uint64_t sequence);

  /// A state before the newest, in order: when in the next step a body receives what the hand gave it. What nobody told
  /// in between is spread evenly.
  void hear(std::size_t proxy, const rtbus::DeviceState& device);

  /// What orders say of bodies with `motion: target`; those whose time is over stay where they are.
  void set_body_orders(const rtbus::BodyOrders& orders, std::uint64_t now_ns);

  /// The device has not published for long: its proxy is released (World::release_proxy). Its next state is a new
  /// start.
  void release(std::size_t proxy);

  /// Advances the world by `dt_s` in `substeps` equal parts.
  void step(double dt_s) { step(dt_s, substeps_); }

  /// The same with another number of parts. During the step a target moves in a straight line from where it was at the
  /// end of the step before to where it is now: the proxy at the end of the step is the one that belongs to the device
  /// sample it answers, however long the step is. A proxy without a device yet stays where it is.
  ///
  /// With `lead_steps` the target is the device's position moved on by lead_steps·dt_s at its velocity. The loop uses
  /// the proxy at the age t of the answer. While both move at v, it renders K·v·t more than the world receives. A lead
  /// of that length (remote_virtual_coupling: 1 step, throttled 2) makes the two equal.
  void step(double dt_s, int substeps);

  /// The proxy after the last step. `step_compute_s` is 0: this class measures no time.
  [[nodiscard]] rtbus::ProxyState answer(std::size_t proxy) const;

  /// True while the newest state of the device asks for contacts().
  [[nodiscard]] bool wants_contacts(std::size_t proxy) const { return links_.at(proxy).wants_contacts; }

  /// Contacts of the proxy within `radius_m`, and the bodies behind them. 0: within contact_radius_m(). Changes
  /// nothing. Their device_time_ns is the hand's time until which bodies have received what it did: that of answer(),
  /// or a little before.
  void contacts(std::size_t proxy, double radius_m, rtbus::ProxyContacts& out);

  /// The same for observers.
  void contact_points(std::size_t proxy, rtbus::ContactPoints& out);

  /// How far the proxy can move until the next answer is in use, in two steps or the age that answers had lately,
  /// whichever is longer: at the largest of its own speed, its target's and kHandSpeed_m_s of the device, plus free
  /// fall; at least kRestRadius_m of the device.
  static constexpr double kHandSpeed_m_s = 0.2, kFall_m_s2 = 9.81;
  static constexpr double kRestRadius_m = 1e-3;
  static constexpr double kAgeKept = 0.99;
  static constexpr double kPaysBack_s = 0.02;
  /// Where there are several hands, in so much of the age of an answer, if that is longer.
  static constexpr double kPaysBackAges = 0.8;
  [[nodiscard]] double contact_radius_m(std::size_t proxy) const;

  [[nodiscard]] std::size_t proxies() const noexcept { return links_.size(); }
  [[nodiscard]] const ProxyConfig& proxy(std::size_t proxy) const { return links_[proxy].config; }
  [[nodiscard]] std::uint64_t steps() const noexcept { return steps_; }
  [[nodiscard]] double simulated_s() const noexcept { return simulated_s_; }
  [[nodiscard]] std::uint64_t ignored_states() const noexcept {
    return ignored_states_;
  }  ///< States that were ignored: not finite, or a scale ≤ 0.
  [[nodiscard]] const World& world() const noexcept { return *world_; }

 private:
  /// DeviceState::hand_impulse_… and its time.
  struct HandImpulses {
    std::array<std::uint32_t, rtbus::kHandImpulseRows> body{}, generation{};
    std::array<rtbus::Vec3, rtbus::kHandImpulseRows> impulse_n_s{}, angular_n_m_s{};
    std::uint64_t time_ns = 0;
    void take(const rtbus::DeviceState& device) noexcept;
  };
  /// Between one device and its proxy.
  struct Link {
    ProxyConfig config;
    ProxyTarget target;                                           // as last told by the device
    Eigen::Vector3d previous_target_m = Eigen::Vector3d::Zero();  // at the end of the step before
    Eigen::Vector3d begin_m = Eigen::Vector3d::Zero();            // the proxy, before the part of the step
    Eigen::Vector3d coupling_force_n = Eigen::Vector3d::Zero();   // means over the last step
    Eigen::Vector3d contact_force_n = Eigen::Vector3d::Zero();
    double coupling_work_j = 0.0;  // since the epoch began
    std::uint32_t contacts = 0;
    bool connected = false;  // has ever spoken
    bool silent = true;      // has not spoken yet, or not since release()
    bool enabled = false;
    bool wants_contacts = false;
    double answer_age_s = 0.0;  // the largest of late: kAgeKept of it is left after a step
    double position_scale = 1.0;
    std::uint32_t mapping_epoch = 0;
    std::uint64_t device_sequence = 0;
    std::uint64_t device_time_ns = 0;
    double hand_stiffness_n_per_m = 0.0;  // the order, in the world
    double hand_damping_n_s_per_m = 0.0;
    double prediction_periods = 0.0;
    bool owns_proxy = false;          // the device does: bodies get what it gives them, nothing else
    HandImpulses hand_impulses;       // as of its newest state
    rtbus::LongestGap gap;            // between its samples
    std::uint64_t tick_ns = 0;        // from the sample before to the newest one
    ImpulseQueue queue;               // what bodies have not received yet
    std::vector<PendingImpulse> due;  // in this step
    // Of what yields to the tool of such a device:
    Eigen::Vector3d tool_push_n = Eigen::Vector3d::Zero();  // by the hand, in the running part of the step
    Eigen::Vector3d spring_n_s = Eigen::Vector3d::Zero();   // more than that, so far
    Eigen::Vector3d drift_m_s = Eigen::Vector3d::Zero();    // the proxy's mean velocity, over about kDrift_s
    std::uint64_t drift_ns = 0;                             // until then
    Eigen::Vector3d drift_at_m = Eigen::Vector3d::Zero();   // the proxy, then
  };
  static void follow_drift(Link& link, const rtbus::DeviceState& device);
  static void queue_hand_impulses(Link& link, const rtbus::DeviceState& device);
  void gather_impulses(double dt_s);
  /// Time of the hand until which bodies have received what it did.
  [[nodiscard]] double pays_back_s(const Link& link) const;
  [[nodiscard]] static std::uint64_t received_until_ns(const Link& link) noexcept;
  void apply_pending(std::size_t proxy, double from, double to, double dt_s);
  void drive_tool(std::size_t proxy, double done, double dt_s);
  [[nodiscard]] ProxyTarget explicit_spring(std::size_t proxy) const;
  [[nodiscard]] Eigen::Vector3d hand_force_n(const Link& link, const ProxyReadout& readout) const;
  void rebase(std::size_t proxy);

  std::unique_ptr<World> world_;
  int substeps_;
  std::uint64_t shape_hash_;
  std::vector<Link> links_;
  ContactSet contacts_;  // kept for its memory
  /// By body, in its frame: BodyBehind::own_from_centre_m as it was told last.
  std::vector<Eigen::Vector3d> own_B_m_;
  ToolReaction reaction_;
  std::vector<PendingImpulse> pushes_;  // likewise
  double step_s_ = 0.0;
  double simulated_s_ = 0.0;
  std::uint64_t steps_ = 0;
  std::uint64_t ignored_states_ = 0;
};

}  // namespace physics
