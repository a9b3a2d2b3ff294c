#include "tools/harness/harness.hpp"

#include <cstring>
#include <stdexcept>
#include <utility>

#include "physics_node/engine_registry.hpp"
#include "rtbus/clock.hpp"

namespace tools {

namespace {
constexpr std::uint64_t kStart_ns = rtbus::kNsPerS;  // any instant but 0, which means "never"
constexpr std::uint64_t kBeatPeriod_ns = 20 * rtbus::kNsPerMs;

std::uint64_t to_ns(double seconds) { return static_cast<std::uint64_t>(seconds * 1e9 + 0.5); }
}  // namespace

Harness::Harness(rtbus::config::SessionConfig& session, const HarnessOptions& options)
    : options_(options), config_(haptic::read_haptic_config(session, 0)), now_ns_(kStart_ns), next_beat_ns_(kStart_ns) {
  if (session.physics && haptic::find_renderer(config_.method)->needs_physics) {
    const physics::NodeConfig physics = physics::read_node_config(session);
    physics_ = physics.physics;
    stepper_ = std::make_unique<physics::Stepper>(
        physics::make_world(physics_->engine, session.scene, physics_->engine_settings()),
        std::vector<physics::ProxyConfig>{physics.proxies.front()}, physics_->substeps);
    next_step_ns_ = kStart_ns + to_ns(options.physics_phase_s);
  }
  if (config_.device->own_process()) {
    throw std::runtime_error("the harness has no second process for a device with process: own");
  }
  auto device = config_.device->open({.session = session.session, .node_name = config_.name});
  if (!device) throw std::runtime_error(device.error().message);
  device_ = std::move(*device);
  // Packets are sampled by the harness, at its own phase: the loop offers every tick.
  config_.wire.rate_hz.reset();
  loop_ = std::make_unique<haptic::Loop>(config_, *device_, link_, false);
  if (auto started = device_->start(kStart_ns); !started) throw std::runtime_error(started.error().message);
  next_tick_ns_ = kStart_ns + config_.period_ns();
}

double Harness::now_s() const noexcept { return rtbus::seconds_between(kStart_ns, now_ns_); }

bool Harness::physics_silent(std::uint64_t now_ns) const noexcept {
  const double t = rtbus::seconds_between(kStart_ns, now_ns);
  return options_.physics_dies_s >= 0.0 && t >= options_.physics_dies_s &&
         (options_.physics_returns_s < 0.0 || t < options_.physics_returns_s);
}

void Harness::step_physics(std::uint64_t begin_ns) {
  // As the node does it: read the hand, step. A throttled machine delivers when its period is over.
  if (link_.device.sequence != 0) stepper_->set_device(0, link_.device.value, link_.device.sequence);
  stepper_->step(physics_->step_s(), physics_->parts_per_step());
  rtbus::Stamped<rtbus::ProxyState> answer;
  answer.value = stepper_->answer(0);
  answer.sequence = ++proxies_sent_;
  const std::uint64_t published_ns = physics_->throttle_hz ? begin_ns + to_ns(physics_->step_s()) : begin_ns;
  answer.stamp_ns = published_ns + to_ns(options_.latency_s);
  under_way_.push_back(answer);
}

void Harness::advance_physics(std::uint64_t now_ns) {
  if (!stepper_) return;
  for (; next_step_ns_ <= now_ns; next_step_ns_ += to_ns(physics_->step_s())) {
    if (!physics_silent(next_step_ns_)) step_physics(next_step_ns_);
  }
  while (!under_way_.empty() && under_way_.front().stamp_ns <= now_ns) {
    link_.proxy = under_way_.front();
    link_.proxy_fresh = true;
    under_way_.pop_front();
  }
  for (; next_beat_ns_ <= now_ns; next_beat_ns_ += kBeatPeriod_ns) {
    if (physics_silent(next_beat_ns_)) continue;
    link_.beat.sequence++;
    link_.beat.stamp_ns = next_beat_ns_;
    link_.beat.value.state = static_cast<std::uint32_t>(rtbus::NodeState::kRunning);
    link_.beat.value.work_period_ns = to_ns(physics_->step_s());
    link_.beat_fresh = true;
  }
}

void Harness::run(double duration_s, const Observer& observer) {
  const std::uint64_t end_ns = now_ns_ + to_ns(duration_s);
  while (next_tick_ns_ <= end_ns) {
    now_ns_ = next_tick_ns_;
    advance_physics(now_ns_);
    loop_->cycle(now_ns_, now_ns_);
    const rtbus::Telemetry& telemetry = loop_->telemetry();
    unsigned char bytes[sizeof telemetry];
    std::memcpy(bytes, &telemetry, sizeof telemetry);
    for (const unsigned char byte : bytes) hash_ = (hash_ ^ byte) * 0x100000001b3ULL;
    if (observer) observer(telemetry);
    next_tick_ns_ += config_.period_ns();
  }
  now_ns_ = end_ns;
}

}  // namespace tools
