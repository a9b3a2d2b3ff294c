#include "tools/run_observer.hpp"

#include <algorithm>
#include <cmath>
#include <string_view>

#include "haptic_node/rendering/registry.hpp"
#include "rtbus/clock.hpp"

namespace tools {

namespace {

double norm(const rtbus::Vec3& v) { return std::hypot(v[0], v[1], v[2]); }

/// Opens `topic` if that has not been done; true when it is open.
template <rtbus::Sample T>
bool open_once(std::optional<rtbus::Reader<T>>& reader, const rtbus::Session& session, const std::string& topic,
               rtbus::ReaderOptions options = {}) {
  if (reader) return true;
  auto opened = rtbus::Reader<T>::open(session, topic, options);
  if (opened) reader.emplace(std::move(*opened));
  return reader.has_value();
}

}  // namespace

HapticObserver::HapticObserver(const rtbus::Session& session, const haptic::HapticConfig& config)
    : session_(session), config_(config) {
  const haptic::RendererEntry* const law = haptic::find_renderer(config.method);
  if (law == nullptr || !law->needs_physics) return;
  // A reference is the law without delay: of interpolation the force itself, without ramp (one cycle in improved form).
  const auto make_law = [&](const haptic::Mapping& mapping) {
    return law->make({config.stiffness_n_per_m, config.damping_n_s_per_m, mapping, config.shapes,
                      config.wire.paper && law->server_force == haptic::ServerForce::kNone, config.proxy_mass_kg});
  };
  error_.emplace(config.mapping, make_law, static_cast<double>(config.period_ns()) * 1e-9, config.clutch_button < 0);
}

bool HapticObserver::attach() {
  const std::string& name = config_.name;
  bool all = open_once(ticks_, session_, name + ".telemetry", {.presence = true});
  all = open_once(stats_reader_, session_, name + ".loop_stats") && all;
  all = open_once(info_reader_, session_, name + ".node_info") && all;
  if (needs_physics()) all = open_once(proxies_, session_, "physics.proxy_state." + name) && all;
  return all;
}

void HapticObserver::take(const rtbus::Telemetry& tick) {
  if (observed_ticks_++ == 0) first_due_ns_ = tick.due_ns;
  wakeup_ns_->record(static_cast<std::uint64_t>(std::max(0.0, tick.wakeup_us) * 1e3));
  generated_peak_j_ = std::max(generated_peak_j_, -tick.energy_absorbed_j);
  ledger_min_j_ = observed_ticks_ == 1 ? tick.energy_ledger_j : std::min(ledger_min_j_, tick.energy_ledger_j);
  if (error_) error_->add_tick(tick);
  motion_.add({rtbus::seconds_between(first_due_ns_, tick.due_ns), tick.position_m, tick.proxy_position_m, tick.force_n,
               tick.rendered_force_n, static_cast<double>(tick.proxy_age_ns) * 1e-6});
}

void HapticObserver::take(const rtbus::ProxyState& proxy) {
  if (proxy.contacts > 0) ++contact_steps_;
  coupling_n_.add(norm(proxy.coupling_force_n));
  contact_n_.add(norm(proxy.contact_force_n));
  if (error_) error_->add_proxy(proxy);
}

void HapticObserver::drain() {
  // Proxies after ticks: each tick waits for the proxy that follows it, so less waits at a time.
  while (ticks_ && ticks_->read_next(tick_) == rtbus::ReadStatus::kFresh) take(tick_.value);
  while (proxies_ && proxies_->read_next(proxy_) == rtbus::ReadStatus::kFresh) {
    take(proxy_.value);
    if (first_due_ns_ != 0) {
      steps_.add({rtbus::seconds_between(first_due_ns_, proxy_.stamp_ns), proxy_.value.step_compute_s * 1e3});
    }
  }
  if (stats_reader_) (void)stats_reader_->read_latest(stats_);
  if (info_reader_) (void)info_reader_->read_latest(info_);
}

HapticFigures HapticObserver::figures() const {
  HapticFigures out;
  out.name = config_.name;
  out.info = info_.value;
  out.stats = stats_.value;
  out.observed_ticks = observed_ticks_;
  out.missed_by_observer = ticks_ ? ticks_->missed() : 0;
  out.generated_peak_j = generated_peak_j_;
  out.ledger_min_j = ledger_min_j_;
  out.needs_physics = needs_physics();
  if (error_ && error_->compared() > 0) {
    out.error = StalenessFigures{error_->force_n(), error_->position_m(), error_->dropped()};
  }
  return out;
}

ProxyFigures HapticObserver::proxy_figures() const {
  return {config_.name, coupling_n_.count, contact_steps_, coupling_n_, contact_n_};
}

bool PhysicsObserver::attach() {
  const bool stats = open_once(stats_reader_, session_, "physics.step_stats");
  return open_once(info_reader_, session_, "physics.node_info") && stats;
}

void PhysicsObserver::drain() {
  if (stats_reader_) (void)stats_reader_->read_latest(stats_);
  if (info_reader_) (void)info_reader_->read_latest(info_);
}

PhysicsFigures PhysicsObserver::figures() const {
  PhysicsFigures out;
  out.info = info_.value;
  out.stats = stats_.value;
  return out;
}

}  // namespace tools
