#include "haptic_node/loop.hpp"

#include <algorithm>
#include <utility>

#include "haptic_node/rendering/registry.hpp"
#include "rtbus/clock.hpp"

namespace haptic {

namespace {

rtbus::Vec3 to_array(const Eigen::Vector3d& v) noexcept { return {v.x(), v.y(), v.z()}; }
Eigen::Vector3d to_vector(const rtbus::Vec3& v) noexcept { return {v[0], v[1], v[2]}; }
rtbus::Quat to_array(const Eigen::Quaterniond& q) noexcept { return {q.w(), q.x(), q.y(), q.z()}; }

bool pressed(std::uint32_t buttons, int button) noexcept { return button >= 0 && ((buttons >> button) & 1u) != 0; }

/// Below this, at the device, the proxy touches nothing.
constexpr double kNoTouch_n = 1e-3;

std::unique_ptr<Renderer> make_renderer(const HapticConfig& config, const Mapping& mapping) {
  const RendererContext context{config.stiffness_n_per_m, config.damping_n_s_per_m, mapping, config.shapes,
                                config.wire.paper,        config.proxy_mass_kg};
  return find_renderer(config.method)->make(context);
}

}  // namespace

Loop::Loop(const HapticConfig& config, drivers::Device& device, PhysicsLink& link, bool measure)
    : config_(config),
      device_(device),
      link_(link),
      measure_(measure),
      dt_s_(static_cast<double>(config.period_ns()) * 1e-9),
      // A pipe has a thread that reads the newest state at its own rate.
      packets_per_cycle_(config.wire.rate_hz && !config.wire.pipe ? *config.wire.rate_hz / config.rate_hz : 1.0),
      packet_phase_(1.0 - packets_per_cycle_),  // the first cycle sends
      // In 1 ms steps: two processes that follow each other get different ones. Fixed where runs must repeat.
      mapping_(config.mapping, measure ? static_cast<std::uint32_t>(rtbus::monotonic_ns() >> 20) : 1),
      renderer_(make_renderer(config, mapping_)),
      owns_proxy_(find_renderer(config.method)->needs_contacts),
      velocity_(config.velocity),
      safety_(config.safety),
      monitor_(config.link),
      force_timeout_ns_(static_cast<std::uint64_t>(device.info().force_timeout_s * 1e9)) {
  const RendererEntry& law = *find_renderer(config.method);
  if (law.server_force != ServerForce::kNone) {
    state_.hand_stiffness_n_per_m = config.stiffness_n_per_m;
    state_.hand_damping_n_s_per_m = config.damping_n_s_per_m;
    state_.prediction_periods = config.prediction_periods;
  }
  state_.wants = owns_proxy_ ? std::uint32_t{rtbus::kWantsContacts} | rtbus::kOwnsProxy : 0U;
}

void Loop::note(LoopEvent event) noexcept {
  if (event_count_ < kMaxEvents) events_[event_count_++] = event;
}

LoopEvent Loop::take_event() noexcept { return event_next_ < event_count_ ? events_[event_next_++] : LoopEvent::kNone; }

void Loop::take_news(std::uint64_t now_ns) noexcept {
  proxy_.fresh = false;
  if (!renderer_->needs_physics()) {
    link_alive_ = true;
    return;
  }
  if (link_.receive(beat_news_)) monitor_.heartbeat(beat_news_.value, beat_news_.stamp_ns);
  if (link_.receive(proxy_news_)) {
    monitor_.proxy(proxy_news_.stamp_ns);
    const rtbus::ProxyState& news = proxy_news_.value;
    // An answer to another mapping, to a sample from before forces were enabled (perhaps of a process before this one),
    // or to one that is yet to come, says nothing about the hand now. Neither does one that no world can mean.
    proxy_.valid = news.device_sequence != 0 && news.mapping_epoch == mapping_.epoch() &&
                   news.device_time_ns >= enabled_ns_ && news.device_time_ns <= now_ns &&
                   sane_position(mapping_.position_to_device(to_vector(news.position_m))) &&
                   sane_velocity(mapping_.velocity_to_device(to_vector(news.velocity_m_s))) &&
                   sane_force(mapping_.force_to_device(to_vector(news.hand_force_n))) &&
                   sane_force(mapping_.force_to_device(to_vector(news.coupling_force_n)));
    if (!proxy_.valid) proxy_step_ = 0;
    if (proxy_.valid) {
      proxy_.fresh = true;
      const Eigen::Vector3d way_m = mapping_.position_to_device(to_vector(news.position_m)) - proxy_.position_m;
      double work_j = -mapping_.force_to_device(to_vector(news.coupling_force_n)).dot(way_m);
      // Over a gap the force is that of the last step alone: what it says the world gave is not believed.
      const bool whole = news.step_index == proxy_step_ + 1;
      if (!whole) work_j = std::min(0.0, work_j);
      if (proxy_step_ == 0) work_j = begun_j_ = 0.0;
      // A proxy that began inside of something is pushed out of it, and nothing that moves has done that work: it is
      // believed as far as the device's continuous force.
      if (mapping_.force_to_device(to_vector(news.contact_force_n)).norm() <= kNoTouch_n) begun_j_ = -1.0;
      if (begun_j_ >= 0.0) {
        const double force_n = config_.safety.continuous_force_n;
        work_j = std::min(work_j, 0.5 * force_n * force_n / std::max(config_.stiffness_n_per_m, 1.0) - begun_j_);
        begun_j_ += std::max(0.0, work_j);
      }
      proxy_.work_j = work_j;
      proxy_step_ = news.step_index;
      proxy_.sequence = proxy_news_.sequence;
      proxy_.device_time_ns = news.device_time_ns;
      proxy_.arrived_ns = now_ns;
      proxy_.period_s = news.step_s;
      proxy_.position_m = mapping_.position_to_device(to_vector(news.position_m));
      proxy_.velocity_m_s = mapping_.velocity_to_device(to_vector(news.velocity_m_s));
      proxy_.server_force_n = mapping_.force_to_device(to_vector(news.hand_force_n));
    }
  }
  const bool was_alive = link_alive_;
  link_alive_ = monitor_.update(now_ns);
  if (link_alive_ && !was_alive) {
    // The first answer after a loss is one to a sample from before it.
    begin_anew_ = monitor_.losses() > 0;
    note(LoopEvent::kLinkAlive);
  } else if (!link_alive_ && was_alive) {
    note(LoopEvent::kLinkLost);
  }
}

bool Loop::contacts_are_new(std::uint64_t now_ns) noexcept {
  if (!owns_proxy_ || !link_.receive(contact_news_)) return false;
  // As with the proxy: void when it answers something else than the hand since forces were enabled.
  const rtbus::ProxyContacts& news = contact_news_.value;
  return news.device_sequence != 0 && news.mapping_epoch == mapping_.epoch() && news.device_time_ns >= enabled_ns_ &&
         news.device_time_ns <= now_ns;
}

void Loop::follow_clutch(const Eigen::Vector3d& position_m, std::uint32_t buttons) noexcept {
  const bool pressed_now = pressed(buttons, config_.clutch_button);
  if (pressed_now && !clutched_) {
    clutch_position_W_ = mapping_.position_to_world(position_m);
    note(LoopEvent::kClutched);
  } else if (!pressed_now && clutched_) {
    // The hand is somewhere else now; the tool has waited. Whatever spring was stretched in between is forgotten.
    mapping_.rebase(position_m, clutch_position_W_);
    proxy_.valid = false;
    proxy_step_ = 0;
    renderer_->reset();
    note(LoopEvent::kReleased);
  }
  clutched_ = pressed_now;
}

void Loop::describe_hand(const drivers::DeviceSample& sample, const Eigen::Vector3d& position_m,
                         bool enabled) noexcept {
  const Eigen::Quaterniond q_DT(sample.orientation_wxyz[0], sample.orientation_wxyz[1], sample.orientation_wxyz[2],
                                sample.orientation_wxyz[3]);
  state_.position_m = sample.position_m;
  state_.velocity_m_s = to_array(velocity_.velocity_m_s());
  state_.orientation_wxyz = sample.orientation_wxyz;
  state_.target_position_m = to_array(clutched_ ? clutch_position_W_ : mapping_.position_to_world(position_m));
  state_.target_velocity_m_s =
      clutched_ ? rtbus::Vec3{} : to_array(mapping_.velocity_to_world(velocity_.velocity_m_s()));
  state_.target_orientation_wxyz = to_array(mapping_.orientation_to_world(q_DT));
  state_.position_scale = mapping_.config().position_scale;
  state_.force_scale = mapping_.config().force_scale;
  state_.sample_time_ns = sample.time_ns;
  state_.buttons = sample.buttons;
  state_.mapping_epoch = mapping_.epoch();
  state_.enabled = enabled ? 1 : 0;
}

bool Loop::read_device(std::uint64_t now_ns) noexcept {
  // The device keeps its own last sample: a stale one is repeated. A device that is lost, that says something which is
  // not a number, or that did not take the last force, gets none.
  const drivers::IoStatus io = device_.read(now_ns, sample_);
  const bool answers = io == drivers::IoStatus::kOk || io == drivers::IoStatus::kStale;
  const bool ok = answers && !write_failed_ && sane_position(to_vector(sample_.position_m));
  if (device_ok_ && !ok) note(LoopEvent::kDeviceLost);
  if (ok && !device_ok_) {
    if (device_seen_) note(LoopEvent::kDeviceBack);
    velocity_.reset();  // it may be anywhere by now: no difference across the gap
  }
  device_seen_ = device_seen_ || ok;
  device_ok_ = ok;
  return ok;
}

void Loop::enable_edge(bool enabled, std::uint64_t sample_ns) noexcept {
  // Each time forces are enabled everything begins at zero stored energy: physics puts its proxy onto the hand when it
  // sees the new epoch, the law forgets its history, and the gate waits for the first answer to a sample from now on.
  if (enabled && !enabled_) {
    mapping_.renew();
    enabled_ns_ = sample_ns;
    proxy_.valid = false;
    proxy_step_ = 0;
    renderer_->reset();
  }
  enabled_ = enabled;
}

void Loop::cycle(std::uint64_t deadline_ns, std::uint64_t now_ns) noexcept {
  event_count_ = event_next_ = 0;
  const std::uint64_t began_ns = measure_ ? rtbus::monotonic_ns() : now_ns;

  // 1. Where is the hand?
  const bool device_ok = read_device(now_ns);
  const std::uint64_t read_ns = measure_ ? rtbus::monotonic_ns() : now_ns;
  // A device that paces: due when it measured; one that is silent has nothing to be late for.
  const std::uint64_t due_ns = deadline_ns != 0 ? deadline_ns : device_ok ? sample_.time_ns : now_ns;
  const Eigen::Vector3d position_m = to_vector(sample_.position_m);
  if (device_ok) {
    velocity_.update(position_m, sample_.time_ns);
    follow_clutch(position_m, sample_.buttons);
  }

  // 2. Does the user want force, and what does physics say?
  const bool enabled =
      device_ok && !clutched_ && (config_.enable_button < 0 || pressed(sample_.buttons, config_.enable_button));
  // A loop that was held up for longer than the device holds a force begins anew, and so does one whose physics came
  // back.
  const bool held_up = last_cycle_ns_ != 0 && now_ns - last_cycle_ns_ > force_timeout_ns_;
  if (held_up || std::exchange(begin_anew_, false)) enabled_ = false;
  last_cycle_ns_ = now_ns;
  enable_edge(enabled, sample_.time_ns);
  take_news(now_ns);

  // 3. The force law, then the ladder, then the device.
  RenderInput input;
  input.now_ns = now_ns;
  input.sample_time_ns = sample_.time_ns;
  input.dt_s = dt_s_;
  input.position_m = position_m;
  input.velocity_m_s = velocity_.velocity_m_s();
  input.proxy = proxy_;
  if (contacts_are_new(now_ns)) input.contacts = &contact_news_.value;
  const RenderOutput rendered = renderer_->render(input);

  SafetyInput wish;
  wish.force_n = rendered.force_n;
  wish.position_m = position_m;
  wish.velocity_m_s = input.velocity_m_s;
  wish.world_work_j = rendered.world_work_j;
  if (config_.safety.passivity.books_world && proxy_.fresh) wish.world_work_j += proxy_.work_j;
  wish.dt_s = dt_s_;
  wish.now_ns = now_ns;
  wish.sample_time_ns = sample_.time_ns;
  wish.enabled = enabled;
  wish.link_alive = link_alive_ && (proxy_.valid || !renderer_->needs_physics());
  wish.device_ok = device_ok;
  const SafetyOutput safe = safety_.apply(wish);
  const bool overspeed = (safe.acted & kOverspeed) != 0;
  if (overspeed && !overspeed_) note(LoopEvent::kOverspeed);
  overspeed_ = overspeed;

  drivers::ForceCommand command;
  command.force_n = to_array(safe.force_n);
  const std::uint64_t computed_ns = measure_ ? rtbus::monotonic_ns() : now_ns;
  if (measure_ && computed_ns > now_ns + force_timeout_ns_) {
    // Held up between the sample and here: this force answers a hand that is no longer there.
    command.force_n = {};
    safety_.not_sent();
  }
  write_failed_ = device_.write(measure_ ? computed_ns : now_ns, command) != drivers::IoStatus::kOk;
  if (write_failed_) safety_.not_sent();
  const std::uint64_t written_ns = measure_ ? rtbus::monotonic_ns() : now_ns;

  // 4. Tell physics, and keep the books.
  describe_hand(sample_, position_m, enabled);
  if (owns_proxy_) {
    renderer_->felt(write_failed_ ? Eigen::Vector3d::Zero() : to_vector(command.force_n));
    renderer_->tell(state_);
    if (enabled) {
      state_.target_position_m = to_array(mapping_.position_to_world(rendered.proxy_position_m));
      state_.target_velocity_m_s = to_array(mapping_.velocity_to_world(rendered.proxy_velocity_m_s));
    }
  }
  if (packet_is_due()) link_.send(state_, now_ns);
  counters_.count(safe, safety_.passivity(), monitor_);

  const std::uint64_t proxy_age_ns = proxy_.valid ? now_ns - proxy_.device_time_ns : 0;  // never later than now
  if (proxy_.valid) counters_.proxy_age_ns.record(proxy_age_ns);
  telemetry_.tick = counters_.ticks.load(std::memory_order_relaxed);
  telemetry_.due_ns = due_ns;
  telemetry_.device_time_ns = sample_.time_ns;
  telemetry_.position_m = sample_.position_m;
  telemetry_.velocity_m_s = state_.velocity_m_s;
  telemetry_.proxy_position_m = to_array(rendered.proxy_position_m);
  telemetry_.proxy_velocity_m_s = to_array(rendered.proxy_velocity_m_s);
  telemetry_.rendered_force_n = to_array(rendered.force_n);
  telemetry_.force_n = command.force_n;
  telemetry_.energy_absorbed_j = safety_.passivity().absorbed_j();
  telemetry_.energy_ledger_j = safety_.passivity().ledger_j();
  telemetry_.gate = safe.gate;
  telemetry_.proxy_sequence = proxy_.valid ? proxy_.sequence : 0;
  telemetry_.proxy_age_ns = proxy_age_ns;
  telemetry_.safety = safe.acted;
  telemetry_.buttons = sample_.buttons;
  if (measure_) {
    const std::uint64_t wakeup_ns = began_ns > due_ns ? began_ns - due_ns : 0;
    const std::uint64_t device_ns = (read_ns - began_ns) + (written_ns - computed_ns);
    const std::uint64_t compute_ns = (rtbus::monotonic_ns() - began_ns) - device_ns;
    counters_.wakeup_ns.record(wakeup_ns);
    counters_.device_ns.record(device_ns);
    counters_.compute_ns.record(compute_ns);
    telemetry_.wakeup_us = static_cast<double>(wakeup_ns) * 1e-3;
    telemetry_.compute_us = static_cast<double>(compute_ns) * 1e-3;
    telemetry_.device_us = static_cast<double>(device_ns) * 1e-3;
  }
}

bool Loop::packet_is_due() noexcept {
  constexpr double kRounding = 1e-9;
  packet_phase_ += packets_per_cycle_;
  if (packet_phase_ < 1.0 - kRounding) return false;
  packet_phase_ -= 1.0;
  return true;
}

void Loop::release(std::uint64_t now_ns) noexcept {
  (void)device_.write(now_ns, drivers::ForceCommand{});
  state_.enabled = 0;
  state_.target_velocity_m_s = {};
  link_.send(state_, now_ns);
}

void Loop::count_schedule(std::uint64_t due, std::uint64_t overruns) noexcept {
  counters_.ticks_due.store(due, std::memory_order_relaxed);
  counters_.overruns.store(overruns, std::memory_order_relaxed);
}

rtbus::LoopStats Loop::stats() const {
  rtbus::LoopStats out = counters_.stats();
  out.rate_hz = config_.rate_hz;
  return out;
}

}  // namespace haptic
