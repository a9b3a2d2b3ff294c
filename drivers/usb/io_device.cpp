#include "drivers/usb/io_device.hpp"

#include <algorithm>
#include <cmath>
#include <condition_variable>
#include <utility>

#include "drivers/usb/futex.hpp"
#include "rtbus/clock.hpp"
#include "rtbus/realtime.hpp"

namespace drivers::usb {

namespace {

std::uint64_t nanoseconds(double seconds) { return static_cast<std::uint64_t>(std::llround(seconds * 1e9)); }

// The loop's alone: a relaxed load and store is enough.
void bump(std::atomic<std::uint64_t>& counter) noexcept {
  counter.store(counter.load(std::memory_order_relaxed) + 1, std::memory_order_relaxed);
}

}  // namespace

/// Where start() waits for the outcome of the first attempt.
struct IoDevice::First {
  std::mutex mutex;
  std::condition_variable changed;
  bool done = false;
  bool ok = false;
  std::string message;
};

IoDevice::IoDevice(IoSettings settings, IoThread thread, ProtocolFactory protocol, ChannelOpener opener)
    : settings_(std::move(settings)),
      place_(thread),
      make_protocol_(std::move(protocol)),
      open_(std::move(opener)),
      period_ns_(nanoseconds(1.0 / settings_.info.sample_rate_hz)),
      force_timeout_ns_(nanoseconds(settings_.info.force_timeout_s)),
      answer_timeout_ns_(force_timeout_ns_ - force_timeout_ns_ / 10) {}

rtbus::Result<void, DeviceFault> IoDevice::start(std::uint64_t) {
  stop();
  stop_.lower();
  stop_.hold_back(false);
  clamped_.store(0);
  for (auto* counter : {&losses_, &late_forces_, &timed_out_, &silences_}) counter->store(0);
  withheld_.store(0);
  withheld_seen_ = 0;
  read_ = {};
  sample_number_ = 0;
  newest_sample_.store(0);
  answered_.store(0);
  last_wait_ns_.store(0);
  {
    const std::lock_guard lock(mutex_);
    notice_.clear();
  }
  set_state(LinkState::kOpening);

  First first;
  first_ = &first;
  thread_ = std::thread([this] { run(); });
  std::unique_lock lock(first.mutex);
  first.changed.wait(lock, [&] { return first.done; });
  if (first.ok) return {};
  lock.unlock();
  thread_.join();
  set_state(LinkState::kStopped);
  return rtbus::Failure{DeviceFault{first.message}};
}

void IoDevice::report_first(bool ok, std::string message) {
  First* const first = std::exchange(first_, nullptr);
  if (first == nullptr) return;
  const std::lock_guard lock(first->mutex);  // start() frees it as soon as it gets the lock
  first->done = true;
  first->ok = ok;
  first->message = std::move(message);
  first->changed.notify_one();
}

void IoDevice::stop() noexcept {
  if (!thread_.joinable()) return;
  stop_.raise();
  thread_.join();
}

void IoDevice::tell(std::string text) {
  const std::lock_guard lock(mutex_);
  if (!notice_.empty()) notice_ += "; then: ";
  notice_ += text;
}

std::string IoDevice::take_notice() {
  const std::lock_guard lock(mutex_);
  return std::exchange(notice_, {});
}

void IoDevice::set_state(LinkState state) noexcept {
  if (state_.exchange(state, std::memory_order_seq_cst) == state) return;
  sample_bell_.fetch_add(1, std::memory_order_seq_cst);
  if (loop_waits_.load(std::memory_order_seq_cst)) futex_wake(sample_bell_);
}

// --- The loop's side ------------------------------------------------------------------------------------------------

IoStatus IoDevice::wait_sample(std::uint64_t deadline_ns) noexcept {
  const auto running = [this] { return state_.load(std::memory_order_seq_cst) == LinkState::kRunning; };
  if (!running()) return IoStatus::kLost;
  last_wait_ns_.store(rtbus::monotonic_ns(), std::memory_order_relaxed);

  // Hand-over: the force of the last cycle answers the sample that was read in it.
  answered_.store(read_.number, std::memory_order_seq_cst);
  force_bell_.fetch_add(1, std::memory_order_seq_cst);
  if (io_waits_.load(std::memory_order_seq_cst)) futex_wake(force_bell_);

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

IoStatus IoDevice::read(std::uint64_t now_ns, DeviceSample& out) noexcept RTBUS_NONBLOCKING {
  if (state_.load(std::memory_order_acquire) != LinkState::kRunning) return IoStatus::kLost;
  const bool fresh = samples_.take(read_);
  if (read_.number == 0 || now_ns > read_.value.time_ns + force_timeout_ns_) return IoStatus::kLost;
  out = read_.value;
  // It may have arrived after the caller looked at its clock; ages must not come out negative.
  out.time_ns = std::min(out.time_ns, now_ns);
  return fresh ? IoStatus::kOk : IoStatus::kStale;
}

IoStatus IoDevice::write(std::uint64_t now_ns, const ForceCommand& command) noexcept RTBUS_NONBLOCKING {
  if (state_.load(std::memory_order_acquire) != LinkState::kRunning) return IoStatus::kLost;
  if (const std::uint32_t withheld = withheld_.load(std::memory_order_acquire); withheld != withheld_seen_) {
    withheld_seen_ = withheld;
    return IoStatus::kLost;
  }
  Force force{command.force_n, now_ns, withheld_seen_};
  // Not std::hypot of three: libstdc++'s gives 0 for (0, NaN, 0).
  const auto& [x, y, z] = force.force_n;
  const double norm = std::sqrt(x * x + y * y + z * z);
  const double limit_n = settings_.info.max_force_n;
  if (!std::isfinite(norm)) {
    force.force_n = {};
    bump(clamped_);
  } else if (norm > limit_n * (1.0 + 1e-9)) {
    for (double& each : force.force_n) each *= limit_n / norm;
    bump(clamped_);
  }
  forces_.put(force);
  return IoStatus::kOk;
}

LinkFigures IoDevice::figures() const noexcept {
  const auto get = [](const std::atomic<std::uint64_t>& cell) { return cell.load(std::memory_order_relaxed); };
  LinkFigures out;
  out.state = state_.load(std::memory_order_relaxed);
  out.protocol = {get(exchanges_), get(lost_frames_), get(bad_frames_),
                  get(resyncs_),   get(line_errors_), get(limited_)};
  out.losses = get(losses_);
  out.late_forces = get(late_forces_);
  out.timed_out = get(timed_out_);
  out.silences = get(silences_);
  out.withheld = withheld_.load(std::memory_order_relaxed);
  return out;
}

std::optional<rtbus::LinkStats> IoDevice::link_stats() const {
  const LinkFigures link = figures();
  const auto us = [](const rtbus::Histogram& histogram, double share) {
    return 1e-3 * static_cast<double>(histogram.percentile(share));
  };
  rtbus::LinkStats out;
  out.exchanges = link.protocol.exchanges;
  out.lost_frames = link.protocol.lost_frames;
  out.bad_frames = link.protocol.bad_frames;
  out.resyncs = link.protocol.resyncs;
  out.line_errors = link.protocol.line_errors;
  out.limited = link.protocol.clamped;
  out.silences = link.silences;
  out.late_forces = link.late_forces;
  out.timed_out = link.timed_out;
  out.withheld = link.withheld;
  out.losses = link.losses;
  out.sample_to_wire_p50_us = us(sample_to_wire_ns_, 0.5);
  out.sample_to_wire_p99_us = us(sample_to_wire_ns_, 0.99);
  out.period_p50_us = us(sample_period_ns_, 0.5);
  out.period_p99_us = us(sample_period_ns_, 0.99);
  out.state = static_cast<std::uint32_t>(link.state);
  return out;
}

}  // namespace drivers::usb
