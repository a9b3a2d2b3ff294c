#include "physics_node/pose_publisher.hpp"

#include <algorithm>
#include <bit>
#include <utility>

namespace physics {

using rtbus::BodyPoses;

rtbus::Result<std::unique_ptr<PosePublisher>, rtbus::TopicError> PosePublisher::create(const rtbus::Session& session,
                                                                                       std::size_t bodies) {
  const std::size_t samples_per_frame =
      std::max<std::size_t>(1, (bodies + BodyPoses::kBodies - 1) / BodyPoses::kBodies);
  const auto capacity = static_cast<std::uint32_t>(std::bit_ceil(4 * samples_per_frame));
  auto writer = rtbus::Publication<BodyPoses>::create(session, "physics.body_poses", {.capacity = capacity});
  if (!writer) return rtbus::Failure{writer.error()};
  return std::unique_ptr<PosePublisher>(new PosePublisher(std::move(*writer)));
}

void PosePublisher::publish_if_due(const Stepper& stepper, std::uint64_t now_ns) noexcept {
  if (!observed() || now_ns < due_ns_) return;
  due_ns_ = now_ns + kPeriod_ns;
  const World& world = stepper.world();
  BodyPoses sample;
  sample.frame = ++frames_;
  sample.step_index = stepper.steps();
  sample.simulated_s = stepper.simulated_s();
  sample.bodies = static_cast<std::uint32_t>(world.bodies());
  do {
    sample.count = std::min(BodyPoses::kBodies, sample.bodies - sample.first_body);
    for (std::uint32_t i = 0; i < sample.count; ++i) {
      const BodyPose pose = world.body_pose(sample.first_body + i);
      const Eigen::Vector3d& p = pose.position_m;
      const Eigen::Quaterniond& q = pose.orientation;
      sample.position_m[i] = {p.x(), p.y(), p.z()};
      sample.orientation_wxyz[i] = {q.w(), q.x(), q.y(), q.z()};
    }
    for (std::uint32_t i = sample.count; i < BodyPoses::kBodies; ++i) {
      sample.position_m[i] = {};
      sample.orientation_wxyz[i] = {};
    }
    writer_.publish(sample, now_ns);
    sample.first_body += sample.count;
  } while (sample.first_body < sample.bodies);
}

}  // namespace physics
