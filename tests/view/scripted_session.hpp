#pragma once
/// @file scripted_session.hpp
/// The topics of a session on config/wall.yaml whose every sample the test chooses: for what a real session does not do
/// at a known instant. The samples go over the real bus.
#include <atomic>
#include <cmath>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <utility>

#include "rtbus/clock.hpp"
#include "rtbus/messages.hpp"
#include "rtbus/topic.hpp"

namespace tests {

class ScriptedSession {
 public:
  /// What the next ticks say.
  struct Script {
    rtbus::Vec3 proxy_m{0.0, 0.02, 0.0};
    rtbus::Vec3 device_m{0.0, 0.015, 0.0};
    rtbus::Vec3 force_n{0.0, 1.0, 0.0};
    double gate = 1.0;
    std::uint32_t safety = 0;
  };

  explicit ScriptedSession(const std::string& name) {
    session_.name = name;
    telemetry_.emplace(make<rtbus::Telemetry>("haptic0.telemetry", 2048));
    device_.emplace(make<rtbus::DeviceState>("haptic0.device_state", 2048));
    info_.emplace(make<rtbus::NodeInfo>("haptic0.node_info", 4));
    heartbeat_.emplace(make<rtbus::Heartbeat>("haptic0.heartbeat", 16));
    proxy_.emplace(make<rtbus::ProxyState>("physics.proxy_state.haptic0", 1024));
    thread_ = std::thread([this] { run(); });
  }
  ~ScriptedSession() {
    ends_ = true;
    thread_.join();
  }
  ScriptedSession(const ScriptedSession&) = delete;
  ScriptedSession& operator=(const ScriptedSession&) = delete;

  void set(const Script& script) {
    const std::lock_guard lock(mutex_);
    script_ = script;
  }
  /// One tick of this force.
  void spike(double force_n) {
    const std::lock_guard lock(mutex_);
    spike_n_ = force_n;
  }

 private:
  template <class T>
  rtbus::Writer<T> make(const std::string& topic, std::uint32_t capacity) {
    auto writer = rtbus::Writer<T>::create(session_, topic, {.capacity = capacity});
    if (!writer) std::abort();
    return std::move(*writer);
  }

  void run() {
    rtbus::NodeInfo info;
    rtbus::set_text(info.role, "haptic");
    rtbus::set_text(info.kind, "phantom_desktop");
    rtbus::set_text(info.method, "remote_virtual_coupling");
    info.core = 0xffffffff;
    std::uint64_t due_ns = rtbus::monotonic_ns();
    for (std::uint64_t tick = 1; !ends_; ++tick) {
      rtbus::sleep_until(due_ns += rtbus::kNsPerMs);
      const std::uint64_t now_ns = rtbus::monotonic_ns();
      publish_tick(tick, due_ns, now_ns);
      if (tick % 20 == 1) {
        rtbus::Heartbeat beat;
        beat.beats = tick;
        beat.pid = static_cast<std::uint32_t>(::getpid());
        beat.state = static_cast<std::uint32_t>(rtbus::NodeState::kRunning);
        heartbeat_->publish(beat, now_ns);
        info_->publish(info, now_ns);
      }
    }
  }

  void publish_tick(std::uint64_t number, std::uint64_t due_ns, std::uint64_t now_ns) {
    const std::lock_guard lock(mutex_);
    rtbus::ProxyState proxy;
    proxy.position_m = script_.proxy_m;
    proxy.step_s = 0.001;
    proxy.step_compute_s = 0.0001;
    proxy.step_index = number;
    proxy_->publish(proxy, now_ns);
    rtbus::DeviceState device;
    device.position_m = device.target_position_m = script_.device_m;
    device.enabled = 1;
    device_->publish(device, now_ns);
    rtbus::Telemetry tick;
    tick.tick = number;
    tick.due_ns = due_ns;
    tick.position_m = script_.device_m;
    tick.proxy_position_m = script_.proxy_m;
    tick.force_n = script_.force_n;
    if (const double spike_n = std::exchange(spike_n_, 0.0); spike_n != 0.0) tick.force_n = {0.0, spike_n, 0.0};
    tick.gate = script_.gate;
    tick.safety = script_.safety;
    tick.proxy_sequence = number;
    tick.wakeup_us = 5.0;
    telemetry_->publish(tick, now_ns);
  }

  rtbus::Session session_;
  std::optional<rtbus::Writer<rtbus::Telemetry>> telemetry_;
  std::optional<rtbus::Writer<rtbus::DeviceState>> device_;
  std::optional<rtbus::Writer<rtbus::NodeInfo>> info_;
  std::optional<rtbus::Writer<rtbus::Heartbeat>> heartbeat_;
  std::optional<rtbus::Writer<rtbus::ProxyState>> proxy_;
  std::mutex mutex_;
  Script script_;
  double spike_n_ = 0.0;
  std::atomic<bool> ends_{false};
  std::thread thread_;
};

}  // namespace tests
