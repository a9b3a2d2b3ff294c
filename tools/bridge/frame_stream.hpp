#pragma once
/// @file frame_stream.hpp
/// `/tf` and `/tf_static`: where hands, proxies and bodies are, in the tree of frames.hpp.
#include <cstdint>
#include <deque>
#include <optional>
#include <string>
#include <vector>

#include "haptic_node/node_config.hpp"
#include "rtbus/config/session.hpp"
#include "tools/bridge/haptic_streams.hpp"
#include "tools/cli/still/still_frame.hpp"

namespace bridge {

/// Fills `transforms` with what never moves: the rotation to `world`, the bases of the devices, the static bodies.
void add_static_frames(Transforms& transforms, builtin_interfaces_msg_dds__Time_ stamp,
                       const std::vector<haptic::HapticConfig>& haptic, const std::vector<rtbus::config::Body>& bodies);

/// One thread.
class FrameStream {
 public:
  /// @param bodies Of the scene; empty when an engine of the user's has bodies of its own, which then are numbered.
  FrameStream(rtbus::Session session, std::vector<rtbus::config::Body> bodies)
      : session_(std::move(session)), bodies_(std::move(bodies)) {}

  /// Makes the DDS writers and publishes what never moves. The error is a sentence for the user.
  [[nodiscard]] rtbus::Result<void, std::string> open(Participant& participant, const BridgeConfig& config,
                                                      const std::vector<haptic::HapticConfig>& haptic, RosClock& clock);

  /// Follows the topic of the bodies. Every 20 ms or so.
  void maintain();
  /// Writes what has moved since the last time.
  void publish(std::deque<HapticStreams>& nodes, RosClock& clock);
  [[nodiscard]] std::uint64_t written() const noexcept { return writer_ ? writer_->written() : 0; }

 private:
  void add_bodies(RosClock& clock);

  rtbus::Session session_;
  std::vector<rtbus::config::Body> bodies_;
  std::optional<tools::BodyPoseReader> reader_;
  std::optional<DdsWriter> writer_;
  Transforms transforms_;
};

}  // namespace bridge
