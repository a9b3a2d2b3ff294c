#include "tools/cli/run/live_error.hpp"

#include <algorithm>
#include <cmath>

#include "haptic_node/safety.hpp"
#include "rtbus/clock.hpp"
#include "rtbus/eigen.hpp"

namespace tools {

namespace {

/// Ticks that may wait for their proxy: 6 s of the fastest loop. Physics that stays away longer has no answer to them.
constexpr std::size_t kMaxWaiting = 65536;

using rtbus::vector_of;

Eigen::Vector3d between(const rtbus::Vec3& a, const rtbus::Vec3& b, double share) {
  return (1.0 - share) * vector_of(a) + share * vector_of(b);
}

}  // namespace

double RmsPeak::rms() const noexcept { return count == 0 ? 0.0 : std::sqrt(square_sum / static_cast<double>(count)); }

LiveError::LiveError(const haptic::MappingConfig& mapping, const MakeMethod& make_method, double dt_s,
                     bool fixed_mapping)
    : mapping_(mapping), method_(make_method(mapping_)), dt_s_(dt_s), fixed_mapping_(fixed_mapping) {}

void LiveError::add_tick(const rtbus::Telemetry& tick) {
  // No method was followed in these cycles: nothing to compare.
  constexpr std::uint32_t kNoForce = haptic::kDisabled | haptic::kDeviceLost | haptic::kEstop;
  if (tick.proxy_sequence == 0 || (tick.safety & kNoForce) != 0) {
    ++dropped_;
    return;
  }
  if (ticks_.size() == kMaxWaiting) {
    ticks_.pop_front();
    ++dropped_;
  }
  ticks_.push_back(tick);
}

bool LiveError::neighbours(const rtbus::ProxyState& before, const rtbus::ProxyState& after) noexcept {
  // Across a gap in which the haptic loop itself would have given physics up, a straight line says nothing about where
  // the proxy was.
  const double gap_s = rtbus::seconds_between(before.device_time_ns, after.device_time_ns);
  return before.mapping_epoch == after.mapping_epoch &&
         gap_s <= std::max(0.1, 2.5 * after.step_s) + after.step_compute_s;
}

void LiveError::add_proxy(const rtbus::ProxyState& proxy) {
  if (proxy.device_sequence == 0) return;
  // The mapping of the file holds for the first epoch; a clutch shifts it by what only the haptic node knows.
  if (!first_epoch_) first_epoch_ = proxy.mapping_epoch;
  if (!fixed_mapping_ && proxy.mapping_epoch != *first_epoch_) return;
  if (before_ && proxy.device_time_ns < before_->device_time_ns) before_.reset();  // physics began anew
  // A tick is settled by the first proxy that is strictly later: of two answers to one sample the newer counts.
  while (!ticks_.empty() && ticks_.front().device_time_ns < proxy.device_time_ns) {
    const rtbus::Telemetry& tick = ticks_.front();
    if (before_ && before_->device_time_ns <= tick.device_time_ns && neighbours(*before_, proxy)) {
      compare(tick, *before_, proxy);
    } else {
      ++dropped_;
    }
    ticks_.pop_front();
  }
  before_ = proxy;
}

void LiveError::compare(const rtbus::Telemetry& tick, const rtbus::ProxyState& before, const rtbus::ProxyState& after) {
  const double share = rtbus::seconds_between(before.device_time_ns, tick.device_time_ns) /
                       rtbus::seconds_between(before.device_time_ns, after.device_time_ns);
  haptic::RenderInput input;
  input.now_ns = tick.device_time_ns;
  input.dt_s = dt_s_;
  input.position_m = vector_of(tick.position_m);
  input.velocity_m_s = vector_of(tick.velocity_m_s);
  input.proxy.valid = true;
  input.proxy.fresh = true;
  input.proxy.sequence = tick.tick;
  input.proxy.device_time_ns = tick.device_time_ns;
  input.proxy.arrived_ns = tick.device_time_ns;
  input.proxy.period_s = dt_s_;
  input.proxy.position_m = mapping_.position_to_device(between(before.position_m, after.position_m, share));
  input.proxy.velocity_m_s = mapping_.velocity_to_device(between(before.velocity_m_s, after.velocity_m_s, share));
  input.proxy.server_force_n = mapping_.force_to_device(between(before.hand_force_n, after.hand_force_n, share));
  const haptic::RenderOutput reference = method_->render(input);
  force_n_.add((vector_of(tick.rendered_force_n) - reference.force_n).norm());
  position_m_.add((vector_of(tick.proxy_position_m) - reference.proxy_position_m).norm());
}

}  // namespace tools
