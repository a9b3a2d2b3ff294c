#include "physics_node/soft_node_publisher.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <utility>

namespace physics {

using rtbus::SoftNodes;

namespace {

/// Clamped to what the message holds: a node that is not finite never leaves the world.
std::int32_t micrometres(double length_m) {
  constexpr double kMost_um = 2147483647.0;
  return static_cast<std::int32_t>(std::lround(std::clamp(1e6 * length_m, -kMost_um, kMost_um)));
}

}  // namespace

rtbus::Result<std::unique_ptr<SoftNodePublisher>, rtbus::TopicError> SoftNodePublisher::create(
    const rtbus::Session& session, std::size_t nodes) {
  const std::size_t samples_per_frame = (nodes + SoftNodes::kNodes - 1) / SoftNodes::kNodes;
  const auto capacity = static_cast<std::uint32_t>(std::bit_ceil(4 * samples_per_frame));
  auto writer = rtbus::Publication<SoftNodes>::create(session, "physics.soft_nodes", {.capacity = capacity});
  if (!writer) return rtbus::Failure{writer.error()};
  return std::unique_ptr<SoftNodePublisher>(new SoftNodePublisher(std::move(*writer)));
}

void SoftNodePublisher::publish_if_due(const Stepper& stepper, std::uint64_t now_ns) noexcept {
  if (!observed() || now_ns < due_ns_) return;
  due_ns_ = now_ns + kPeriod_ns;
  const World& world = stepper.world();
  SoftNodes sample;
  sample.frame = ++frames_;
  sample.step_index = stepper.steps();
  sample.simulated_s = stepper.simulated_s();
  sample.nodes = static_cast<std::uint32_t>(world.soft_nodes());
  for (; sample.first_node < sample.nodes; sample.first_node += sample.count) {
    sample.count = std::min(SoftNodes::kNodes, sample.nodes - sample.first_node);
    for (std::uint32_t i = 0; i < SoftNodes::kNodes; ++i) {
      const Eigen::Vector3d at = i < sample.count ? world.soft_node(sample.first_node + i) : Eigen::Vector3d::Zero();
      sample.position_um[i] = {micrometres(at.x()), micrometres(at.y()), micrometres(at.z())};
    }
    writer_.publish(sample, now_ns);
  }
}

}  // namespace physics
