#include "tools/harness/harness.hpp"

#include <time.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <stdexcept>
#include <utility>

#include "haptic_node/across_network.hpp"
#include "physics_node/engine_registry.hpp"
#include "rtbus/clock.hpp"
#include "rtbus/sane_sample.hpp"

namespace tools {

namespace {
constexpr std::uint64_t kStart_ns = rtbus::kNsPerS;  // any instant but 0, which means "never"
constexpr std::uint64_t kBeatPeriod_ns = 20 * rtbus::kNsPerMs;
constexpr std::uint64_t kDeviceSilent_ns = 100 * rtbus::kNsPerMs;  // physics::Node::kDeviceSilentNs

std::uint64_t to_ns(double seconds) { return static_cast<std::uint64_t>(std::llround(seconds * 1e9)); }

/// As `link_round_trip_ms` would say it: that of a network which only loses is the least.
double longest_round_trip_s(const NetworkOptions& network) {
  const double delay_s = (1.0 + network.jitter_share) * network.round_trip_s;
  return network.lost_share > 0.0 ? std::max(delay_s, rtbus::config::LinkConfig::kLeastRoundTrip_s) : delay_s;
}

double cpu_s() {
  timespec now{};
  ::clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}
}  // namespace

/// A device that knows how long its read and write took.
class TimedDevice final : public drivers::Device {
 public:
  explicit TimedDevice(std::unique_ptr<drivers::Device> device) : device_(std::move(device)) {}
  [[nodiscard]] const drivers::DeviceInfo& info() const noexcept override { return device_->info(); }
  [[nodiscard]] rtbus::Result<void, drivers::DeviceFault> start(std::uint64_t now_ns) override {
    return device_->start(now_ns);
  }
  [[nodiscard]] drivers::IoStatus read(std::uint64_t now_ns, drivers::DeviceSample& out) noexcept override {
    const std::uint64_t began_ns = rtbus::monotonic_ns();
    const drivers::IoStatus status = device_->read(now_ns, out);
    spent_ns_ += rtbus::monotonic_ns() - began_ns;
    return status;
  }
  [[nodiscard]] drivers::IoStatus write(std::uint64_t now_ns, const drivers::ForceCommand& command) noexcept override {
    const std::uint64_t began_ns = rtbus::monotonic_ns();
    const drivers::IoStatus status = device_->write(now_ns, command);
    spent_ns_ += rtbus::monotonic_ns() - began_ns;
    return status;
  }
  [[nodiscard]] std::uint64_t clamped() const noexcept override { return device_->clamped(); }
  void stop() noexcept override { device_->stop(); }
  [[nodiscard]] std::uint64_t take_spent_ns() noexcept { return std::exchange(spent_ns_, 0); }

 private:
  std::unique_ptr<drivers::Device> device_;
  std::uint64_t spent_ns_ = 0;
};

Harness::Hand::Hand(haptic::HapticConfig settings, const rtbus::config::SessionConfig& session, std::uint64_t start_ns,
                    bool timed_device)
    : config(std::move(settings)) {
  if (config.device->own_process()) {
    throw std::runtime_error("the harness has no second process for a device with process: own");
  }
  auto opened = config.device->open({.session = session.session, .node_name = config.name});
  if (!opened) throw std::runtime_error(opened.error().message);
  device = std::move(*opened);
  if (timed_device) {
    auto wrapped = std::make_unique<TimedDevice>(std::move(device));
    timed = wrapped.get();
    device = std::move(wrapped);
  }
  // Packets are sampled by the harness, at its own phase: the loop offers every tick.
  config.wire.rate_hz.reset();
  loop = std::make_unique<haptic::Loop>(config, *device, link, false);
  if (auto started = device->start(start_ns); !started) throw std::runtime_error(started.error().message);
  next_tick_ns = start_ns + config.period_ns();
}

Harness::Harness(rtbus::config::SessionConfig& session, const HarnessOptions& options)
    : options_(options), now_ns_(kStart_ns), next_beat_ns_(kStart_ns) {
  bool needs_physics = false;
  for (std::size_t i = 0; i < session.haptic.size(); ++i) {
    haptic::HapticConfig settings = haptic::read_haptic_config(session, i);
    settings.safety.passivity.control = settings.safety.passivity.control && options.passivity;
    settings.safety.passivity.bounds = options.energy_bound;
    settings.safety.passivity.damps = options.energy_damper;
    if (!options.knows_shapes) settings.known.clear();
    if (options.network.exists()) {
      haptic::put_across_network(settings, longest_round_trip_s(options.network));
      if (!options.echo_lag) settings.set_point_delay_s = 0.0;
      settings.other_hands.clear();  // as with `link: dds`
    }
    hands_.push_back(std::make_unique<Hand>(std::move(settings), session, kStart_ns, options.measure_cost));
    hands_.back()->link.lost_share = options.lost_share;
    Link& link = hands_.back()->link;
    link.random = Random(options.link_seed + i);
    if (const NetworkOptions& network = options.network; network.exists()) {
      Random seeds(options.link_seed + i);
      link.network.emplace(
          Link::Network{.out = {network, network.out_share * network.round_trip_s, seeds.next()},
                        .back = {network, (1.0 - network.out_share) * network.round_trip_s, seeds.next()}});
    }
    needs_physics = needs_physics || haptic::find_method(hands_.back()->config.method)->needs_physics;
  }
  for (const auto& hand : hands_) {
    for (const haptic::OtherHandConfig& other : hand->config.other_hands) {
      hand->link.other_hands.push_back(&hands_[other.number]->link);
    }
  }
  if (session.physics && needs_physics) {
    physics::NodeConfig physics = physics::read_node_config(session);
    physics_ = physics.physics;
    for (physics::ProxyConfig& proxy : physics.proxies) {
      if (options.network.exists()) proxy.wire.round_trip_s = longest_round_trip_s(options.network);
    }
    auto world = physics::make_world(physics_->engine, session.scene, physics_->engine_settings());
    if (options.around_world) world = options.around_world(std::move(world));
    stepper_ =
        std::make_unique<physics::Stepper>(std::move(world), physics.proxies, physics_->substeps, physics.shape_hash());
    next_step_ns_ = kStart_ns + to_ns(options.physics_phase_s);
  }
}

double Harness::now_s() const noexcept { return rtbus::seconds_between(kStart_ns, now_ns_); }

bool Harness::physics_silent(std::uint64_t now_ns) const noexcept {
  const double t = rtbus::seconds_between(kStart_ns, now_ns);
  return options_.physics_dies_s >= 0.0 && t >= options_.physics_dies_s &&
         (options_.physics_returns_s < 0.0 || t < options_.physics_returns_s);
}

bool Harness::loop_stands(std::uint64_t now_ns) const noexcept {
  const double t = rtbus::seconds_between(kStart_ns, now_ns);
  return options_.loop_stops_s >= 0.0 && t >= options_.loop_stops_s &&
         t < options_.loop_stops_s + options_.loop_pause_s;
}

void Harness::step_physics(std::uint64_t begin_ns) {
  // As the node does it: read the hands, step. A throttled machine delivers when its period is over.
  for (std::size_t i = 0; i < hands_.size(); ++i) {
    Hand& hand = *hands_[i];
    hand.link.take_state(begin_ns);
    const rtbus::Stamped<rtbus::DeviceState>& device = hand.link.device;
    if (device.sequence == 0) continue;
    // What a killed node has sent before lies in shared memory still.
    const bool silent = hand.killed && begin_ns > hand.heard_ns + kDeviceSilent_ns;
    if (!silent) {
      for (const rtbus::DeviceState& state : hand.link.unheard) stepper_->hear(i, state);
      hand.link.unheard.clear();
      stepper_->set_device(i, device.value, device.sequence);
    } else if (!hand.silent) {
      stepper_->release(i);
      hand.silent = true;
    }
  }
  const double began_s = options_.measure_cost ? cpu_s() : 0.0;
  stepper_->step(physics_->step_s(), physics_->parts_per_step());
  if (options_.measure_cost) {
    cost_.steps_s += cpu_s() - began_s;
    ++cost_.steps;
  }
  const std::uint64_t published_ns = physics_->throttle_hz ? begin_ns + to_ns(physics_->step_s()) : begin_ns;
  for (std::size_t i = 0; i < hands_.size(); ++i) {
    rtbus::Stamped<rtbus::ProxyState> answer;
    answer.value = stepper_->answer(i);
    answer.sequence = ++hands_[i]->proxies_sent;
    if (i == 0 && step_observer_) step_observer_(answer.value);
    answer.stamp_ns = published_ns + to_ns(options_.latency_s);
    Link& link = hands_[i]->link;
    if (options_.jitter_s > 0.0) {
      answer.stamp_ns += to_ns(options_.jitter_s * link.random.fraction());
      const auto& before = hands_[i]->under_way;
      if (!before.empty()) answer.stamp_ns = std::max(answer.stamp_ns, before.back().stamp_ns);
    }
    if (options_.lost_share > 0.0 && link.random.fraction() < options_.lost_share) continue;
    const bool wants_contacts = stepper_->wants_contacts(i);
    rtbus::Stamped<rtbus::ProxyContacts> contacts;
    if (wants_contacts) {
      stepper_->contacts(i, physics_->contact_radius_m.value_or(0.0), contacts.value);
      if (i == 0 && contact_observer_) contact_observer_(contacts.value);
      contacts.sequence = answer.sequence;
      contacts.stamp_ns = answer.stamp_ns;
    }
    if (i == 0 && tamper_) {
      Answer told{link.device.value, answer, wants_contacts ? &contacts : nullptr};
      tamper_(told);
      silenced_ = told.silent;
      if (silenced_) continue;
    }
    publish(*hands_[i], answer, wants_contacts ? &contacts : nullptr);
  }
}

void Harness::publish(Hand& hand, const rtbus::Stamped<rtbus::ProxyState>& answer,
                      const rtbus::Stamped<rtbus::ProxyContacts>* contacts) {
  if (auto& network = hand.link.network) {
    const auto at_ns = network->back.arrival_ns(answer.stamp_ns);
    if (!at_ns) return;
    Link::Datagram datagram{beat(), answer, std::nullopt};
    if (contacts != nullptr) datagram.contacts = *contacts;
    network->answers.send(datagram, *at_ns);
    return;
  }
  const auto judge = [&](const auto& sample, auto& under_way) {
    if (!tamper_ || rtbus::sane(sample.value, sample.stamp_ns)) {
      under_way.push_back(sample);
    } else {
      ++hand.link.refused_answers;
    }
  };
  judge(answer, hand.under_way);
  if (contacts != nullptr) judge(*contacts, hand.contacts_under_way);
}

rtbus::Heartbeat Harness::beat() const noexcept {
  rtbus::Heartbeat out;
  out.state = static_cast<std::uint32_t>(rtbus::NodeState::kRunning);
  out.work_period_ns = to_ns(physics_->step_s());
  return out;
}

void Harness::Link::hear(const rtbus::Heartbeat& heard, std::uint64_t now_ns) {
  beat.value = heard;
  beat.stamp_ns = now_ns;
  ++beat.sequence;
  beat_fresh = true;
}

void Harness::Link::take_answers(std::uint64_t now_ns) {
  if (!network) return;
  if (auto arrived = network->answers.take(now_ns)) {
    Datagram& datagram = arrived->packet;
    hear(datagram.beat, arrived->arrival_ns);
    proxy = datagram.proxy;
    proxy.stamp_ns = arrived->arrival_ns;
    proxy_fresh = true;
    if (datagram.contacts) {
      contacts = *datagram.contacts;
      contacts.stamp_ns = arrived->arrival_ns;
      contacts_fresh = true;
    }
  }
  if (const auto arrived = network->beats.take(now_ns)) hear(arrived->packet, arrived->arrival_ns);
}

void Harness::advance_physics(std::uint64_t now_ns) {
  if (!stepper_) return;
  for (; next_step_ns_ <= now_ns; next_step_ns_ += to_ns(physics_->step_s())) {
    if (!physics_silent(next_step_ns_)) step_physics(next_step_ns_);
  }
  for (const auto& hand : hands_) {
    hand->link.take_answers(now_ns);
    while (!hand->under_way.empty() && hand->under_way.front().stamp_ns <= now_ns) {
      hand->link.proxy = hand->under_way.front();
      hand->link.proxy_fresh = true;
      hand->under_way.pop_front();
    }
    while (!hand->contacts_under_way.empty() && hand->contacts_under_way.front().stamp_ns <= now_ns) {
      hand->link.contacts = hand->contacts_under_way.front();
      hand->link.contacts_fresh = true;
      hand->contacts_under_way.pop_front();
    }
  }
  for (; next_beat_ns_ <= now_ns; next_beat_ns_ += kBeatPeriod_ns) {
    if (silenced_ || physics_silent(next_beat_ns_)) continue;
    for (const auto& hand : hands_) {
      if (auto& network = hand->link.network) {
        if (const auto at_ns = network->back.arrival_ns(next_beat_ns_)) network->beats.send(beat(), *at_ns);
      } else {
        hand->link.hear(beat(), next_beat_ns_);
      }
    }
  }
}

void Harness::cycle(Hand& hand) {
  const std::uint64_t began_ns = hand.timed != nullptr ? rtbus::monotonic_ns() : 0;
  hand.loop->cycle(now_ns_, now_ns_);
  if (hand.timed == nullptr) return;
  const std::uint64_t all_ns = rtbus::monotonic_ns() - began_ns;
  const std::uint64_t device_ns = hand.timed->take_spent_ns();
  cost_.cycle_ns.record(all_ns > device_ns ? all_ns - device_ns : 0);
}

void Harness::run(double duration_s, const Observer& observer) {
  run_all(duration_s, [&observer](std::size_t node, const rtbus::Telemetry& telemetry) {
    if (node == 0 && observer) observer(telemetry);
  });
}

void Harness::run_all(double duration_s, const ObserverOfAll& observer) {
  const std::uint64_t end_ns = now_ns_ + to_ns(duration_s);
  while (true) {
    std::size_t next = 0;
    for (std::size_t i = 1; i < hands_.size(); ++i) {
      if (hands_[i]->next_tick_ns < hands_[next]->next_tick_ns) next = i;
    }
    Hand& hand = *hands_[next];
    if (hand.next_tick_ns > end_ns) break;
    now_ns_ = hand.next_tick_ns;
    hand.next_tick_ns += hand.config.period_ns();
    advance_physics(now_ns_);
    if (hand.killed || loop_stands(now_ns_)) continue;
    cycle(hand);
    hand.heard_ns = now_ns_;
    const rtbus::Telemetry& telemetry = hand.loop->telemetry();
    unsigned char bytes[sizeof telemetry];
    std::memcpy(bytes, &telemetry, sizeof telemetry);
    for (const unsigned char byte : bytes) hash_ = (hash_ ^ byte) * 0x100000001b3ULL;
    if (observer) observer(next, telemetry);
  }
  now_ns_ = end_ns;
}

}  // namespace tools
