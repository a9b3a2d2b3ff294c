#pragma once
/// @file node.hpp
/// The haptic node: device, loop and topics put together, with the realtime thread and its housekeeping.
#include <atomic>
#include <cstdint>
#include <memory>
#include <thread>

#include "drivers/device.hpp"
#include "haptic_node/loop.hpp"
#include "haptic_node/node_config.hpp"
#include "rtbus/event_log.hpp"
#include "rtbus/publication.hpp"
#include "rtbus/realtime.hpp"
#include "rtbus/segment.hpp"

namespace haptic {

/// Why a node does not start; the sentence is for the user.
struct NodeFault {
  std::string message;
};

/// Threads: `haptic_loop` (SCHED_FIFO) runs the cycle; `haptic_house` (low SCHED_FIFO when granted) sends the
/// heartbeat, re-attaches topics and publishes statistics; neither ever writes to a terminal. Nothing that the loop
/// needs is shared with a lock.
class Node {
 public:
  /// Opens topics and device, in this order; nothing is left behind when it fails.
  [[nodiscard]] static rtbus::Result<std::unique_ptr<Node>, NodeFault> open(HapticConfig config,
                                                                            const rtbus::Session& session);
  ~Node();

  /// Starts the device, then both threads. Fails when `realtime.policy: enforce` was not granted.
  [[nodiscard]] rtbus::Result<void, NodeFault> start();

  /// Ends a start() that another thread is in and that waits for the device; see drivers::Device::cancel_start().
  void cancel_start() noexcept { device_->cancel_start(); }

  /// Tells the user what the loop and the housekeeping have noted since the last call. One thread. @realtime No.
  void report_events();

  /// Ends the loop at zero force, stops the device, publishes the last statistics. Idempotent.
  void stop() noexcept;

 private:
  struct Topics;
  explicit Node(HapticConfig config);
  void start_threads();
  void loop_thread() noexcept;
  void run_timer(std::uint64_t start_ns) noexcept;
  void run_device(std::uint64_t start_ns) noexcept;
  void after_cycle() noexcept RTBUS_NONBLOCKING;
  void house_thread() noexcept;
  void take_orders() noexcept;
  void publish_stats(double achieved_hz) noexcept;
  [[nodiscard]] std::string left_out() const;

  HapticConfig config_;
  std::unique_ptr<Topics> topics_;
  std::unique_ptr<drivers::Device> device_;
  std::unique_ptr<Loop> loop_;
  rtbus::EventLog events_;
  rtbus::RenewalCount renewals_told_;
  rtbus::RealtimeGrant grant_;
  std::atomic<bool> granted_{false};
  std::atomic<bool> stop_{false};
  std::atomic<bool> house_stop_{false};
  std::atomic<bool> observed_;  ///< The telemetry is published.
  std::atomic<std::uint64_t> last_tick_ns_{0};
  std::thread loop_thread_;
  std::thread house_thread_;
  std::thread pipe_thread_;  ///< `link: pipe` only; not realtime.
};

}  // namespace haptic
