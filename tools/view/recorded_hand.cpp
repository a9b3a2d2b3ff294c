#include "tools/view/recorded_hand.hpp"

#include <algorithm>
#include <utility>

#include "haptic_node/safety.hpp"
#include "rtbus/clock.hpp"
#include "rtbus/eigen.hpp"

namespace view {

namespace {

/// The last readable row that is not after `time_ns`, of the ten before it.
template <class T>
bool newest(RecordedTrack<T>& track, std::uint64_t time_ns, rtbus::Stamped<T>& out) {
  constexpr std::size_t kTries = 10;
  const std::size_t end = track.until(time_ns);
  for (std::size_t i = 0; i < std::min(end, kTries); ++i) {
    if (track.read(end - 1 - i, out)) return true;
  }
  return false;
}

}  // namespace

RecordedHand::RecordedHand(const rtbus::recording::Recording& recording, SessionHand hand,
                           std::vector<std::string>& notes)
    : config_(std::move(hand.config)),
      force_limit_n_(hand.force_limit_n),
      shapes_(std::move(hand.shapes)),
      device_(recording, config_.name + ".device_state", notes),
      proxy_(recording, "physics.proxy_state." + config_.name, notes),
      telemetry_(recording, config_.name + ".telemetry", notes),
      contacts_(recording, "physics.contact_points." + config_.name, notes),
      orders_(recording, config_.name + ".orders", notes) {}

void RecordedHand::follow(std::uint64_t time_ns, bool jump, double history_s, ViewHand& out) {
  const std::uint64_t history_ns = rtbus::ns_of(history_s);
  const std::size_t end = telemetry_.until(time_ns);
  if (jump) {
    const std::uint64_t from_ns = time_ns > history_ns ? time_ns - history_ns : 0;
    constexpr std::size_t kMostTicks = 80'000;  // of a loop at 10 kHz: the last 8 s
    next_ = std::max(telemetry_.until(from_ns), end > kMostTicks ? end - kMostTicks : 0);
    next_answer_ = next_ < telemetry_.rows() ? proxy_.until(telemetry_.stamp_ns(next_)) : 0;
    rows_.forget();
    out.ticks.first = out.ticks.end();
    out.ticks.rows.clear();
    limits_ = 0;
  }
  constexpr std::uint32_t kLimits = haptic::kClamped | haptic::kThermalLimited;
  rtbus::Stamped<rtbus::ProxyState> answer;
  rtbus::Stamped<rtbus::Telemetry> tick;
  for (; next_ < end; ++next_) {
    if (!telemetry_.read(next_, tick)) continue;
    for (; next_answer_ < proxy_.rows() && proxy_.stamp_ns(next_answer_) <= tick.stamp_ns; ++next_answer_) {
      if (proxy_.read(next_answer_, answer)) rows_.add_answer(answer);
    }
    out.ticks.rows.push_back(rows_.row(tick));
    if (const std::uint32_t bits = tick.value.safety & kLimits; bits != 0) {
      limits_ = bits;
      limited_ns_ = tick.stamp_ns;
    }
  }
  forget_older(history_s, out.ticks);
  rtbus::Stamped<rtbus::DeviceState> device;
  if (!newest(device_, time_ns, device) || !newest(telemetry_, time_ns, tick)) return;
  const bool answered = newest(proxy_, time_ns, answer);
  place_hand(config_, device.value, answered ? &answer.value : nullptr, tick.value, out);
}

void RecordedHand::add_contacts(std::uint64_t time_ns, std::uint32_t hand, const ViewHand& placed,
                                std::vector<ViewContact>& out) {
  if (!shapes_.empty()) return add_points(shapes_, placed, kReach_m, hand, out);
  constexpr std::uint64_t kOld_ns = 300 * rtbus::kNsPerMs;
  rtbus::Stamped<rtbus::ContactPoints> sample;
  if (!newest(contacts_, time_ns, sample) || time_ns > sample.stamp_ns + kOld_ns) return;
  add_points(sample.value, hand, out);
}

HandState RecordedHand::state(std::uint64_t time_ns) {
  HandSigns signs;
  signs.name = config_.name;
  signs.force_limit_n = force_limit_n_;
  signs.writer_alive = true;
  rtbus::Stamped<rtbus::Telemetry> tick;
  if (!newest(telemetry_, time_ns, tick)) {
    return {"NO DATA", config_.name + ": no tick was recorded up to here", Level::kWarn};
  }
  if (time_ns > tick.stamp_ns + rtbus::ns_of(kSilent_s)) {
    return {"NO DATA", config_.name + ": no tick was recorded here", Level::kWarn};
  }
  signs.tick_age_s = 0.0;
  signs.safety = tick.value.safety;
  signs.gate = tick.value.gate;
  rtbus::Stamped<rtbus::Orders> orders;
  if ((signs.safety & haptic::kEstop) != 0 && newest(orders_, time_ns, orders)) {
    signs.estop = std::string(rtbus::text_of(orders.value.reason));
  }
  if (limits_ != 0 && time_ns < limited_ns_ + rtbus::ns_of(kShown_s)) signs.recent_safety = limits_;
  return judge(signs);
}

}  // namespace view
