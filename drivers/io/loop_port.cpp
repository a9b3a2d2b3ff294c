#include "drivers/io/loop_port.hpp"

#include <algorithm>
#include <cmath>

#include "drivers/io/futex.hpp"
#include "rtbus/clock.hpp"

namespace drivers::io {
namespace {

/// A loop that has not asked to be paced for so long runs by its own timer.
constexpr std::uint64_t kPacedForNs = 50 * rtbus::kNsPerMs;

}  // namespace

LoopPort::LoopPort(const DeviceInfo& info)
    : max_force_n_(info.max_force_n),
      force_timeout_ns_(rtbus::ns_of(info.force_timeout_s)),
      answer_timeout_ns_(force_timeout_ns_ - force_timeout_ns_ / 10) {}

void LoopPort::reset() noexcept {
  for (auto* counter : {&clamped_, &late_forces_, &timed_out_}) counter->store(0);
  withheld_.store(0);
  withheld_seen_ = 0;
  read_ = {};
  sample_number_ = 0;
  newest_sample_.store(0);
  answered_.store(0);
  last_wait_ns_.store(0);
}

// --- The loop's side ------------------------------------------------------------------------------------------------

IoStatus LoopPort::wait_sample(std::uint64_t deadline_ns) noexcept {
  const auto running = [this] { return state_.load(std::memory_order_seq_cst) == LinkState::kRunning; };
  if (!running()) return IoStatus::kLost;
  last_wait_ns_.store(rtbus::monotonic_ns(), std::memory_order_relaxed);

  // Hand-over: the force of the last cycle answers the sample that was read in it.
  answered_.store(read_.number, std::memory_order_seq_cst);
  force_bell_.fetch_add(1, std::memory_order_seq_cst);
  if (device_waits_.load(std::memory_order_seq_cst)) futex_wake(force_bell_);

  IoStatus status = IoStatus::kOk;
  loop_waits_.store(true, std::memory_order_seq_cst);
  for (;;) {
    const std::uint32_t seen = sample_bell_.load(std::memory_order_seq_cst);
    if (newest_sample_.load(std::memory_order_seq_cst) > read_.number) break;
    if (!running()) {
      status = IoStatus::kLost;
      break;
    }
    if (rtbus::monotonic_ns() >= deadline_ns) {
      status = IoStatus::kTimeout;
      break;
    }
    futex_wait(sample_bell_, seen, deadline_ns);
  }
  loop_waits_.store(false, std::memory_order_relaxed);
  return status;
}

IoStatus LoopPort::read(std::uint64_t now_ns, DeviceSample& out) noexcept RTBUS_NONBLOCKING {
  if (state_.load(std::memory_order_acquire) != LinkState::kRunning) return IoStatus::kLost;
  const bool fresh = samples_.take(read_);
  if (read_.number == 0 || now_ns > read_.value.time_ns + force_timeout_ns_) return IoStatus::kLost;
  out = read_.value;
  // It may have arrived after the caller looked at its clock; ages must not come out negative.
  out.time_ns = std::min(out.time_ns, now_ns);
  return fresh ? IoStatus::kOk : IoStatus::kStale;
}

IoStatus LoopPort::write(std::uint64_t now_ns, const ForceCommand& command) noexcept RTBUS_NONBLOCKING {
  if (state_.load(std::memory_order_acquire) != LinkState::kRunning) return IoStatus::kLost;
  if (const std::uint32_t withheld = withheld_.load(std::memory_order_acquire); withheld != withheld_seen_) {
    withheld_seen_ = withheld;
    return IoStatus::kLost;
  }
  Force force{command.force_n, now_ns, withheld_seen_};
  // Not std::hypot of three: libstdc++'s gives 0 for (0, NaN, 0).
  const auto& [x, y, z] = force.force_n;
  const double norm = std::sqrt(x * x + y * y + z * z);
  if (!std::isfinite(norm)) {
    force.force_n = {};
    bump(clamped_);
  } else if (norm > max_force_n_ * (1.0 + 1e-9)) {
    for (double& each : force.force_n) each *= max_force_n_ / norm;
    bump(clamped_);
  }
  forces_.put(force);
  return IoStatus::kOk;
}

// --- The device's side ----------------------------------------------------------------------------------------------

void LoopPort::set_state(LinkState state) noexcept {
  if (state == LinkState::kRunning && state_.load(std::memory_order_relaxed) != state) {
    running_since_ns_ = rtbus::monotonic_ns();
  }
  if (state_.exchange(state, std::memory_order_seq_cst) == state) return;
  sample_bell_.fetch_add(1, std::memory_order_seq_cst);
  if (loop_waits_.load(std::memory_order_seq_cst)) futex_wake(sample_bell_);
}

void LoopPort::publish(const DeviceSample& sample) noexcept {
  if (last_published_ns_ != 0 && sample.time_ns > last_published_ns_) {
    sample_period_ns_.record(sample.time_ns - last_published_ns_);
  }
  last_published_ns_ = sample.time_ns;
  samples_.put({sample, ++sample_number_});
  newest_sample_.store(sample_number_, std::memory_order_seq_cst);
  sample_bell_.fetch_add(1, std::memory_order_seq_cst);
  if (loop_waits_.load(std::memory_order_seq_cst)) futex_wake(sample_bell_);
}

bool LoopPort::paced() const noexcept {
  return last_published_ns_ < last_wait_ns_.load(std::memory_order_relaxed) + kPacedForNs;
}

bool LoopPort::await_force(std::uint64_t deadline_ns) noexcept {
  bool came = false;
  device_waits_.store(true, std::memory_order_seq_cst);
  for (;;) {
    const std::uint32_t seen = force_bell_.load(std::memory_order_seq_cst);
    if (answered_.load(std::memory_order_seq_cst) >= sample_number_) {
      awaited_ns_ = last_published_ns_;
      came = true;
      break;
    }
    if (rtbus::monotonic_ns() >= deadline_ns) {
      bump(late_forces_);
      break;
    }
    futex_wait(force_bell_, seen, deadline_ns);
  }
  device_waits_.store(false, std::memory_order_relaxed);
  return came;
}

LoopPort::Command LoopPort::take_force(std::uint64_t now_ns, std::uint64_t last_answer_ns) noexcept {
  (void)forces_.take(force_);
  if (state_.load(std::memory_order_relaxed) != LinkState::kRunning) return {};
  const bool known = force_.withheld == withheld_.load(std::memory_order_relaxed);  // to the loop: the last zero
  const bool written = force_.time_ns > running_since_ns_ && now_ns <= force_.time_ns + force_timeout_ns_;
  const bool answering = now_ns <= last_answer_ns + answer_timeout_ns_;
  if (known && written && answering) return {force_.force_n, true};
  if (known && force_.time_ns != 0) {
    bump(timed_out_);
    // Where the loop is late it begins anew by itself.
    if (written && force_.force_n != Vec3{}) withhold();
  }
  return {};
}

void LoopPort::sent(std::uint64_t now_ns) noexcept {
  // The force that answers a sample leaves once; a repetition says nothing about the delay.
  if (awaited_ns_ != 0) sample_to_wire_ns_.record(now_ns - awaited_ns_);
  awaited_ns_ = 0;
}

rtbus::LinkStats LoopPort::stats() const noexcept {
  const auto get = [](const std::atomic<std::uint64_t>& cell) { return cell.load(std::memory_order_relaxed); };
  const auto us = [](const rtbus::Histogram& histogram, double share) {
    return 1e-3 * static_cast<double>(histogram.percentile(share));
  };
  rtbus::LinkStats out;
  out.late_forces = get(late_forces_);
  out.timed_out = get(timed_out_);
  out.withheld = withheld_.load(std::memory_order_relaxed);
  out.sample_to_wire_p50_us = us(sample_to_wire_ns_, 0.5);
  out.sample_to_wire_p99_us = us(sample_to_wire_ns_, 0.99);
  out.period_p50_us = us(sample_period_ns_, 0.5);
  out.period_p99_us = us(sample_period_ns_, 0.99);
  out.state = static_cast<std::uint32_t>(state_.load(std::memory_order_relaxed));
  return out;
}

}  // namespace drivers::io
