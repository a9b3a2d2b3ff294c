#include "haptic_node/loop.hpp"

#include <algorithm>
#include <utility>

#include "haptic_node/rendering/registry.hpp"
#include "rtbus/clock.hpp"
#include "rtbus/eigen.hpp"

namespace haptic {

namespace {

using rtbus::array_of;
using rtbus::vector_of;

bool pressed(std::uint32_t buttons, int button) noexcept { return button >= 0 && ((buttons >> button) & 1u) != 0; }

std::unique_ptr<Method> make_method(const HapticConfig& config, const Mapping& mapping) {
  const Echo echo{config.set_point_delay_s, config.gain_limits.tip_mass_kg,
                  config.proxy.mass_kg / config.mapping.gain_to_world()};
  const MethodContext context{config.stiffness_n_per_m,
                              config.damping_n_s_per_m,
                              mapping,
                              config.shapes,
                              config.wire.paper,
                              config.proxy.mass_kg,
                              config.known,
                              config.other_hands.size(),
                              echo};
  return find_method(config.method)->make(context);
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
      method_(make_method(config, mapping_)),
      owns_proxy_(find_method(config.method)->needs_contacts),
      velocity_(config.velocity),
      safety_(config.safety),
      monitor_(config.link),
      orders_(config.gains(), config.extra_force_max_n),
      gains_(config.gains(), config.gain_limits),
      world_work_(config.safety.continuous_force_n, config.stiffness_n_per_m),
      force_timeout_ns_(static_cast<std::uint64_t>(device.info().force_timeout_s * 1e9)) {
  for (const OtherHandConfig& other : config.other_hands) other_hands_.push_back({other.number, false, {}});
  const MethodEntry& method = *find_method(config.method);
  if (method.server_force != ServerForce::kNone) {
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

void Loop::take_proxy(std::uint64_t now_ns) noexcept {
  const rtbus::ProxyState& answer = proxy_answer_.value;
  const Eigen::Vector3d position_m = mapping_.position_to_device(vector_of(answer.position_m));
  const Eigen::Vector3d velocity_m_s = mapping_.velocity_to_device(vector_of(answer.velocity_m_s));
  const Eigen::Vector3d server_force_n = mapping_.force_to_device(vector_of(answer.hand_force_n));
  // An answer to another mapping, to a sample from before forces were enabled (perhaps of a process before this one),
  // or to one that is yet to come, says nothing about the hand now. Neither does one that no world can mean.
  const bool valid = answer.device_sequence != 0 && answer.mapping_epoch == mapping_.epoch() &&
                     answer.device_time_ns >= enabled_ns_ && answer.device_time_ns <= now_ns &&
                     sane_position(position_m) && sane_velocity(velocity_m_s) && sane_force(server_force_n);
  // Between good ones it is a wrong sample, and fades the force as such. A hole of one cycle would be a click.
  if (!valid && proxy_.valid) monitor_.refused(now_ns);
  if (!valid) return;
  proxy_.valid = true;
  const Eigen::Vector3d contact_n = mapping_.force_to_device(vector_of(answer.contact_force_n));
  const MappingConfig& mapping = mapping_.config();
  proxy_.work_j =
      world_work_.since_last(answer.coupling_work_j / (mapping.force_scale * mapping.position_scale), contact_n);
  proxy_.fresh = true;
  proxy_.sequence = proxy_answer_.sequence;
  proxy_.device_time_ns = answer.device_time_ns;
  proxy_.arrived_ns = now_ns;
  proxy_.period_s = answer.step_s;
  proxy_.position_m = position_m;
  proxy_.velocity_m_s = velocity_m_s;
  proxy_.server_force_n = server_force_n;
}

void Loop::take_orders() noexcept {
  const bool estop = orders_.estopped(device_ok_ && pressed(sample_.buttons, config_.estop_button));
  if (estop != estop_) note(estop ? LoopEvent::kEstopped : LoopEvent::kRearmed);
  estop_ = estop;
  if (!gains_.follow(orders_.wanted(), dt_s_)) return;
  const Gains& now = gains_.now();
  method_->set_gains(now.stiffness_n_per_m, now.damping_n_s_per_m);
  safety_.set_gains(now.stiffness_n_per_m, now.damping_n_s_per_m);
  if (state_.hand_stiffness_n_per_m > 0.0) {  // physics computes the force
    state_.hand_stiffness_n_per_m = now.stiffness_n_per_m;
    state_.hand_damping_n_s_per_m = now.damping_n_s_per_m;
  }
}

void Loop::take_answers(std::uint64_t now_ns) noexcept {
  proxy_.fresh = false;
  if (!method_->needs_physics()) {
    link_alive_ = true;
    return;
  }
  if (link_.receive(heartbeat_sample_)) monitor_.heartbeat(heartbeat_sample_.value, heartbeat_sample_.stamp_ns);
  if (link_.receive(proxy_answer_)) {
    monitor_.proxy(proxy_answer_.stamp_ns);
    take_proxy(now_ns);
  }
  if (const std::uint64_t refused = link_.refused(); refused != refused_) {
    refused_ = refused;
    monitor_.refused(now_ns);
  }
  monitor_.behind(proxy_.valid ? behind_hand(proxy_.device_time_ns) : 0);
  const bool was_alive = link_alive_;
  link_alive_ = monitor_.update(now_ns);
  if (link_alive_ && !was_alive) {
    // The first answer after a loss is one to a sample from before it.
    begin_anew_ = monitor_.losses() > 0;
    if (begin_anew_) proxy_.valid = proxy_.fresh = false;  // not in this cycle either
    note(LoopEvent::kLinkAlive);
  } else if (!link_alive_ && was_alive) {
    note(monitor_.lags() ? LoopEvent::kLinkLags : LoopEvent::kLinkLost);
  }
}

/// The method knows the shapes of its own scene file. Where physics has others, no force is right.
bool Loop::same_scene(const rtbus::ProxyContacts& answer) noexcept {
  const bool other = config_.shape_hash != 0 && answer.shape_hash != config_.shape_hash;
  if (other != other_scene_) note(other ? LoopEvent::kOtherScene : LoopEvent::kLinkAlive);
  if (other_scene_ && !other) begin_anew_ = true;
  other_scene_ = other;
  return !other;
}

bool Loop::contacts_are_new(std::uint64_t now_ns) noexcept {
  if (!owns_proxy_ || !link_.receive(contacts_answer_)) return false;
  const rtbus::ProxyContacts& answer = contacts_answer_.value;
  if (!same_scene(answer)) return false;
  // As with the proxy: void when it answers something else than the hand since forces were enabled.
  if (answer.device_sequence == 0 || answer.mapping_epoch != mapping_.epoch() || answer.device_time_ns < enabled_ns_ ||
      answer.device_time_ns > now_ns) {
    return false;
  }
  if (!monitor_.too_far_behind(behind_hand(answer.device_time_ns))) return true;
  if (!monitor_.lags()) monitor_.refused(now_ns);  // the proxy's answers are to the hand of now, these are not
  return false;
}

std::uint64_t Loop::behind_hand(std::uint64_t answered_ns) const noexcept {
  return sample_.time_ns > answered_ns ? sample_.time_ns - answered_ns : 0;
}

void Loop::forget_proxy() noexcept {
  proxy_.valid = false;
  world_work_.begin_anew();
  safety_.world_begins_anew();
  method_->reset();
}

void Loop::follow_clutch(const Eigen::Vector3d& position_m, std::uint32_t buttons, std::uint64_t now_ns) noexcept {
  const bool pressed_now = pressed(buttons, config_.clutch_button) || orders_.clutched(now_ns);
  if (pressed_now && !clutched_) {
    clutch_position_W_ = mapping_.position_to_world(position_m);
    note(LoopEvent::kClutched);
  } else if (!pressed_now && clutched_) {
    // The hand is somewhere else now; the tool has waited. Whatever spring was stretched in between is forgotten.
    mapping_.rebase(position_m, clutch_position_W_);
    forget_proxy();
    note(LoopEvent::kReleased);
  }
  clutched_ = pressed_now;
}

void Loop::describe_hand(const drivers::DeviceSample& sample, const Eigen::Vector3d& position_m,
                         bool enabled) noexcept {
  const Eigen::Quaterniond q_DT(sample.orientation_wxyz[0], sample.orientation_wxyz[1], sample.orientation_wxyz[2],
                                sample.orientation_wxyz[3]);
  state_.position_m = sample.position_m;
  state_.velocity_m_s = array_of(velocity_.velocity_m_s());
  state_.orientation_wxyz = sample.orientation_wxyz;
  state_.target_position_m = array_of(clutched_ ? clutch_position_W_ : mapping_.position_to_world(position_m));
  state_.target_velocity_m_s =
      clutched_ ? rtbus::Vec3{} : array_of(mapping_.velocity_to_world(velocity_.velocity_m_s()));
  state_.target_orientation_wxyz = array_of(mapping_.orientation_to_world(q_DT));
  state_.position_scale = mapping_.config().position_scale;
  state_.force_scale = mapping_.config().force_scale;
  state_.sample_time_ns = sample.time_ns;
  state_.buttons = sample.buttons;
  state_.gripper_m = sample.gripper_m;
  state_.answer_age_s = proxy_.valid ? 1e-9 * static_cast<double>(behind_hand(proxy_.device_time_ns)) : 0.0;
  state_.mapping_epoch = mapping_.epoch();
  state_.enabled = enabled ? 1 : 0;
}

bool Loop::read_device(std::uint64_t now_ns) noexcept {
  // The device keeps its own last sample: a stale one is repeated. A device that is lost, that says something which is
  // not a number, or that did not take the last force, gets none.
  const drivers::IoStatus io = device_.read(now_ns, sample_);
  const bool answers = io == drivers::IoStatus::kOk || io == drivers::IoStatus::kStale;
  const bool ok = answers && !write_failed_ && sane_position(vector_of(sample_.position_m)) &&
                  (!config_.velocity.of_device || sane_velocity(vector_of(sample_.velocity_m_s)));
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
  // sees the new epoch, the method forgets its history, and the gate waits for the first answer to a sample from now
  // on.
  if (enabled && !enabled_) {
    mapping_.renew();
    enabled_ns_ = sample_ns;
    forget_proxy();
  }
  enabled_ = enabled;
}

bool Loop::forces_enabled(bool device_ok, std::uint64_t now_ns) noexcept {
  const bool enabled = device_ok && !estop_ && !clutched_ &&
                       (config_.enable_button < 0 || pressed(sample_.buttons, config_.enable_button));
  // A loop that was held up for longer than the device holds a force begins anew, and so does one whose physics came
  // back.
  const bool held_up = last_cycle_ns_ != 0 && now_ns - last_cycle_ns_ > force_timeout_ns_;
  if (held_up && enabled_) {  // else there was no force to begin anew
    last_pause_ns_ = now_ns - last_cycle_ns_;
    counters_.count_pause();
    note(LoopEvent::kPaused);
  }
  if (held_up || std::exchange(begin_anew_, false)) enabled_ = false;
  last_cycle_ns_ = now_ns;
  enable_edge(enabled, sample_.time_ns);
  return enabled;
}

void Loop::hear_other_hands() noexcept {
  for (std::size_t i = 0; i < other_hands_.size(); ++i) {
    OtherHand& other = other_hands_[i];
    other.fresh = link_.receive(i, other.state);
  }
}

RenderOutput Loop::render(std::uint64_t now_ns) noexcept {
  hear_other_hands();
  RenderInput input;
  input.now_ns = now_ns;
  input.sample_time_ns = sample_.time_ns;
  input.dt_s = dt_s_;
  input.position_m = vector_of(sample_.position_m);
  input.velocity_m_s = velocity_.velocity_m_s();
  input.proxy = proxy_;
  if (contacts_are_new(now_ns)) input.contacts = &contacts_answer_.value;
  input.other_hands = other_hands_;
  return method_->render(input);
}

SafetyOutput Loop::make_safe(const RenderOutput& rendered, bool device_ok, bool enabled,
                             std::uint64_t now_ns) noexcept {
  SafetyInput wish;
  wish.force_n = rendered.force_n;
  wish.extra_force_n = orders_.extra_force_n(now_ns);
  wish.position_m = vector_of(sample_.position_m);
  wish.velocity_m_s = velocity_.velocity_m_s();
  wish.world_work_j = rendered.world_work_j;
  if (config_.safety.passivity.counts_world_work && proxy_.fresh) wish.world_work_j += proxy_.work_j;
  wish.dt_s = dt_s_;
  wish.now_ns = now_ns;
  wish.sample_time_ns = sample_.time_ns;
  wish.enabled = enabled;
  wish.estop = estop_;
  wish.clutched = clutched_;
  wish.link_alive = link_alive_ && !other_scene_ && (proxy_.valid || !method_->needs_physics());
  wish.device_ok = device_ok;
  SafetyOutput safe = safety_.apply(wish);
  const bool overspeed = (safe.acted & kOverspeed) != 0;
  if (overspeed && !overspeed_) note(LoopEvent::kOverspeed);
  overspeed_ = overspeed;
  return safe;
}

rtbus::Vec3 Loop::write_force(const Eigen::Vector3d& force_n, std::uint64_t computed_ns,
                              std::uint64_t now_ns) noexcept {
  drivers::ForceCommand command;
  command.force_n = array_of(force_n);
  if (measure_ && computed_ns > now_ns + force_timeout_ns_) {
    // Held up between the sample and here: this force answers a hand that is no longer there.
    command.force_n = {};
    safety_.not_sent();
  }
  write_failed_ = device_.write(measure_ ? computed_ns : now_ns, command) != drivers::IoStatus::kOk;
  if (write_failed_) safety_.not_sent();
  return command.force_n;
}

void Loop::tell_physics(const RenderOutput& rendered, const Eigen::Vector3d& walls_n, const Eigen::Vector3d& extra_n,
                        const rtbus::Vec3& written_n, bool enabled, std::uint64_t now_ns) noexcept {
  describe_hand(sample_, vector_of(sample_.position_m), enabled);
  if (owns_proxy_) {
    // Neither the force of an order nor the walls of the device are the world's: no body gets them. Of a force that the
    // ladder lowered, the walls have their share.
    const bool sent = !write_failed_ && written_n != rtbus::Vec3{};
    Eigen::Vector3d felt_n = sent ? Eigen::Vector3d(vector_of(written_n) - extra_n) : Eigen::Vector3d::Zero();
    if (const double wished_n = rendered.force_n.norm(); walls_n != Eigen::Vector3d::Zero() && wished_n > 0.0) {
      felt_n -= std::min(1.0, felt_n.norm() / wished_n) * walls_n;
    }
    method_->felt(felt_n);
    method_->tell(state_);
    if (enabled) {
      state_.target_position_m = array_of(mapping_.position_to_world(rendered.proxy_position_m));
      state_.target_velocity_m_s = array_of(mapping_.velocity_to_world(rendered.proxy_velocity_m_s));
    }
  }
  if (packet_is_due()) link_.send(state_, now_ns);
}

void Loop::record_cycle(const RenderOutput& rendered, const SafetyOutput& safe, const rtbus::Vec3& written_n,
                        std::uint64_t due_ns, std::uint64_t now_ns) noexcept {
  counters_.count(safe, safety_.passivity(), monitor_);
  if (rendered.correction_m) counters_.count_correction(*rendered.correction_m);
  const std::uint64_t proxy_age_ns = proxy_.valid ? now_ns - proxy_.device_time_ns : 0;  // never later than now
  if (proxy_.valid) counters_.proxy_age_ns.record(proxy_age_ns);
  telemetry_.tick = counters_.ticks.load(std::memory_order_relaxed);
  telemetry_.due_ns = due_ns;
  telemetry_.device_time_ns = sample_.time_ns;
  telemetry_.position_m = sample_.position_m;
  telemetry_.velocity_m_s = state_.velocity_m_s;
  telemetry_.proxy_position_m = array_of(rendered.proxy_position_m);
  telemetry_.proxy_velocity_m_s = array_of(rendered.proxy_velocity_m_s);
  telemetry_.rendered_force_n = array_of(rendered.force_n);
  telemetry_.force_n = written_n;
  telemetry_.energy_absorbed_j = safety_.passivity().absorbed_j();
  telemetry_.energy_observed_j = safety_.passivity().observed_j();
  telemetry_.gate = safe.gate;
  telemetry_.proxy_sequence = proxy_.valid ? proxy_.sequence : 0;
  telemetry_.proxy_age_ns = proxy_age_ns;
  telemetry_.safety = safe.acted;
  telemetry_.buttons = sample_.buttons;
}

void Loop::record_times(const CycleTimes& at) noexcept {
  const std::uint64_t wakeup_ns = at.began_ns > at.due_ns ? at.began_ns - at.due_ns : 0;
  const std::uint64_t device_ns = (at.read_ns - at.began_ns) + (at.written_ns - at.computed_ns);
  const std::uint64_t compute_ns = (rtbus::monotonic_ns() - at.began_ns) - device_ns;
  counters_.wakeup_ns.record(wakeup_ns);
  counters_.device_ns.record(device_ns);
  counters_.compute_ns.record(compute_ns);
  telemetry_.wakeup_us = static_cast<double>(wakeup_ns) * 1e-3;
  telemetry_.compute_us = static_cast<double>(compute_ns) * 1e-3;
  telemetry_.device_us = static_cast<double>(device_ns) * 1e-3;
}

void Loop::cycle(std::uint64_t deadline_ns, std::uint64_t now_ns) noexcept {
  const auto clock_ns = [&]() noexcept { return measure_ ? rtbus::monotonic_ns() : now_ns; };
  CycleTimes at;
  event_count_ = event_next_ = 0;
  at.began_ns = clock_ns();

  // 1. Where is the hand?
  const bool device_ok = read_device(now_ns);
  at.read_ns = clock_ns();
  // A device that paces: due when it measured; one that is silent has nothing to be late for.
  at.due_ns = deadline_ns != 0 ? deadline_ns : device_ok ? sample_.time_ns : now_ns;
  if (device_ok) {
    if (config_.velocity.of_device) {
      velocity_.take(vector_of(sample_.velocity_m_s));
    } else {
      velocity_.update(vector_of(sample_.position_m), sample_.time_ns);
    }
    follow_clutch(vector_of(sample_.position_m), sample_.buttons, now_ns);
  }

  // 2. Does the user want force, and what does physics say?
  take_orders();
  const bool enabled = forces_enabled(device_ok, now_ns);
  take_answers(now_ns);

  // 3. The method, then the ladder, then the device.
  RenderOutput rendered = render(now_ns);
  Eigen::Vector3d walls_n = Eigen::Vector3d::Zero();
  if (config_.walls.exist() && device_ok) {
    walls_n = config_.walls.force_n(vector_of(sample_.position_m), velocity_.velocity_m_s());
    rendered.force_n += walls_n;
  }
  const SafetyOutput safe = make_safe(rendered, device_ok, enabled, now_ns);
  at.computed_ns = clock_ns();
  const rtbus::Vec3 written_n = write_force(safe.force_n, at.computed_ns, now_ns);
  at.written_ns = clock_ns();

  // 4. Physics, then the counters.
  tell_physics(rendered, walls_n, safe.extra_force_n, written_n, enabled, now_ns);
  record_cycle(rendered, safe, written_n, at.due_ns, now_ns);
  if (measure_) record_times(at);
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
