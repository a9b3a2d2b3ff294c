#pragma once
/// @file node.hpp
/// The physics node: a Stepper between the bus and the clock.
///
/// Threads: `physics_step` reads the devices, steps, publishes. `physics_beat` publishes the heartbeat every 20 ms,
/// attaches to topics, and publishes the statistics. It continues during a long step, so that a slow engine and a dead
/// process can be distinguished, and gives the step thread its priority (WorkerScheduling). No hand's safety depends on
/// either.
#include <atomic>
#include <cstdint>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "physics_node/contact_points.hpp"
#include "physics_node/contact_topics.hpp"
#include "physics_node/frame_publisher.hpp"
#include "physics_node/node_config.hpp"
#include "physics_node/stepper.hpp"
#include "rtbus/histogram.hpp"
#include "rtbus/result.hpp"
#include "rtbus/worker_scheduling.hpp"

namespace physics {

/// Why the node could not start: one sentence for the user.
struct NodeFault {
  std::string message;
};

/// Life: open() → start() → stop(), which the destructor repeats. One thread calls these.
///
/// Fixed clock: one step of 1/rate_hz in every period; deadlines are absolute. A step that is late is counted and not
/// caught up: simulated time then falls behind the wall clock. Throttled clock: the devices are read at the start of a
/// period of 1/throttle_hz, the step advances as much, and the answer is held back until the period is over, as a slow
/// engine would deliver it. A step that takes longer is late: its answer goes out when it is there, and the next step
/// begins at once.
///
/// `step_on: packet` (the paper's server): no clock. The step thread waits until the first haptic node has sent a
/// packet, steps once, and publishes at once, or, throttled, when the period of the throttle is over. Over the bus it
/// polls every 0.25 ms, since a realtime loop wakes nobody; at a pipe it blocks.
///
/// Free clock: steps back to back. Each advances the time since the step before it began, so simulated time follows the
/// wall clock at whatever rate the engine manages. A step is never longer than 1/rate_hz, for which the scene was made:
/// an engine slower than that falls behind the wall clock, and the step counts as late. Nor is it shorter than
/// kShortestFreeStepNs: a faster engine waits. The step thread keeps off the CPUs of the haptic loops.
///
/// The proxy of a haptic node that has not published for kDeviceSilentNs is released: it pulls and touches nothing.
/// (With `link: dds` the largest round trip is added.)
/// When the node publishes again, the proxy starts at its target, at rest.
class Node {
 public:
  static constexpr std::uint64_t kDeviceSilentNs = 100'000'000;
  static constexpr std::uint64_t kBeatPeriodNs = 20'000'000;
  static constexpr std::uint64_t kShortestFreeStepNs = 50'000;

  /// Makes the world and creates the topics. Throws rtbus::config::Error when the engine refuses the scene.
  [[nodiscard]] static rtbus::Result<std::unique_ptr<Node>, NodeFault> open(NodeConfig config);
  /// The same around a world that is there already.
  [[nodiscard]] static rtbus::Result<std::unique_ptr<Node>, NodeFault> open(NodeConfig config,
                                                                            std::unique_ptr<World> world);
  ~Node();
  Node(const Node&) = delete;
  Node& operator=(const Node&) = delete;

  void start();
  /// Ends after the step that is running. The last heartbeat says kStopping; the topics are unlinked with the node.
  void stop() noexcept;

 private:
  struct Topics;
  class Beats;
  explicit Node(NodeConfig config);
  void step_thread() noexcept;
  void step_on_time() noexcept;
  void step_throttled() noexcept;
  void step_freely() noexcept;
  void count_step(std::uint64_t compute_ns, std::uint64_t due, double wall_s, bool late) noexcept;
  void beat_thread() noexcept;
  void step_on_packets() noexcept;
  /// Takes the newest state of each device. @returns whether the first one had a new sample.
  bool read_devices() noexcept;
  bool hear_all(std::size_t device, rtbus::Stamped<rtbus::DeviceState>& newest) noexcept;
  [[nodiscard]] bool wait_for_packet() noexcept;
  void publish_answers(std::uint64_t compute_ns) noexcept;
  /// Called after the answers are published: the hand does not wait for observers.
  void publish_pictures(std::uint64_t now_ns) noexcept;
  [[nodiscard]] std::string left_out() const;
  [[nodiscard]] bool sleep_unless_stopped(std::uint64_t deadline_ns) const noexcept;
  [[nodiscard]] std::uint64_t period_ns() const noexcept;

  NodeConfig config_;
  std::unique_ptr<Topics> topics_;
  ContactTopics contact_topics_;
  std::unique_ptr<Stepper> stepper_;  // of the step thread once it runs
  ContactPointTopics contact_points_;
  std::unique_ptr<PosePublisher> poses_;           // null: nothing in this scene moves
  std::unique_ptr<SoftNodePublisher> soft_nodes_;  // null: nothing in this scene is soft
  std::vector<std::uint64_t> heard_ns_;  // when each device last published; 0: never, or silence already noticed
  rtbus::Stamped<rtbus::BodyOrders> body_orders_{};

  // Written by the step thread, read by the beat thread.
  rtbus::Histogram step_time_ns_;
  std::atomic<std::uint64_t> steps_{0}, due_{0}, late_{0}, ignored_{0}, recoveries_{0}, last_work_ns_{0},
      last_compute_ns_{0};
  std::atomic<double> simulated_s_{0.0}, wall_s_{0.0};  // of the steps so far; the time in which they were due

  rtbus::WorkerScheduling scheduling_;  // of the step thread
  std::atomic<bool> stop_steps_{false}, stop_beats_{false};
  std::thread step_thread_, beat_thread_;
};

}  // namespace physics
