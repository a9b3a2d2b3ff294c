#include "haptic_node/loop_counters.hpp"

#include <cmath>

namespace haptic {

namespace {

// One writer: a relaxed load and store is enough, and cheaper than an atomic addition.
void bump(std::atomic<std::uint64_t>& counter) noexcept {
  counter.store(counter.load(std::memory_order_relaxed) + 1, std::memory_order_relaxed);
}

}  // namespace

void LoopCounters::count(const SafetyOutput& safe, const Passivity& passivity, const LinkMonitor& monitor) noexcept {
  const auto bump_if = [&](std::uint32_t bits, std::atomic<std::uint64_t>& counter) {
    if ((safe.acted & bits) != 0) bump(counter);
  };
  bump(ticks);
  bump_if(kClamped, clamped);
  bump_if(kSlewLimited, slew_limited);
  bump_if(kStale, stale_ticks);
  bump_if(kNonfinite, nonfinite);
  bump_if(kOverspeed, overspeed);
  bump_if(kThermalLimited, thermal_limited);
  bump_if(kPassivity, passivity_ticks);
  bump_if(kDeviceLost, device_lost);
  losses.store(monitor.losses(), std::memory_order_relaxed);
  last_loss_ns.store(monitor.last_loss_ns(), std::memory_order_relaxed);
  const double square = safe.force_n.squaredNorm();
  force_square_sum_n2.store(force_square_sum_n2.load(std::memory_order_relaxed) + square, std::memory_order_relaxed);
  if (const double norm = std::sqrt(square); norm > force_peak_n.load(std::memory_order_relaxed)) {
    force_peak_n.store(norm, std::memory_order_relaxed);
  }
  energy_absorbed_j.store(passivity.absorbed_j(), std::memory_order_relaxed);
  energy_removed_j.store(passivity.dissipated_j(), std::memory_order_relaxed);
}

void LoopCounters::count_correction(double correction_m) noexcept {
  if (!std::isfinite(correction_m)) return;
  bump(corrections);
  correction_sum_m.store(correction_sum_m.load(std::memory_order_relaxed) + correction_m, std::memory_order_relaxed);
  if (correction_m > correction_peak_m.load(std::memory_order_relaxed)) {
    correction_peak_m.store(correction_m, std::memory_order_relaxed);
  }
}

void LoopCounters::count_pause() noexcept { bump(pauses); }

rtbus::LoopStats LoopCounters::stats() const {
  const auto load = [](const auto& counter) { return counter.load(std::memory_order_relaxed); };
  const auto us = [](std::uint64_t ns) { return static_cast<double>(ns) * 1e-3; };
  const auto ms = [](std::uint64_t ns) { return static_cast<double>(ns) * 1e-6; };
  rtbus::LoopStats out;
  out.wakeup_p50_us = us(wakeup_ns.percentile(0.50));
  out.wakeup_p99_us = us(wakeup_ns.percentile(0.99));
  out.wakeup_p999_us = us(wakeup_ns.percentile(0.999));
  out.wakeup_max_us = us(wakeup_ns.max());
  out.compute_p50_us = us(compute_ns.percentile(0.50));
  out.compute_p99_us = us(compute_ns.percentile(0.99));
  out.compute_max_us = us(compute_ns.max());
  out.device_p50_us = us(device_ns.percentile(0.50));
  out.device_p99_us = us(device_ns.percentile(0.99));
  out.device_max_us = us(device_ns.max());
  out.proxy_age_p50_ms = ms(proxy_age_ns.percentile(0.50));
  out.proxy_age_p99_ms = ms(proxy_age_ns.percentile(0.99));
  out.proxy_age_max_ms = ms(proxy_age_ns.max());
  out.ticks_due = load(ticks_due);
  out.ticks = load(ticks);
  out.overruns = load(overruns);
  out.force_rms_n = out.ticks > 0 ? std::sqrt(load(force_square_sum_n2) / static_cast<double>(out.ticks)) : 0.0;
  out.force_peak_n = load(force_peak_n);
  out.energy_absorbed_j = load(energy_absorbed_j);
  out.energy_removed_j = load(energy_removed_j);
  out.corrections = load(corrections);
  if (out.corrections > 0) {
    out.correction_mean_mm = 1e3 * load(correction_sum_m) / static_cast<double>(out.corrections);
    out.correction_max_mm = 1e3 * load(correction_peak_m);
  }
  out.clamped = load(clamped);
  out.slew_limited = load(slew_limited);
  out.stale_ticks = load(stale_ticks);
  out.nonfinite = load(nonfinite);
  out.overspeed = load(overspeed);
  out.thermal_limited = load(thermal_limited);
  out.passivity_ticks = load(passivity_ticks);
  out.device_lost = load(device_lost);
  out.losses = load(losses);
  out.last_loss_ns = load(last_loss_ns);
  out.pauses = load(pauses);
  return out;
}

}  // namespace haptic
