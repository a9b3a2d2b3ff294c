#include "physics_node/frame_publisher.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <utility>

#include "rtbus/eigen.hpp"

namespace physics {

namespace {

using rtbus::BodyPoses;
using rtbus::SoftNodes;

/// Clamped to what the message holds: a node that is not finite never leaves the world.
std::int32_t micrometres(double length_m) {
  constexpr double kMost_um = 2147483647.0;
  return static_cast<std::int32_t>(std::lround(std::clamp(1e6 * length_m, -kMost_um, kMost_um)));
}

/// What differs between the two messages.
template <class Sample>
struct Frame;

template <>
struct Frame<BodyPoses> {
  static constexpr const char* kTopic = "physics.body_poses";
  static constexpr std::uint32_t kItems = BodyPoses::kBodies;
  static std::uint32_t& items(BodyPoses& sample) { return sample.bodies; }
  static std::uint32_t& first(BodyPoses& sample) { return sample.first_body; }
  static std::size_t count(const World& world) { return world.bodies(); }
  static void fill(BodyPoses& sample, std::uint32_t i, const World& world, std::uint32_t body) {
    const BodyPose pose = world.body_pose(body);
    sample.position_m[i] = rtbus::array_of(pose.position_m);
    sample.orientation_wxyz[i] = rtbus::array_of(pose.orientation);
  }
  static void clear(BodyPoses& sample, std::uint32_t i) {
    sample.position_m[i] = {};
    sample.orientation_wxyz[i] = {};
  }
};

template <>
struct Frame<SoftNodes> {
  static constexpr const char* kTopic = "physics.soft_nodes";
  static constexpr std::uint32_t kItems = SoftNodes::kNodes;
  static std::uint32_t& items(SoftNodes& sample) { return sample.nodes; }
  static std::uint32_t& first(SoftNodes& sample) { return sample.first_node; }
  static std::size_t count(const World& world) { return world.soft_nodes(); }
  static void fill(SoftNodes& sample, std::uint32_t i, const World& world, std::uint32_t node) {
    const Eigen::Vector3d at = world.soft_node(node);
    sample.position_um[i] = {micrometres(at.x()), micrometres(at.y()), micrometres(at.z())};
  }
  static void clear(SoftNodes& sample, std::uint32_t i) { sample.position_um[i] = {}; }
};

}  // namespace

template <class Sample>
rtbus::Result<std::unique_ptr<FramePublisher<Sample>>, rtbus::TopicError> FramePublisher<Sample>::create(
    const rtbus::Session& session, std::size_t items) {
  const std::size_t samples_per_frame =
      std::max<std::size_t>(1, (items + Frame<Sample>::kItems - 1) / Frame<Sample>::kItems);
  const auto capacity = static_cast<std::uint32_t>(std::bit_ceil(4 * samples_per_frame));
  auto writer = rtbus::Publication<Sample>::create(session, Frame<Sample>::kTopic, {.capacity = capacity});
  if (!writer) return rtbus::Failure{writer.error()};
  return std::unique_ptr<FramePublisher>(new FramePublisher(std::move(*writer)));
}

template <class Sample>
void FramePublisher<Sample>::publish_if_due(const Stepper& stepper, std::uint64_t now_ns) noexcept {
  using F = Frame<Sample>;
  if (!observed() || now_ns < due_ns_) return;
  due_ns_ = now_ns + kPeriod_ns;
  const World& world = stepper.world();
  Sample sample;
  sample.frame = ++frames_;
  sample.step_index = stepper.steps();
  sample.simulated_s = stepper.simulated_s();
  F::items(sample) = static_cast<std::uint32_t>(F::count(world));
  do {
    sample.count = std::min(F::kItems, F::items(sample) - F::first(sample));
    for (std::uint32_t i = 0; i < sample.count; ++i) F::fill(sample, i, world, F::first(sample) + i);
    for (std::uint32_t i = sample.count; i < F::kItems; ++i) F::clear(sample, i);
    writer_.publish(sample, now_ns);
    F::first(sample) += sample.count;
  } while (F::first(sample) < F::items(sample));
}

template class FramePublisher<BodyPoses>;
template class FramePublisher<SoftNodes>;

}  // namespace physics
