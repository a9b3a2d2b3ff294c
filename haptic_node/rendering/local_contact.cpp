#include "haptic_node/rendering/local_contact.hpp"

#include <algorithm>
#include <cmath>

#include "rtbus/clock.hpp"
#include "rtbus/eigen.hpp"

namespace haptic {
namespace {

using Eigen::Vector3d;

/// A loop that comes late integrates the time that has passed, up to this many periods.
constexpr double kLongestStep = 20.0;

using rtbus::array_of;

}  // namespace

RenderOutput LocalContact::render(const RenderInput& input) noexcept {
  const Vector3d tip_W = mapping_.position_to_world(input.position_m);
  RenderOutput out;
  out.proxy_position_m = input.position_m;
  step_s_ = 0.0;
  if (!input.proxy.valid) placed_ = false;
  if (!placed_) {
    world_.reset(tip_W);
    sample_ns_ = input.sample_time_ns;
    placed_ = input.proxy.valid;
    return out;
  }
  if (input.contacts != nullptr) world_.take(*input.contacts, input.sample_time_ns);

  const double elapsed_s =
      input.sample_time_ns > sample_ns_ ? rtbus::seconds_between(sample_ns_, input.sample_time_ns) : input.dt_s;
  sample_ns_ = input.sample_time_ns;
  step_s_ = std::clamp(elapsed_s, 0.5 * input.dt_s, kLongestStep * input.dt_s);
  const double to_world = mapping_.config().gain_to_world();
  world_.advance({tip_W, mapping_.velocity_to_world(input.velocity_m_s), stiffness_n_per_m_ * to_world,
                  damping_n_s_per_m_ * to_world},
                 input.sample_time_ns, step_s_);
  if (!world_.position_m().allFinite()) {  // an answer that made no sense
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

LocalContact::Given& LocalContact::row_of(std::uint32_t body) noexcept {
  auto* oldest = &given_.front();
  for (Given& row : given_) {
    if (row.generation != 0 && row.body == body) return row;
    if (row.generation == 0 ? oldest->generation != 0 : oldest->generation != 0 && row.last_tick < oldest->last_tick)
      oldest = &row;
  }
  *oldest = Given{};
  oldest->body = body;
  oldest->generation = ++generations_;
  return *oldest;
}

void LocalContact::felt(const Vector3d& force_n) noexcept {
  ++ticks_;
  if (step_s_ <= 0.0) return;
  const auto pushes = world_.pushes();
  if (pushes.empty() && last_row_ < given_.size() && !force_n.isZero(0.0)) {
    // What the ladder still gives away when the contact is over comes from who was touched last.
    const Vector3d impulse = -mapping_.force_to_world(force_n) * step_s_;
    given_[last_row_].impulse_n_s += impulse;
    given_[last_row_].angular_n_m_s += last_arm_m_.cross(impulse);
  }
  double sum = 0.0;
  for (const auto& push : pushes) sum += push.impulse_n_s.norm();
  // What the ladder has taken from the force, or added to it, the bodies share as they shared the force.
  const Vector3d rest = -mapping_.force_to_world(force_n) * step_s_ + world_.impulse_n_s();
  for (std::size_t i = 0; i < pushes.size(); ++i) {
    const auto& push = pushes[i];
    const double share =
        sum > 0.0 ? push.impulse_n_s.norm() / sum : 1.0 / static_cast<double>(pushes.size());  // touched without force
    const Vector3d impulse = push.impulse_n_s + rest * share;
    world_.felt(i, impulse);
    Given& row = row_of(push.body);
    row.last_tick = ticks_;
    row.impulse_n_s += impulse;
    row.angular_n_m_s += push.from_centre_m.cross(impulse);
    last_row_ = static_cast<std::size_t>(&row - given_.data());
    last_arm_m_ = push.from_centre_m;
  }
  for (Given& row : given_) row.travel_n_s2 += step_s_ * row.impulse_n_s;
}

void LocalContact::tell(rtbus::DeviceState& out) const noexcept {
  for (std::size_t i = 0; i < given_.size(); ++i) {
    out.hand_impulse_body[i] = given_[i].body;
    out.hand_impulse_generation[i] = given_[i].generation;
    out.hand_impulse_n_s[i] = array_of(given_[i].impulse_n_s);
    out.hand_angular_impulse_n_m_s[i] = array_of(given_[i].angular_n_m_s);
    out.hand_impulse_integral_n_s2[i] = array_of(given_[i].travel_n_s2);
  }
}

}  // namespace haptic
