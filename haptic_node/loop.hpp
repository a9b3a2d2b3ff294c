#pragma once
/// @file loop.hpp
/// One cycle of the haptic loop: read the device, ask the force law, climb the safety ladder, write the force, tell
/// physics. The realtime thread of the node and the simulated clock of the in-process harness run the same code.
#include <cstdint>
#include <memory>

#include "drivers/device.hpp"
#include "haptic_node/link_monitor.hpp"
#include "haptic_node/loop_counters.hpp"
#include "haptic_node/mapping.hpp"
#include "haptic_node/node_config.hpp"
#include "haptic_node/rendering/renderer.hpp"
#include "haptic_node/safety.hpp"
#include "haptic_node/velocity.hpp"
#include "rtbus/contact_messages.hpp"
#include "rtbus/messages.hpp"
#include "rtbus/realtime.hpp"
#include "rtbus/sample.hpp"

namespace haptic {

/// The loop's way to physics: the bus in a node, a queue with a chosen latency in the harness. @realtime Yes, all of
/// it.
class PhysicsLink {
 public:
  virtual ~PhysicsLink() = default;
  /// Publishes the state of the hand, every cycle.
  virtual void send(const rtbus::DeviceState& state, std::uint64_t now_ns) noexcept RTBUS_NONBLOCKING = 0;
  /// The newest answer of physics; true when it is newer than the last one received.
  [[nodiscard]] virtual bool receive(rtbus::Stamped<rtbus::ProxyState>& out) noexcept RTBUS_NONBLOCKING = 0;
  /// What is around the proxy; likewise. Asked only by a law that needs it. Rows beyond the counts are not to be read;
  /// without an answer `out` may be scribbled on.
  [[nodiscard]] virtual bool receive(rtbus::Stamped<rtbus::ProxyContacts>& /*out*/) noexcept RTBUS_NONBLOCKING {
    return false;
  }
  /// The newest sign of life; true when it is newer than the last one received.
  [[nodiscard]] virtual bool receive(rtbus::Stamped<rtbus::Heartbeat>& out) noexcept RTBUS_NONBLOCKING = 0;
};

/// What happened in a cycle that somebody should be told once, not every tick.
enum class LoopEvent : std::uint8_t {
  kNone,
  kLinkLost,
  kLinkAlive,
  kDeviceLost,
  kDeviceBack,
  kOverspeed,
  kClutched,
  kReleased
};

class Loop {
 public:
  /// @param device,link Outlive the loop. @param config Outlives the loop.
  /// @param measure Record wake-up, compute and device time by the real clock; off under a simulated clock.
  Loop(const HapticConfig& config, drivers::Device& device, PhysicsLink& link, bool measure);

  /// One cycle. @param deadline_ns When it should have started; 0: when the device measured (`clock: device`), so that
  /// the wake-up latency is that from the measurement to here. @param now_ns Now. @realtime Yes.
  void cycle(std::uint64_t deadline_ns, std::uint64_t now_ns) noexcept RTBUS_NONBLOCKING;

  /// Zero force, at once, outside the ladder: the last thing a loop does. @realtime Yes.
  void release(std::uint64_t now_ns) noexcept RTBUS_NONBLOCKING;

  /// Bookkeeping of the pacer, for the counters. @realtime Yes.
  void count_schedule(std::uint64_t due, std::uint64_t overruns) noexcept RTBUS_NONBLOCKING;

  /// The next untold event of the last cycle; kNone when there is none left. @realtime Yes.
  [[nodiscard]] LoopEvent take_event() noexcept RTBUS_NONBLOCKING;

  /// Everything about the last cycle. Loop's thread only.
  [[nodiscard]] const rtbus::Telemetry& telemetry() const noexcept { return telemetry_; }
  [[nodiscard]] const rtbus::DeviceState& device_state() const noexcept { return state_; }
  [[nodiscard]] const Mapping& mapping() const noexcept { return mapping_; }
  [[nodiscard]] const Renderer& renderer() const noexcept { return *renderer_; }

  /// Counters and percentiles since start. Any thread; not realtime.
  [[nodiscard]] rtbus::LoopStats stats() const;

 private:
  [[nodiscard]] bool read_device(std::uint64_t now_ns) noexcept RTBUS_NONBLOCKING;
  void take_news(std::uint64_t now_ns) noexcept RTBUS_NONBLOCKING;
  void enable_edge(bool enabled, std::uint64_t sample_ns) noexcept RTBUS_NONBLOCKING;
  void follow_clutch(const Eigen::Vector3d& position_m, std::uint32_t buttons) noexcept RTBUS_NONBLOCKING;
  void describe_hand(const drivers::DeviceSample& sample, const Eigen::Vector3d& position_m,
                     bool enabled) noexcept RTBUS_NONBLOCKING;
  void note(LoopEvent event) noexcept RTBUS_NONBLOCKING;
  [[nodiscard]] bool packet_is_due() noexcept RTBUS_NONBLOCKING;
  [[nodiscard]] bool contacts_are_new(std::uint64_t now_ns) noexcept RTBUS_NONBLOCKING;

  const HapticConfig& config_;
  drivers::Device& device_;
  PhysicsLink& link_;
  const bool measure_;
  const double dt_s_;
  const double packets_per_cycle_;  ///< 1: every tick.
  double packet_phase_;             ///< A packet is due when this reaches 1.
  Mapping mapping_;
  std::unique_ptr<Renderer> renderer_;
  bool owns_proxy_;  ///< The law does: RendererEntry::needs_contacts.
  VelocityEstimator velocity_;
  SafetyLadder safety_;
  LinkMonitor monitor_;

  ProxyView proxy_;               ///< Newest proxy, at the device.
  std::uint64_t proxy_step_ = 0;  ///< Its step_index; 0: none since the last beginning.
  double begun_j_ = 0.0;          ///< What the world has put in since then, until nothing touched; then negative.
  rtbus::Stamped<rtbus::ProxyState> proxy_news_;
  rtbus::Stamped<rtbus::Heartbeat> beat_news_;
  rtbus::Stamped<rtbus::ProxyContacts> contact_news_;
  drivers::DeviceSample sample_;
  bool device_ok_ = false;
  bool device_seen_ = false;        ///< It has answered once.
  bool write_failed_ = false;       ///< The last force did not leave: the device holds zero, or soon will.
  std::uint64_t force_timeout_ns_;  ///< The device's own.
  std::uint64_t last_cycle_ns_ = 0;
  bool enabled_ = false;
  bool begin_anew_ = false;       ///< The next cycle enables afresh: physics has just come back.
  std::uint64_t enabled_ns_ = 0;  ///< Since when; proxies that answer earlier samples are void.
  bool link_alive_ = false;
  bool overspeed_ = false;
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
