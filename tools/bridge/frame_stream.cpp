#include "tools/bridge/frame_stream.hpp"

#include <utility>

#include "rtbus/clock.hpp"
#include "tools/bridge/frames.hpp"

namespace bridge {

namespace {

/// tf2's own writers keep so many. Those of 500 bodies are more than a slow reader should hold up.
constexpr std::int32_t kDepth = 10;

}  // namespace

void add_static_frames(Transforms& transforms, builtin_interfaces_msg_dds__Time_ stamp,
                       const std::vector<haptic::HapticConfig>& haptic,
                       const std::vector<rtbus::config::Body>& bodies) {
  transforms.add(stamp, kRosWorld, kWorld, Eigen::Vector3d::Zero(), ros_from_world());
  for (const haptic::HapticConfig& node : haptic) {
    transforms.add(stamp, kWorld, base_frame(node.name), node.mapping.offset_m, node.mapping.q_WD);
  }
  for (const rtbus::config::Body& body : bodies) {
    if (body.type == rtbus::config::BodyType::kStatic) {
      transforms.add(stamp, kWorld, body_frame(body.name), body.p_WB, body.q_WB);
    }
  }
}

rtbus::Result<void, std::string> FrameStream::open(Participant& participant, const BridgeConfig& config,
                                                   const std::vector<haptic::HapticConfig>& haptic, RosClock& clock) {
  if (!config.of(Stream::kTf).on) return {};
  auto fixed = participant.writer("/tf_static", kTfMessage, {.latched = true});
  if (!fixed) return rtbus::Failure{fixed.error()};
  add_static_frames(transforms_, clock.time_of(rtbus::monotonic_ns()), haptic, bodies_);
  fixed->write(&transforms_.message());
  auto writer = participant.writer(config.of(Stream::kTf).topic, kTfMessage,
                                   {.reliable = config.of(Stream::kTf).reliable, .depth = kDepth});
  if (!writer) return rtbus::Failure{writer.error()};
  writer_.emplace(*writer);
  return {};
}

void FrameStream::maintain() {
  if (!writer_ || (reader_ && !reader_->replaced())) return;
  reader_.reset();
  if (auto opened = tools::BodyPoseReader::open(session_)) reader_.emplace(std::move(*opened));
}

void FrameStream::add_bodies(RosClock& clock) {
  if (!reader_ || !reader_->drain()) return;
  const auto& poses = reader_->poses();
  const bool named = poses.size() == bodies_.size();
  const auto now = clock.time_of(rtbus::monotonic_ns());
  for (std::size_t i = 0; i < poses.size(); ++i) {
    if (named && bodies_[i].type == rtbus::config::BodyType::kStatic) continue;
    transforms_.add(now, kWorld, body_frame(named ? bodies_[i].name : std::to_string(i)), poses[i].position_m,
                    poses[i].orientation);
  }
}

void FrameStream::publish(std::deque<HapticStreams>& nodes, RosClock& clock) {
  if (!writer_) return;
  transforms_.clear();
  for (HapticStreams& node : nodes) node.add_frames(transforms_, clock);
  add_bodies(clock);
  if (!transforms_.empty()) writer_->write(&transforms_.message());
}

}  // namespace bridge
