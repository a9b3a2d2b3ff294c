#include "tools/bridge/haptic_streams.hpp"

#include "rtbus/eigen.hpp"

namespace bridge {

namespace {

constexpr std::size_t kPerNode = static_cast<std::size_t>(Stream::kTf);

const MessageType& type_of(Stream stream) {
  switch (stream) {
    case Stream::kPose:
    case Stream::kProxyPose:
      return kPoseStamped;
    case Stream::kTwist:
    case Stream::kProxyTwist:
      return kTwistStamped;
    case Stream::kWrench:
    case Stream::kProxyWrench:
      return kWrenchStamped;
    case Stream::kJoy:
      return kJoy;
    case Stream::kJointStates:
      return kJointState;
    case Stream::kTf:
      return kTfMessage;
    case Stream::kDiagnostics:
      break;
  }
  return kDiagnosticArray;
}

}  // namespace

HapticStreams::HapticStreams(const rtbus::Session& session, const std::string& node, const BridgeConfig& config)
    : node_(node),
      base_frame_(base_frame(node)),
      devices_(session, node + ".device_state"),
      proxies_(session, "physics.proxy_state." + node),
      joints_(node) {
  if (config.of(Stream::kWrench).on || config.of(Stream::kJointStates).on) {
    ticks_.emplace(session, node + ".telemetry", rtbus::ReaderOptions{.presence = true});
  }
}

rtbus::Result<void, std::string> HapticStreams::open(Participant& participant, const BridgeConfig& config) {
  for (std::size_t i = 0; i < kPerNode; ++i) {
    const auto stream = static_cast<Stream>(i);
    if (!config.of(stream).on) continue;
    auto writer =
        participant.writer(config.topic(stream, node_), type_of(stream), {.reliable = config.of(stream).reliable});
    if (!writer) return rtbus::Failure{writer.error()};
    writers_[i].emplace(*writer);
  }
  return {};
}

void HapticStreams::maintain() noexcept {
  devices_.maintain();
  proxies_.maintain();
  if (ticks_) ticks_->maintain();
}

std::uint64_t HapticStreams::written() const noexcept {
  std::uint64_t sum = 0;
  for (const auto& writer : writers_) sum += writer ? writer->written() : 0;
  return sum;
}

bool HapticStreams::is_new(Stream stream, std::uint64_t sequence) noexcept {
  std::uint64_t& last = published_[static_cast<std::size_t>(stream)];
  if (sequence == 0 || sequence == last) return false;
  last = sequence;
  return true;
}

void HapticStreams::publish(Stream stream, RosClock& clock) {
  std::optional<DdsWriter>& writer = writers_[static_cast<std::size_t>(stream)];
  if (!writer) return;
  switch (stream) {
    case Stream::kPose:
    case Stream::kTwist:
    case Stream::kJoy:
      publish_device(stream, clock, *writer);
      break;
    case Stream::kWrench:
    case Stream::kJointStates:
      publish_tick(stream, clock, *writer);
      break;
    case Stream::kProxyPose:
    case Stream::kProxyTwist:
    case Stream::kProxyWrench:
      publish_proxy(stream, clock, *writer);
      break;
    case Stream::kTf:
    case Stream::kDiagnostics:
      break;
  }
}

void HapticStreams::publish_device(Stream stream, RosClock& clock, DdsWriter& writer) {
  (void)devices_.read_latest(device_);
  if (!is_new(stream, device_.sequence)) return;
  const rtbus::DeviceState& device = device_.value;
  const Header header = header_of(clock.time_of(device.sample_time_ns), base_frame_);
  if (stream == Stream::kPose) {
    const PoseStamped message = pose_of(header, device.position_m, device.orientation_wxyz);
    writer.write(&message);
  } else if (stream == Stream::kTwist) {
    const TwistStamped message = twist_of(header, device.velocity_m_s, {0.0, 0.0, 0.0});
    writer.write(&message);
  } else {
    writer.write(&joy_.fill(header, device.buttons, device.gripper_m));
  }
}

void HapticStreams::publish_tick(Stream stream, RosClock& clock, DdsWriter& writer) {
  (void)ticks_->read_latest(tick_);
  if (!is_new(stream, tick_.sequence)) return;
  const rtbus::Telemetry& tick = tick_.value;
  const Header header = header_of(clock.time_of(tick.device_time_ns), base_frame_);
  if (stream == Stream::kWrench) {
    const WrenchStamped message = wrench_of(header, tick.force_n);
    writer.write(&message);
  } else {
    writer.write(&joints_.fill(header, tick.position_m, tick.velocity_m_s, tick.force_n));
  }
}

void HapticStreams::publish_proxy(Stream stream, RosClock& clock, DdsWriter& writer) {
  (void)proxies_.read_latest(proxy_);
  if (!is_new(stream, proxy_.sequence)) return;
  const rtbus::ProxyState& proxy = proxy_.value;
  const Header header = header_of(clock.time_of(proxy_.stamp_ns), world_frame_);
  if (stream == Stream::kProxyPose) {
    const PoseStamped message = pose_of(header, proxy.position_m, proxy.orientation_wxyz);
    writer.write(&message);
  } else if (stream == Stream::kProxyTwist) {
    const TwistStamped message = twist_of(header, proxy.velocity_m_s, proxy.angular_velocity_rad_s);
    writer.write(&message);
  } else {
    const WrenchStamped message = wrench_of(header, proxy.contact_force_n);
    writer.write(&message);
  }
}

void HapticStreams::add_frames(Transforms& transforms, RosClock& clock) {
  (void)devices_.read_latest(device_);
  if (device_.sequence != hand_framed_) {
    hand_framed_ = device_.sequence;
    transforms.add(clock.time_of(device_.value.sample_time_ns), base_frame_, hand_frame(node_),
                   rtbus::vector_of(device_.value.position_m), rtbus::quaternion_of(device_.value.orientation_wxyz));
  }
  (void)proxies_.read_latest(proxy_);
  if (proxy_.sequence != proxy_framed_) {
    proxy_framed_ = proxy_.sequence;
    transforms.add(clock.time_of(proxy_.stamp_ns), world_frame_, proxy_frame(node_),
                   rtbus::vector_of(proxy_.value.position_m), rtbus::quaternion_of(proxy_.value.orientation_wxyz));
  }
}

}  // namespace bridge
