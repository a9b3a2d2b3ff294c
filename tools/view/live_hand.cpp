#include "tools/view/live_hand.hpp"

#include <algorithm>
#include <utility>

#include "haptic_node/safety.hpp"
#include "rtbus/clock.hpp"
#include "rtbus/eigen.hpp"

namespace view {

LiveHand::LiveHand(const rtbus::Session& session, SessionHand hand)
    : config_(std::move(hand.config)),
      force_limit_n_(hand.force_limit_n),
      shapes_(std::move(hand.shapes)),
      device_(session, config_.name + ".device_state"),
      proxy_(session, "physics.proxy_state." + config_.name),
      telemetry_(session, config_.name + ".telemetry", true),
      contacts_(session, "physics.contact_points." + config_.name, true),
      orders_(session, config_.name + ".orders") {}

void LiveHand::take(const rtbus::Stamped<rtbus::Telemetry>& sample, ViewTicks& out) {
  out.rows.push_back(rows_.row(sample));
  constexpr std::uint32_t kLimits = haptic::kClamped | haptic::kThermalLimited;
  if (const std::uint32_t bits = sample.value.safety & kLimits; bits != 0) {
    clamped_ = bits;
    limited_ns_ = sample.stamp_ns;
  }
  tick_ = sample;
}

bool LiveHand::follow(double history_s, ViewHand& out) {
  proxy_.drain([this](const rtbus::Stamped<rtbus::ProxyState>& sample) {
    answer_ = sample;
    rows_.add_answer(sample);
  });
  bool fresh = false;
  telemetry_.drain([&](const rtbus::Stamped<rtbus::Telemetry>& sample) {
    take(sample, out.ticks);
    fresh = true;
  });
  const auto& device = device_.newest();
  if (!fresh || !device) return fresh;
  forget_older(history_s, out.ticks);
  place_hand(config_, device->value, answer_ ? &answer_->value : nullptr, tick_->value, out);
  return true;
}

void LiveHand::add_contacts(std::uint32_t hand, const ViewHand& placed, std::vector<ViewContact>& out) {
  if (!shapes_.empty()) return add_points(shapes_, placed, kReach_m, hand, out);
  constexpr std::uint64_t kOld_ns = 300 * rtbus::kNsPerMs;  // of a physics node that has gone
  const auto& newest = contacts_.newest();
  if (!newest || rtbus::monotonic_ns() > newest->stamp_ns + kOld_ns) return;
  add_points(newest->value, hand, out);
}

HandState LiveHand::state(const std::string& physics) const {
  HandSigns signs;
  signs.name = config_.name;
  signs.physics = physics;
  signs.force_limit_n = force_limit_n_;
  signs.writer_alive = telemetry_.writer_alive();
  if (tick_) {
    const std::uint64_t now_ns = rtbus::monotonic_ns();
    signs.tick_age_s = std::max(0.0, rtbus::seconds_between(tick_->stamp_ns, now_ns));
    signs.safety = tick_->value.safety;
    signs.gate = tick_->value.gate;
    if ((signs.safety & haptic::kEstop) != 0) {
      if (const auto& orders = orders_.newest()) signs.estop = std::string(rtbus::text_of(orders->value.reason));
    }
    if (now_ns < limited_ns_ + static_cast<std::uint64_t>(kShown_s * 1e9)) signs.recent_safety = clamped_;
  }
  return judge(signs);
}

}  // namespace view
