#pragma once
/// @file harness.hpp
/// Both cores in one process under a simulated clock: the same loop, ladder, stepper and device as the nodes run,
/// without threads, sleeps or shared memory. Two runs of one session are bit-identical.
#include <cstdint>
#include <deque>
#include <functional>
#include <memory>
#include <optional>
#include <utility>

#include "drivers/device.hpp"
#include "haptic_node/loop.hpp"
#include "haptic_node/node_config.hpp"
#include "haptic_node/rendering/registry.hpp"
#include "physics_node/node_config.hpp"
#include "physics_node/stepper.hpp"
#include "rtbus/config/session.hpp"

namespace tools {

/// What the link between the nodes does to the data, and when physics falls silent.
struct HarnessOptions {
  double latency_s = 0.0;  ///< From a step's publication to its arrival at the loop.
  /// Start of the first physics period after the start of the run. With `step_on: packet` the packets are sampled and
  /// answered at these instants, as by the paper's thread, which runs beside the loop and not in step with it.
  double physics_phase_s = 0.0;
  double physics_dies_s = -1.0;     ///< Neither heartbeat nor step from then on; negative: never.
  double physics_returns_s = -1.0;  ///< … until then; negative: never.
};

/// One haptic node of a session (the first) with its physics, stepped by hand.
class Harness {
 public:
  using Observer = std::function<void(const rtbus::Telemetry&)>;

  /// @param session Is consumed: its node maps are read. Throws rtbus::config::Error; std::runtime_error when the
  /// device cannot be opened (`process: own` has no place here).
  Harness(rtbus::config::SessionConfig& session, const HarnessOptions& options);

  /// Simulates `duration_s` more and shows each cycle to `observer`.
  void run(double duration_s, const Observer& observer);

  [[nodiscard]] double now_s() const noexcept;  ///< Simulated time since the start.
  [[nodiscard]] const haptic::HapticConfig& config() const noexcept { return config_; }
  [[nodiscard]] rtbus::LoopStats stats() const { return loop_->stats(); }
  [[nodiscard]] const rtbus::DeviceState& device_state() const noexcept { return loop_->device_state(); }
  /// FNV-1a over every cycle's telemetry so far: the fingerprint of a run.
  [[nodiscard]] std::uint64_t hash() const noexcept { return hash_; }

 private:
  /// The link of the simulated clock: newest state out, delayed answers in.
  struct Link final : haptic::PhysicsLink {
    void send(const rtbus::DeviceState& state, std::uint64_t) noexcept override {
      device.value = state;
      ++device.sequence;
    }
    bool receive(rtbus::Stamped<rtbus::ProxyState>& out) noexcept override {
      return std::exchange(proxy_fresh, false) && (out = proxy, true);
    }
    bool receive(rtbus::Stamped<rtbus::Heartbeat>& out) noexcept override {
      return std::exchange(beat_fresh, false) && (out = beat, true);
    }
    rtbus::Stamped<rtbus::DeviceState> device;
    rtbus::Stamped<rtbus::ProxyState> proxy;
    rtbus::Stamped<rtbus::Heartbeat> beat;
    bool proxy_fresh = false;
    bool beat_fresh = false;
  };

  void advance_physics(std::uint64_t now_ns);
  void step_physics(std::uint64_t begin_ns);
  [[nodiscard]] bool physics_silent(std::uint64_t now_ns) const noexcept;

  HarnessOptions options_;
  haptic::HapticConfig config_;
  std::optional<physics::PhysicsConfig> physics_;
  std::unique_ptr<physics::Stepper> stepper_;
  std::unique_ptr<drivers::Device> device_;
  Link link_;
  std::unique_ptr<haptic::Loop> loop_;
  std::deque<rtbus::Stamped<rtbus::ProxyState>> under_way_;  ///< stamp_ns: when it arrives.
  std::uint64_t now_ns_;
  std::uint64_t next_tick_ns_;
  std::uint64_t next_step_ns_ = 0;
  std::uint64_t next_beat_ns_ = 0;
  std::uint64_t proxies_sent_ = 0;
  std::uint64_t hash_ = 0xcbf29ce484222325ULL;
};

}  // namespace tools
