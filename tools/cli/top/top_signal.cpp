#include "tools/cli/top/top_signal.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "haptic_node/safety.hpp"
#include "rtbus/clock.hpp"

namespace tools {

namespace {

constexpr std::uint64_t kSlot_ns = 100 * rtbus::kNsPerMs;
constexpr std::uint64_t kWindowSeconds = 10;
static_assert(RecentSignals::kSlot_s == 0.1 && RecentSignals::kWindow_s == 10.0);

/// The bin of one wake-up; what is no number is as late as can be.
std::size_t bin_of(double wakeup_us) {
  std::size_t bin = 0;
  while (bin < kJitterEdges_us.size() && !(wakeup_us < kJitterEdges_us[bin])) ++bin;
  return bin;
}

}  // namespace

double norm_of(const rtbus::Vec3& v) noexcept { return std::sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]); }

std::uint32_t cut_bits(std::uint32_t safety) noexcept {
  return safety & (haptic::kOverspeed | haptic::kStale | haptic::kNonfinite | haptic::kDeviceLost | haptic::kDisabled |
                   haptic::kEstop);
}

void RecentSignals::take(const rtbus::Telemetry& tick, std::uint64_t stamp_ns) {
  const std::uint64_t slot = stamp_ns / kSlot_ns;
  if (slots_.empty() || slots_.back().index != slot) slots_.push_back({slot, 0.0, {}});
  const double norm_n = norm_of(tick.force_n);
  // A force that is no number must stay visible: it counts as more than any other.
  const double shown_n = std::isnan(norm_n) ? std::numeric_limits<double>::infinity() : norm_n;
  slots_.back().force_n = std::max(slots_.back().force_n, shown_n);
  slots_.back().position_m = tick.position_m;
  if (slots_.size() > kSlots) slots_.pop_front();

  const std::uint64_t second = stamp_ns / rtbus::kNsPerS;
  if (seconds_.empty() || seconds_.back().index != second) {
    seconds_.emplace_back();
    seconds_.back().index = second;
  }
  Second& now = seconds_.back();
  ++now.jitter[bin_of(tick.wakeup_us)];
  ++now.ticks;
  now.wakeup_max_us = std::max(now.wakeup_max_us, tick.wakeup_us);
  now.compute_max_us = std::max(now.compute_max_us, tick.compute_us);
  if (seconds_.size() > kWindowSeconds) seconds_.pop_front();

  watch_cuts(tick, stamp_ns);
  last_tick_ = tick.tick;
}

void RecentSignals::watch_cuts(const rtbus::Telemetry& tick, std::uint64_t stamp_ns) {
  // A restarted node counts anew: the cut that its predecessor was in has ended with that process.
  if (tick.tick < last_tick_) cutting_ = false;
  const std::uint32_t bits = cut_bits(tick.safety);
  if (bits == 0) {
    cutting_ = false;
    return;
  }
  if (!cutting_) {
    cutting_ = true;
    cut_bits_ = 0;
    cut_began_ns_ = stamp_ns;
  }
  cut_bits_ |= bits;
  cut_ended_ns_ = stamp_ns;
}

std::optional<RecentView> RecentSignals::view(std::uint64_t now_ns, std::uint64_t missed) const {
  if (slots_.empty()) return std::nullopt;
  RecentView out;
  out.missed = missed;
  for (const Second& second : seconds_) {
    if (second.index + kWindowSeconds <= now_ns / rtbus::kNsPerS) continue;
    for (std::size_t i = 0; i < out.jitter.size(); ++i) out.jitter[i] += second.jitter[i];
    out.ticks += second.ticks;
    out.wakeup_max_us = std::max(out.wakeup_max_us, second.wakeup_max_us);
    out.compute_max_us = std::max(out.compute_max_us, second.compute_max_us);
  }
  // Time goes on also when no ticks come: gaps are gaps on the screen. The slot of `now` is not over yet.
  constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
  const std::uint64_t end = std::max(now_ns / kSlot_ns, slots_.back().index);
  const std::uint64_t oldest_kept = end > kSlots ? end - kSlots : 0;
  const std::uint64_t begin = std::max(slots_.front().index, oldest_kept);
  const auto count = static_cast<std::size_t>(end > begin ? end - begin : 0);
  out.force_n.assign(count, kNone);
  out.position_m.assign(count, {kNone, kNone, kNone});
  for (const Slot& slot : slots_) {
    if (slot.index < begin || slot.index >= end) continue;
    out.force_n[slot.index - begin] = slot.force_n;
    out.position_m[slot.index - begin] = slot.position_m;
  }
  if (cut_bits_ != 0) {
    out.cut = CutView{cut_bits_, std::max(0.0, rtbus::seconds_between(cut_began_ns_, now_ns)),
                      rtbus::seconds_between(cut_began_ns_, cut_ended_ns_), cutting_};
  }
  return out;
}

}  // namespace tools
