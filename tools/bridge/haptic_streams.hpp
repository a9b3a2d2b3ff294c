#pragma once
/// @file haptic_streams.hpp
/// What of one haptic node goes to ROS 2: its hand, its force, its buttons, its proxy.
#include <array>
#include <cstdint>
#include <optional>
#include <string>

#include "rtbus/messages.hpp"
#include "rtbus/subscription.hpp"
#include "tools/bridge/config/bridge_config.hpp"
#include "tools/bridge/frames.hpp"
#include "tools/bridge/messages.hpp"
#include "tools/bridge/participant.hpp"

namespace bridge {

/// One thread. Observes the bus; writes nothing there.
class HapticStreams {
 public:
  HapticStreams(const rtbus::Session& session, const std::string& node, const BridgeConfig& config);

  /// Makes the DDS writers. The error is a sentence for the user.
  [[nodiscard]] rtbus::Result<void, std::string> open(Participant& participant, const BridgeConfig& config);

  /// Follows topics that come and go. Every 20 ms or so.
  void maintain() noexcept;

  /// Writes the newest sample of `stream` unless it was written before. Not for kTf and kDiagnostics.
  void publish(Stream stream, RosClock& clock);

  /// Adds the frames of hand and proxy where they are newer than the last ones added.
  void add_frames(Transforms& transforms, RosClock& clock);

  [[nodiscard]] const std::string& node() const noexcept { return node_; }
  [[nodiscard]] std::uint64_t written() const noexcept;

 private:
  [[nodiscard]] bool is_new(Stream stream, std::uint64_t sequence) noexcept;
  void publish_device(Stream stream, RosClock& clock, DdsWriter& writer);
  void publish_tick(Stream stream, RosClock& clock, DdsWriter& writer);
  void publish_proxy(Stream stream, RosClock& clock, DdsWriter& writer);

  std::string node_, base_frame_, world_frame_ = kWorld;
  rtbus::Subscription<rtbus::DeviceState> devices_;
  std::optional<rtbus::Subscription<rtbus::Telemetry>>
      ticks_;  ///< Only if asked for: the node makes them for observers.
  rtbus::Subscription<rtbus::ProxyState> proxies_;
  rtbus::Stamped<rtbus::DeviceState> device_{};
  rtbus::Stamped<rtbus::Telemetry> tick_{};
  rtbus::Stamped<rtbus::ProxyState> proxy_{};
  std::array<std::uint64_t, kStreams> published_{};  ///< Sequence of the last sample written.
  std::uint64_t hand_framed_ = 0, proxy_framed_ = 0;
  std::array<std::optional<DdsWriter>, kStreams> writers_;
  Joy joy_;
  JointState joints_;
};

}  // namespace bridge
