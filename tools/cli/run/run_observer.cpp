#include "tools/cli/run/run_observer.hpp"

#include <algorithm>
#include <cmath>
#include <string_view>

#include "haptic_node/rendering/registry.hpp"
#include "haptic_node/safety.hpp"
#include "rtbus/clock.hpp"
#include "rtbus/eigen.hpp"

namespace tools {

namespace {

// Not std::hypot of three: libstdc++'s gives 0 for (0, NaN, 0).
double norm(const rtbus::Vec3& v) { return std::sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]); }

using rtbus::vector_of;

/// True when the topic has been found.
template <rtbus::Sample T>
bool attach_to(rtbus::Subscription<T>& subscription) {
  subscription.maintain();
  return subscription.attachments() > 0;
}

}  // namespace

HapticObserver::HapticObserver(const rtbus::Session& session, const haptic::HapticConfig& config, bool figures)
    : config_(config),
      ticks_(session, config.name + ".telemetry", {.presence = true}),
      stats_reader_(session, config.name + ".loop_stats"),
      info_reader_(session, config.name + ".node_info"),
      proxies_(session, "physics.proxy_state." + config.name),
      mapping_(config.mapping),
      keeps_figures_(figures) {
  if (config.device && config.device->has_link()) link_reader_.emplace(session, config.name + ".link_stats");
  const haptic::MethodEntry* const method = haptic::find_method(config.method);
  // A method that integrates the proxy itself is not one of the newest proxy: it has no staleness of this kind.
  needs_physics_ = method != nullptr && method->needs_physics;
  if (!needs_physics_ || method->needs_contacts) return;
  // A reference is the method without delay: of interpolation the force itself, without ramp (one cycle in improved
  // form).
  const auto make_method = [&](const haptic::Mapping& mapping) {
    return method->make({config.stiffness_n_per_m, config.damping_n_s_per_m, mapping, config.shapes,
                         config.wire.paper && method->server_force == haptic::ServerForce::kNone,
                         config.proxy.mass_kg});
  };
  error_.emplace(config.mapping, make_method, static_cast<double>(config.period_ns()) * 1e-9, config.clutch_button < 0);
}

bool HapticObserver::attach() {
  bool all = attach_to(ticks_);
  all = attach_to(stats_reader_) && all;
  all = attach_to(info_reader_) && all;
  if (needs_physics()) all = attach_to(proxies_) && all;
  if (link_reader_) all = attach_to(*link_reader_) && all;
  return all;
}

void HapticObserver::take(const rtbus::Telemetry& tick) {
  if (observed_ticks_++ == 0) first_due_ns_ = tick.due_ns;
  wakeup_ns_->record(static_cast<std::uint64_t>(std::max(0.0, tick.wakeup_us) * 1e3));
  generated_peak_j_ = std::max(generated_peak_j_, -tick.energy_absorbed_j);
  observed_min_j_ = observed_ticks_ == 1 ? tick.energy_observed_j : std::min(observed_min_j_, tick.energy_observed_j);
  if (error_) error_->add_tick(tick);
  impulse_.add_hand_force(tick.due_ns, vector_of(tick.force_n));
  if (!keeps_figures_) return;
  motion_.add({rtbus::seconds_between(first_due_ns_, tick.due_ns), tick.position_m, tick.proxy_position_m, tick.force_n,
               tick.rendered_force_n, static_cast<double>(tick.proxy_age_ns) * 1e-6});
}

void HapticObserver::watch_estop(const rtbus::Telemetry& tick, std::uint64_t stamp_ns) {
  // Of a device that is lost the loop repeats the last sample: no press.
  const bool pressed = config_.estop_button >= 0 && ((tick.buttons >> config_.estop_button) & 1u) != 0 &&
                       (tick.safety & haptic::kDeviceLost) == 0;
  pressed_ticks_ = pressed ? pressed_ticks_ + 1 : 0;
  acted_ticks_ = (tick.safety & haptic::kEstop) != 0 ? acted_ticks_ + 1 : 0;
  if (pressed_ticks_ >= kSureTicks) estop_pressed_ns_ = stamp_ns;
  if (acted_ticks_ >= kSureTicks) estop_acted_ns_ = stamp_ns;
}

void HapticObserver::take(const rtbus::ProxyState& proxy) {
  if (proxy.contacts > 0) ++contact_steps_;
  coupling_n_.add(norm(proxy.coupling_force_n));
  contact_n_.add(norm(proxy.contact_force_n));
  if (error_) error_->add_proxy(proxy);
  // A step gives what happened from the sample that the step before it answered to its own.
  if (answered_ns_ != 0) {
    impulse_.add_world_impulse(answered_ns_, proxy.device_time_ns,
                               proxy.step_s * mapping_.force_to_device(vector_of(proxy.contact_force_n)));
  }
  answered_ns_ = proxy.device_time_ns;
}

void HapticObserver::drain() {
  // Proxies after ticks: each tick waits for the proxy that follows it, so less waits at a time.
  while (ticks_.read_next(tick_) == rtbus::ReadStatus::kFresh) {
    take(tick_.value);
    watch_estop(tick_.value, tick_.stamp_ns);
  }
  while (proxies_.read_next(proxy_) == rtbus::ReadStatus::kFresh) {
    take(proxy_.value);
    if (keeps_figures_ && first_due_ns_ != 0) {
      steps_.add({rtbus::seconds_between(first_due_ns_, proxy_.stamp_ns), proxy_.value.step_compute_s * 1e3});
    }
  }
  (void)stats_reader_.read_latest(stats_);
  (void)info_reader_.read_latest(info_);
  if (link_reader_) (void)link_reader_->read_latest(link_);
  (void)attach();
}

HapticFigures HapticObserver::figures() const {
  HapticFigures out;
  out.name = config_.name;
  out.info = info_.value;
  out.stats = stats_.value;
  if (link_.sequence != 0) out.link = link_.value;
  out.observed_ticks = observed_ticks_;
  out.missed_by_observer = ticks_.missed();
  out.generated_peak_j = generated_peak_j_;
  out.observed_min_j = observed_min_j_;
  out.needs_physics = needs_physics();
  out.finds_proxy = !error_.has_value();
  if (error_ && error_->compared() > 0) {
    out.error = StalenessFigures{error_->force_n(), error_->position_m(), error_->dropped()};
  }
  return out;
}

ProxyFigures HapticObserver::proxy_figures() const {
  return {config_.name, coupling_n_.count, contact_steps_, coupling_n_, contact_n_, impulse_.figures()};
}

bool PhysicsObserver::attach() {
  const bool stats = attach_to(stats_reader_);
  return attach_to(info_reader_) && stats;
}

void PhysicsObserver::drain() {
  (void)stats_reader_.read_latest(stats_);
  (void)info_reader_.read_latest(info_);
  (void)attach();
}

PhysicsFigures PhysicsObserver::figures() const {
  PhysicsFigures out;
  out.info = info_.value;
  out.stats = stats_.value;
  return out;
}

}  // namespace tools
