#pragma once
/// @file loop.hpp
/// One cycle of the haptic loop: read the device, compute the force, apply the safety ladder, write the force, publish
/// the state. The realtime thread of the node and the simulated clock of the in-process harness run the same code.
#include <cstdint>
#include <memory>
#include <vector>

#include "drivers/device.hpp"
#include "haptic_node/link_monitor.hpp"
#include "haptic_node/loop_counters.hpp"
#include "haptic_node/node_config.hpp"
#include "haptic_node/order_box.hpp"
#include "haptic_node/rendering/mapping.hpp"
#include "haptic_node/rendering/method.hpp"
#include "haptic_node/safety.hpp"
#include "haptic_node/velocity.hpp"
#include "haptic_node/world_work.hpp"
#include "rtbus/contact_messages.hpp"
#include "rtbus/messages.hpp"
#include "rtbus/realtime.hpp"
#include "rtbus/sample.hpp"

namespace haptic {

/// The loop's link to physics: the bus in a node, a queue with a chosen latency in the harness. @realtime Yes, all of
/// it.
class PhysicsLink {
 public:
  virtual ~PhysicsLink() = default;
  /// Publishes the state of the hand, every cycle.
  virtual void send(const rtbus::DeviceState& state, std::uint64_t now_ns) noexcept RTBUS_NONBLOCKING = 0;
  /// The newest answer of physics; true when it is newer than the last one received.
  [[nodiscard]] virtual bool receive(rtbus::Stamped<rtbus::ProxyState>& out) noexcept RTBUS_NONBLOCKING = 0;
  /// The contacts around the proxy; likewise. Only for a method that needs them. Rows beyond the counts are not to be
  /// read; without a new answer the content of `out` is undefined.
  [[nodiscard]] virtual bool receive(rtbus::Stamped<rtbus::ProxyContacts>& /*out*/) noexcept RTBUS_NONBLOCKING {
    return false;
  }
  /// The newest state of another hand, `other` counted as in HapticConfig::other_hands; likewise.
  [[nodiscard]] virtual bool receive(std::size_t /*other*/,
                                     rtbus::Stamped<rtbus::DeviceState>& /*out*/) noexcept RTBUS_NONBLOCKING {
    return false;
  }
  /// The newest heartbeat; true when it is newer than the last one received.
  [[nodiscard]] virtual bool receive(rtbus::Stamped<rtbus::Heartbeat>& out) noexcept RTBUS_NONBLOCKING = 0;
  /// Samples of physics that were not sane, since the start; receive() has passed over them.
  [[nodiscard]] virtual std::uint64_t refused() const noexcept RTBUS_NONBLOCKING { return 0; }
};

/// Events of a cycle that are reported once, not every tick.
enum class LoopEvent : std::uint8_t {
  kNone,
  kLinkLost,
  kLinkLags,  ///< A loss too: it answers, but a hand of long ago.
  kLinkAlive,
  kOtherScene,  ///< Physics answers with the shapes of another scene.
  kDeviceLost,
  kDeviceBack,
  kOverspeed,
  kClutched,
  kReleased,
  kEstopped,
  kRearmed,
  kPaused  ///< The loop stood for longer than the device holds a force: last_pause_ns().
};

class Loop {
 public:
  /// @param device,link Outlive the loop. @param config Outlives the loop.
  /// @param measure Record wake-up, compute and device time by the real clock; off under a simulated clock.
  Loop(const HapticConfig& config, drivers::Device& device, PhysicsLink& link, bool measure);

  /// One cycle. @param deadline_ns When it should have started; 0: when the device measured (`clock: device`), so that
  /// the wake-up latency is that from the measurement to here. @param now_ns Now. @realtime Yes.
  void cycle(std::uint64_t deadline_ns, std::uint64_t now_ns) noexcept RTBUS_NONBLOCKING;

  /// Sends zero force at once, outside the ladder: the last action of a loop. @realtime Yes.
  void release(std::uint64_t now_ns) noexcept RTBUS_NONBLOCKING;

  /// Bookkeeping of the pacer, for the counters. @realtime Yes.
  void count_schedule(std::uint64_t due, std::uint64_t overruns) noexcept RTBUS_NONBLOCKING;

  /// The next unreported event of the last cycle; kNone when there is none left. @realtime Yes.
  [[nodiscard]] LoopEvent take_event() noexcept RTBUS_NONBLOCKING;

  /// How long the loop stood at its last LoopEvent::kPaused. Loop's thread. @realtime Yes.
  [[nodiscard]] std::uint64_t last_pause_ns() const noexcept RTBUS_NONBLOCKING { return last_pause_ns_; }

  /// Everything about the last cycle. Loop's thread only.
  [[nodiscard]] const rtbus::Telemetry& telemetry() const noexcept { return telemetry_; }
  [[nodiscard]] const rtbus::DeviceState& device_state() const noexcept { return state_; }
  [[nodiscard]] const Mapping& mapping() const noexcept { return mapping_; }
  [[nodiscard]] const Method& method() const noexcept { return *method_; }

  /// Counters and percentiles since start. Any thread; not realtime.
  [[nodiscard]] rtbus::LoopStats stats() const;

  /// The newest orders; they act from the next cycle on. One thread, any; not realtime.
  void order(const rtbus::Orders& orders) noexcept { orders_.set(orders); }

 private:
  /// Of one cycle, by the real clock.
  struct CycleTimes {
    std::uint64_t due_ns = 0, began_ns = 0, read_ns = 0, computed_ns = 0, written_ns = 0;
  };

  // The parts of a cycle, in their order.
  [[nodiscard]] bool read_device(std::uint64_t now_ns) noexcept RTBUS_NONBLOCKING;
  [[nodiscard]] bool forces_enabled(bool device_ok, std::uint64_t now_ns) noexcept RTBUS_NONBLOCKING;
  void take_orders() noexcept RTBUS_NONBLOCKING;
  void take_answers(std::uint64_t now_ns) noexcept RTBUS_NONBLOCKING;
  void hear_other_hands() noexcept RTBUS_NONBLOCKING;
  [[nodiscard]] RenderOutput render(std::uint64_t now_ns) noexcept RTBUS_NONBLOCKING;
  [[nodiscard]] SafetyOutput make_safe(const RenderOutput& rendered, bool device_ok, bool enabled,
                                       std::uint64_t now_ns) noexcept RTBUS_NONBLOCKING;
  /// @returns what was written; whether the device took it is in write_failed_.
  [[nodiscard]] rtbus::Vec3 write_force(const Eigen::Vector3d& force_n, std::uint64_t computed_ns,
                                        std::uint64_t now_ns) noexcept RTBUS_NONBLOCKING;
  void tell_physics(const RenderOutput& rendered, const Eigen::Vector3d& walls_n, const Eigen::Vector3d& extra_n,
                    const rtbus::Vec3& written_n, bool enabled, std::uint64_t now_ns) noexcept RTBUS_NONBLOCKING;
  void record_cycle(const RenderOutput& rendered, const SafetyOutput& safe, const rtbus::Vec3& written_n,
                    std::uint64_t due_ns, std::uint64_t now_ns) noexcept RTBUS_NONBLOCKING;
  void record_times(const CycleTimes& at) noexcept RTBUS_NONBLOCKING;

  // Parts of those.
  /// Judges proxy_answer_, and makes the proxy of it.
  void take_proxy(std::uint64_t now_ns) noexcept RTBUS_NONBLOCKING;
  /// Until physics has answered a sample from now on.
  void forget_proxy() noexcept RTBUS_NONBLOCKING;
  void enable_edge(bool enabled, std::uint64_t sample_ns) noexcept RTBUS_NONBLOCKING;
  void follow_clutch(const Eigen::Vector3d& position_m, std::uint32_t buttons,
                     std::uint64_t now_ns) noexcept RTBUS_NONBLOCKING;
  void describe_hand(const drivers::DeviceSample& sample, const Eigen::Vector3d& position_m,
                     bool enabled) noexcept RTBUS_NONBLOCKING;
  void note(LoopEvent event) noexcept RTBUS_NONBLOCKING;
  [[nodiscard]] bool packet_is_due() noexcept RTBUS_NONBLOCKING;
  [[nodiscard]] bool same_scene(const rtbus::ProxyContacts& answer) noexcept RTBUS_NONBLOCKING;
  [[nodiscard]] bool contacts_are_new(std::uint64_t now_ns) noexcept RTBUS_NONBLOCKING;
  /// How long before the newest sample of the hand that one was measured which an answer belongs to.
  [[nodiscard]] std::uint64_t behind_hand(std::uint64_t answered_ns) const noexcept RTBUS_NONBLOCKING;

  const HapticConfig& config_;
  drivers::Device& device_;
  PhysicsLink& link_;
  const bool measure_;
  const double dt_s_;
  const double packets_per_cycle_;  ///< 1: every tick.
  double packet_phase_;             ///< A packet is due when this reaches 1.
  Mapping mapping_;
  std::unique_ptr<Method> method_;
  bool owns_proxy_;  ///< The method simulates the proxy: MethodEntry::needs_contacts.
  VelocityEstimator velocity_;
  SafetyLadder safety_;
  LinkMonitor monitor_;
  OrderBox orders_;
  GainRamp gains_;

  ProxyView proxy_;       ///< Newest proxy, at the device.
  WorldWork world_work_;  ///< Done by it, at the coupling.
  rtbus::Stamped<rtbus::ProxyState> proxy_answer_;
  rtbus::Stamped<rtbus::Heartbeat> heartbeat_sample_;
  rtbus::Stamped<rtbus::ProxyContacts> contacts_answer_;
  std::vector<OtherHand> other_hands_;
  drivers::DeviceSample sample_;
  bool device_ok_ = false;
  bool device_seen_ = false;   ///< It has delivered a sample.
  bool write_failed_ = false;  ///< The last force was not sent: the device applies zero, or will within its time-out.
  std::uint64_t force_timeout_ns_;  ///< The device's own.
  std::uint64_t last_cycle_ns_ = 0;
  std::uint64_t last_pause_ns_ = 0;
  bool enabled_ = false;
  bool begin_anew_ = false;       ///< The next cycle enables forces anew: physics has returned.
  std::uint64_t enabled_ns_ = 0;  ///< When forces were enabled; answers to earlier samples are void.
  bool link_alive_ = false;
  bool other_scene_ = false;   ///< The last contacts were those of another scene: nothing that is near is known.
  std::uint64_t refused_ = 0;  ///< Samples of physics, as of the last cycle.
  bool overspeed_ = false;
  bool estop_ = false;
  bool clutched_ = false;
  Eigen::Vector3d clutch_position_W_ = Eigen::Vector3d::Zero();  ///< Target held in W while clutched.

  rtbus::DeviceState state_{};
  rtbus::Telemetry telemetry_{};
  LoopCounters counters_;
  static constexpr std::size_t kMaxEvents = 8;
  LoopEvent events_[kMaxEvents] = {};
  std::size_t event_count_ = 0;
  std::size_t event_next_ = 0;
};

}  // namespace haptic
