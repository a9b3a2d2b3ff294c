#include "haptic_node/rendering/local_contact.hpp"

#include <algorithm>
#include <cmath>

#include "rtbus/clock.hpp"

namespace haptic {
namespace {

using Eigen::Vector3d;

/// A loop that comes late integrates the time that has passed, up to this many periods.
constexpr double kShortestStep = 0.5, kLongestStep = 20.0;
/// Less than the hand itself has: its models damp by 1 N s/m and more (drivers/simulated/hand_config.cpp).
constexpr double kRestingDamping_n_s_per_m = 0.5;

}  // namespace

RenderOutput LocalContact::render(const RenderInput& input) noexcept {
  const Vector3d tip_W = mapping_.position_to_world(input.position_m);
  RenderOutput out;
  out.proxy_position_m = input.position_m;
  step_s_ = 0.0;
  if (!input.other_hands.empty()) world_.hear(input.other_hands, input.sample_time_ns);
  if (!input.proxy.valid) placed_ = false;
  if (!placed_) {
    world_.reset(tip_W, input.sample_time_ns);
    sample_ns_ = world_ns_ = input.sample_time_ns;
    placed_ = input.proxy.valid;
    return out;
  }
  step_s_ = step_to(input.sample_time_ns, input.dt_s);
  const double to_world = mapping_.config().gain_to_world();
  const LocalSpring spring{tip_W,
                           mapping_.velocity_to_world(input.velocity_m_s),
                           stiffness_n_per_m_ * to_world,
                           damping_n_s_per_m_ * to_world,
                           mapping_.config().force_scale,
                           kRestingDamping_n_s_per_m * to_world};
  if (input.contacts != nullptr) {
    world_.foresee(spring, input.sample_time_ns, step_s_);
    world_.take(*input.contacts, input.sample_time_ns);
    if (const auto moved_m = world_.correction_m()) out.correction_m = *moved_m / mapping_.config().position_scale;
  }
  world_.advance(spring, input.sample_time_ns, step_s_);
  if (!world_.position_m().allFinite()) {  // an answer that made no sense
    world_.felt(Vector3d::Zero());
    placed_ = false;
    step_s_ = 0.0;
    return out;
  }
  out.proxy_position_m = mapping_.position_to_device(world_.position_m());
  out.proxy_velocity_m_s = mapping_.velocity_to_device(world_.velocity_m_s());
  // Massless: what the contacts do to the proxy is what the hand feels.
  out.force_n = mapping_.force_to_device(world_.impulse_n_s() / step_s_);
  out.world_work_j = world_.work_j() / (mapping_.config().force_scale * mapping_.config().position_scale);
  return out;
}

/// A sample that is repeated stands for one period, which the next new one does not count again.
double LocalContact::step_to(std::uint64_t sample_ns, double dt_s) noexcept {
  const bool repeated = sample_ns <= sample_ns_;
  const double ahead_s = world_ns_ < sample_ns ? rtbus::seconds_between(world_ns_, sample_ns) : 0.0;
  const double step_s = repeated ? dt_s : std::clamp(ahead_s, kShortestStep * dt_s, kLongestStep * dt_s);
  if (sample_ns < sample_ns_) world_ns_ = sample_ns;
  sample_ns_ = sample_ns;
  world_ns_ = std::max(sample_ns, world_ns_ + static_cast<std::uint64_t>(std::llround(1e9 * step_s)));
  return step_s;
}

void LocalContact::felt(const Vector3d& force_n) noexcept {
  if (step_s_ > 0.0) world_.felt(-mapping_.force_to_world(force_n) * step_s_);
}

void LocalContact::tell(rtbus::DeviceState& out) const noexcept { world_.hand_impulses().tell(out); }

}  // namespace haptic
