#include "tools/view/tick_rows.hpp"

#include <algorithm>
#include <array>

#include "rtbus/eigen.hpp"

namespace view {

namespace {

std::array<float, 3> floats_of(const rtbus::Vec3& v) {
  return {static_cast<float>(v[0]), static_cast<float>(v[1]), static_cast<float>(v[2])};
}

}  // namespace

void TickRows::add_answer(const rtbus::Stamped<rtbus::ProxyState>& answer) {
  steps_.push_back({answer.sequence, static_cast<float>(1e3 * answer.value.step_compute_s)});
  constexpr std::size_t kWaiting = 4096;  // nobody uses them: physics lost, or a method without physics
  if (steps_.size() > kWaiting) steps_.pop_front();
}

float TickRows::step_before(const rtbus::Telemetry& tick) {
  float longest_ms = 0.0F;
  bool any = false;
  while (!steps_.empty() && steps_.front().sequence <= tick.proxy_sequence) {
    longest_ms = std::max(longest_ms, steps_.front().compute_ms);
    step_ms_ = steps_.front().compute_ms;
    steps_.pop_front();
    any = true;
  }
  return any ? longest_ms : step_ms_;
}

ViewTick TickRows::row(const rtbus::Stamped<rtbus::Telemetry>& sample) {
  const rtbus::Telemetry& tick = sample.value;
  ViewTick row;
  row.time_s = static_cast<double>(sample.stamp_ns) * 1e-9;
  row.force_n = floats_of(tick.force_n);
  row.position_m = floats_of(tick.position_m);
  row.proxy_m = floats_of(tick.proxy_position_m);
  row.proxy_age_ms = tick.proxy_sequence == 0 ? std::numeric_limits<float>::quiet_NaN()
                                              : static_cast<float>(1e-6 * static_cast<double>(tick.proxy_age_ns));
  row.energy_mj = static_cast<float>(1e3 * tick.energy_observed_j);
  row.wakeup_us = static_cast<float>(tick.wakeup_us);
  row.compute_us = static_cast<float>(tick.compute_us);
  row.step_ms = step_before(tick);
  row.gate = static_cast<float>(tick.gate);
  row.safety = tick.safety;
  return row;
}

void place_hand(const tools::StillHandConfig& config, const rtbus::DeviceState& device, const rtbus::ProxyState* proxy,
                const rtbus::Telemetry& tick, ViewHand& out) {
  const tools::StillHand hand = tools::hand_of(config, device, proxy, tick);
  out.proxy_m = hand.proxy_m;
  out.device_m = hand.target_m;
  out.force_n = hand.force_n;
  out.radius_m = hand.radius_m;
  out.origin_m = hand.target_m - config.position_scale * (config.q_WD * rtbus::vector_of(tick.position_m));
}

void add_points(const rtbus::ContactPoints& contacts, std::uint32_t hand, std::vector<ViewContact>& out) {
  for (std::size_t i = 0; i < std::min<std::size_t>(contacts.count, rtbus::kContactSlots); ++i) {
    out.push_back(
        {rtbus::vector_of(contacts.point_m[i]), rtbus::vector_of(contacts.normal[i]), contacts.gap_m[i], hand});
  }
}

void add_points(const std::vector<rtbus::shapes::PlacedShape>& shapes, const ViewHand& placed, double reach_m,
                std::uint32_t hand, std::vector<ViewContact>& out) {
  for (const auto& shape : shapes) {
    const rtbus::shapes::SurfacePoint near = rtbus::shapes::nearest_surface(shape, placed.proxy_m);
    const double gap_m = near.distance_m - placed.radius_m;
    if (gap_m < reach_m) out.push_back({near.point_m, near.normal, gap_m, hand});
  }
}

void forget_older(double history_s, ViewTicks& ticks) {
  while (!ticks.rows.empty() && ticks.rows.front().time_s < ticks.rows.back().time_s - history_s) {
    ticks.rows.pop_front();
    ++ticks.first;
  }
}

}  // namespace view
