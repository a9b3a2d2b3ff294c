#include "tools/cli/still/still_frame.hpp"

#include <algorithm>
#include <cstdio>
#include <utility>

#include "haptic_node/rendering/mapping.hpp"
#include "rtbus/eigen.hpp"

namespace tools {

namespace {

using rtbus::vector_of;

std::string seconds_text(double seconds) {
  char text[32];
  std::snprintf(text, sizeof text, "%.2f s", seconds);
  return text;
}

/// Where hand and proxy are in W. The hand is what pulls the proxy, unless the method moves the proxy itself and
/// tells physics where it has it.
void place(const StillHandConfig& config, const rtbus::DeviceState& device, const rtbus::Telemetry& tick,
           StillHand& out) {
  out.target_m = vector_of(device.target_position_m);
  if ((device.wants & rtbus::kOwnsProxy) == 0) return;
  out.proxy_m = out.target_m;
  const Eigen::Vector3d away_m = vector_of(tick.position_m) - vector_of(tick.proxy_position_m);
  out.target_m += config.position_scale * (config.q_WD * away_m);
}

}  // namespace

StillFrame frame_of(const rtbus::config::Scene& scene) {
  StillFrame frame;
  frame.stem = "still";
  frame.moment = "as placed";
  for (const rtbus::config::Body& body : scene.bodies) frame.poses.push_back({body.p_WB, body.q_WB});
  for (const rtbus::config::SoftBody& body : scene.soft_bodies) {
    for (const Eigen::Vector3d& vertex : body.mesh->vertices_m)
      frame.soft_nodes_m.push_back(body.p_WB + body.q_WB * vertex);
  }
  return frame;
}

StillHandConfig hand_config(const haptic::HapticConfig& haptic, const physics::NodeConfig* physics) {
  StillHandConfig out{haptic.name, 0.0, haptic.mapping.q_WD, haptic.mapping.position_scale};
  if (physics == nullptr) return out;
  for (const physics::ProxyConfig& proxy : physics->proxies) {
    if (proxy.device == haptic.name) out.radius_m = proxy.radius_m;
  }
  return out;
}

StillFrame frame_of(const rtbus::config::Scene& scene, const Harness& harness,
                    std::span<const rtbus::Telemetry> ticks) {
  StillFrame frame = frame_of(scene);
  frame.moment = "simulated time " + seconds_text(harness.now_s());
  const physics::Stepper* stepper = harness.stepper();
  for (std::size_t i = 0; i < std::min(harness.hands(), ticks.size()); ++i) {
    const haptic::HapticConfig& config = harness.config(i);
    StillHand hand;
    hand.name = config.name;
    hand.force_n = config.mapping.q_WD * vector_of(ticks[i].force_n);
    if (stepper != nullptr) {
      hand.radius_m = stepper->proxy(i).radius_m;
      hand.proxy_m = vector_of(stepper->answer(i).position_m);
    } else {
      hand.proxy_m = haptic::Mapping(config.mapping).position_to_world(vector_of(ticks[i].proxy_position_m));
    }
    place(hand_config(config, nullptr), harness.device_state(i), ticks[i], hand);
    frame.hands.push_back(hand);
  }
  for (std::size_t i = 0; stepper != nullptr && i < frame.poses.size(); ++i) {
    frame.poses[i] = stepper->world().body_pose(i);
  }
  for (std::size_t i = 0; stepper != nullptr && i < frame.soft_nodes_m.size(); ++i) {
    frame.soft_nodes_m[i] = stepper->world().soft_node(i);
  }
  return frame;
}

StillHand hand_of(const StillHandConfig& config, const rtbus::DeviceState& device, const rtbus::ProxyState* proxy,
                  const rtbus::Telemetry& tick) {
  StillHand out;
  out.name = config.name;
  out.radius_m = config.radius_m;
  out.proxy_m = vector_of(proxy != nullptr ? proxy->position_m : device.target_position_m);
  place(config, device, tick, out);
  out.force_n = config.q_WD * vector_of(tick.force_n);
  return out;
}

rtbus::Result<BodyPoseReader, rtbus::TopicError> BodyPoseReader::open(const rtbus::Session& session) {
  auto reader = rtbus::Reader<rtbus::BodyPoses>::open(session, "physics.body_poses", {.presence = true});
  if (!reader) return rtbus::Failure{reader.error()};
  return BodyPoseReader(std::move(*reader));
}

bool BodyPoseReader::drain() {
  bool fresh = false;
  rtbus::Stamped<rtbus::BodyPoses> sample;
  while (reader_.read_next(sample) == rtbus::ReadStatus::kFresh) {
    const rtbus::BodyPoses& part = sample.value;
    if (part.first_body == 0) {
      partial_.clear();
      frame_ = part.frame;
    }
    // Whoever comes in the middle of a frame, or lost a part of one, waits for the next.
    if (part.frame != frame_ || part.first_body != partial_.size() || part.count > rtbus::BodyPoses::kBodies) {
      frame_ = 0;
      continue;
    }
    for (std::uint32_t i = 0; i < part.count; ++i) {
      partial_.push_back({vector_of(part.position_m[i]), rtbus::quaternion_of(part.orientation_wxyz[i])});
    }
    if (partial_.size() != part.bodies) continue;
    complete_ = partial_;
    simulated_s_ = part.simulated_s;
    fresh = true;
  }
  return fresh;
}

rtbus::Result<SoftNodeReader, rtbus::TopicError> SoftNodeReader::open(const rtbus::Session& session) {
  auto reader = rtbus::Reader<rtbus::SoftNodes>::open(session, "physics.soft_nodes", {.presence = true});
  if (!reader) return rtbus::Failure{reader.error()};
  return SoftNodeReader(std::move(*reader));
}

bool SoftNodeReader::drain() {
  bool fresh = false;
  rtbus::Stamped<rtbus::SoftNodes> sample;
  while (reader_.read_next(sample) == rtbus::ReadStatus::kFresh) {
    const rtbus::SoftNodes& part = sample.value;
    if (part.first_node == 0) {
      partial_.clear();
      frame_ = part.frame;
    }
    // As of body poses: an incomplete frame waits for the next.
    if (part.frame != frame_ || part.first_node != partial_.size() || part.count > rtbus::SoftNodes::kNodes) {
      frame_ = 0;
      continue;
    }
    for (std::uint32_t i = 0; i < part.count; ++i) {
      const auto& [x, y, z] = part.position_um[i];
      partial_.push_back(1e-6 * Eigen::Vector3d(x, y, z));
    }
    if (partial_.size() != part.nodes) continue;
    complete_ = partial_;
    fresh = true;
  }
  return fresh;
}

BusFrames::BusFrames(rtbus::Session session, rtbus::config::Scene scene, std::vector<StillHandConfig> hands)
    : session_(std::move(session)), scene_(std::move(scene)), told_(session_.name), newest_(frame_of(scene_)) {
  for (StillHandConfig& hand : hands) hands_.emplace_back().config = std::move(hand);
  moving_ = std::any_of(scene_.bodies.begin(), scene_.bodies.end(),
                        [](const auto& body) { return body.type != rtbus::config::BodyType::kStatic; });
  yields_ = !scene_.soft_bodies.empty();
}

void BusFrames::follow_told_shapes() {
  if (!told_.follow()) return;
  scene_.bodies = told_.told()->shown;
  newest_ = frame_of(scene_);
  moving_ = true;
}

bool BusFrames::attach() {
  follow_told_shapes();
  bool all = true;
  const auto open = [&]<class T>(std::optional<rtbus::Reader<T>>& reader, const std::string& topic, bool presence) {
    if (reader && !reader->replaced()) return true;
    auto opened = rtbus::Reader<T>::open(session_, topic, {.presence = presence});
    if (opened) reader.emplace(std::move(*opened));
    return reader.has_value();
  };
  for (Hand& hand : hands_) {
    all = open(hand.device, hand.config.name + ".device_state", false) && all;
    all = open(hand.telemetry, hand.config.name + ".telemetry", true) && all;
    (void)open(hand.proxy, "physics.proxy_state." + hand.config.name, false);  // `direct` has none
  }
  if (moving_ && (!bodies_ || bodies_->replaced())) {
    auto opened = BodyPoseReader::open(session_);
    if (opened) bodies_.emplace(std::move(*opened));
    all = bodies_.has_value() && all;
  }
  if (yields_ && (!soft_ || soft_->replaced())) {
    auto opened = SoftNodeReader::open(session_);
    if (opened) soft_.emplace(std::move(*opened));
    all = soft_.has_value() && all;
  }
  return all;
}

bool BusFrames::drain() {
  (void)attach();  // a topic may have been created again
  bool hands_there = true;
  std::uint64_t newest_tick_ns = 0;
  for (Hand& hand : hands_) {
    if (hand.device) (void)hand.device->read_latest(hand.device_now);
    if (hand.proxy) (void)hand.proxy->read_latest(hand.proxy_now);
    if (hand.telemetry) (void)hand.telemetry->read_latest(hand.tick_now);
    hands_there = hands_there && hand.device_now.sequence > 0 && hand.tick_now.sequence > 0;
    newest_tick_ns = std::max(newest_tick_ns, hand.tick_now.stamp_ns);
  }
  if (soft_) {
    (void)soft_->drain();
    if (soft_->nodes_m().empty()) return false;
    if (soft_->nodes_m().size() != newest_.soft_nodes_m.size()) return false;  // of another scene
    newest_.soft_nodes_m = soft_->nodes_m();
  }
  if (bodies_) {
    if (!bodies_->drain() || !hands_there) return false;
    const auto& told = told_.told();
    if (bodies_->poses().size() != (told ? told->bodies : newest_.poses.size())) return false;  // of another scene
    newest_.poses = told ? told->placed(bodies_->poses()) : bodies_->poses();
    newest_.moment = "simulated time " + seconds_text(bodies_->simulated_s());
  } else if (!hands_there || newest_tick_ns == taken_ns_) {
    return false;
  }
  taken_ns_ = newest_tick_ns;
  newest_.hands.clear();
  for (const Hand& hand : hands_) {
    const rtbus::ProxyState* const proxy = hand.proxy_now.sequence > 0 ? &hand.proxy_now.value : nullptr;
    newest_.hands.push_back(hand_of(hand.config, hand.device_now.value, proxy, hand.tick_now.value));
  }
  return true;
}

}  // namespace tools
