#include "drivers/usb/io_device.hpp"

#include <algorithm>
#include <cmath>
#include <condition_variable>
#include <cstdio>
#include <utility>

#include "drivers/usb/futex.hpp"
#include "rtbus/clock.hpp"
#include "rtbus/realtime.hpp"

namespace drivers::usb {

namespace {

constexpr std::uint64_t kFirstBackOffNs = 200 * rtbus::kNsPerMs;
constexpr std::uint64_t kLongestBackOffNs = 2 * rtbus::kNsPerS;
/// A loop that has not asked to be paced for so long runs by its own timer.
constexpr std::uint64_t kPacedForNs = 50 * rtbus::kNsPerMs;

std::uint64_t nanoseconds(double seconds) { return static_cast<std::uint64_t>(std::llround(seconds * 1e9)); }

// One writer each: a relaxed load and store is enough.
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
      force_timeout_ns_(nanoseconds(settings_.info.force_timeout_s)) {}

rtbus::Result<void, DeviceFault> IoDevice::start(std::uint64_t) {
  stop();
  stop_.lower();
  stop_.hold_back(false);
  clamped_.store(0);
  for (auto* counter : {&losses_, &late_forces_, &timed_out_, &silences_}) counter->store(0);
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
  Force force{command.force_n, now_ns};
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

// --- The I/O thread -------------------------------------------------------------------------------------------------

void IoDevice::run() noexcept {
  rtbus::name_this_thread("usb_io");
  // Memory and CPU latency are asked for by the loop, for the whole process.
  (void)rtbus::enter_realtime(
      {.priority = place_.priority, .core = place_.core, .lock_memory = false, .hold_dma_latency = false});
  protocol_ = make_protocol_();
  std::uint64_t back_off_ns = kFirstBackOffNs;
  std::string told;
  while (!stop_.raised()) {
    auto channel = open_(stop_);
    std::string problem = channel ? std::string() : channel.error().message;
    if (channel) {
      if (const auto up = protocol_->bring_up(**channel); !up) problem = up.error().message;
    }
    if (problem.empty() && !stop_.raised()) {
      told.clear();
      // From here on a stop waits for the exchange in flight: a device that is left in the middle of one may lose step.
      stop_.hold_back(true);
      const std::uint64_t before = sample_number_;
      const Ended ended = exchange(**channel);
      if (ended != Ended::kLost) protocol_->shut_down(**channel);
      stop_.hold_back(false);
      publish_counters();
      if (ended == Ended::kStopping) break;
      problem = ended == Ended::kFault ? protocol_->fault()
                : link_silent_         ? "the device does not answer any more; check its power and cable"
                                       : "the device was unplugged";
      if (sample_number_ > before) {
        bump(losses_);
        back_off_ns = kFirstBackOffNs;
      }
    }
    channel = rtbus::Failure{DeviceFault{}};  // closed before anybody looks for it again
    if (stop_.raised()) break;
    if (first_ != nullptr) {
      report_first(false, problem);
      return;
    }
    set_state(LinkState::kLost);
    if (problem != told) tell(problem + "; zero force, looking for it again");
    told = problem;
    if (stop_.sleep_until(rtbus::monotonic_ns() + back_off_ns)) break;
    back_off_ns = std::min(2 * back_off_ns, kLongestBackOffNs);
  }
  report_first(false, "stopped before the device was brought up");
  tell_figures();
  set_state(LinkState::kStopped);
}

void IoDevice::tell_figures() {
  const LinkFigures link = figures();
  if (link.protocol.exchanges == 0) return;
  const auto us = [](std::uint64_t ns) { return 1e-3 * static_cast<double>(ns); };
  char text[400];
  std::snprintf(
      text, sizeof text,
      "USB: %llu exchanges, %llu without answer, %llu bad frames, %llu line errors, %llu commands limited, %llu late "
      "forces, %llu timed out, %llu losses; sample to wire "
      "p50 %.0f us, p99 %.0f us; period p50 %.0f us, p99 %.0f us",
      static_cast<unsigned long long>(link.protocol.exchanges), static_cast<unsigned long long>(link.silences),
      static_cast<unsigned long long>(link.protocol.bad_frames),
      static_cast<unsigned long long>(link.protocol.line_errors),
      static_cast<unsigned long long>(link.protocol.clamped), static_cast<unsigned long long>(link.late_forces),
      static_cast<unsigned long long>(link.timed_out), static_cast<unsigned long long>(link.losses),
      us(sample_to_wire_ns_.percentile(0.5)), us(sample_to_wire_ns_.percentile(0.99)),
      us(sample_period_ns_.percentile(0.5)), us(sample_period_ns_.percentile(0.99)));
  tell(text);
}

IoDevice::Ended IoDevice::exchange(Channel& channel) noexcept {
  last_send_ns_ = 0;
  link_silent_ = false;
  last_answer_ns_ = rtbus::monotonic_ns();
  std::uint64_t due_ns = last_answer_ns_;
  while (!stop_.raised()) {
    // A late exchange re-arms the deadline; what was missed is not caught up.
    if (const std::uint64_t now_ns = rtbus::monotonic_ns(); now_ns < due_ns) {
      if (stop_.sleep_until(due_ns)) break;
    } else {
      due_ns = now_ns;
    }
    due_ns += settings_.device_paces ? period_ns_ / 2 : period_ns_;
    switch (step(channel)) {
      case ExchangeStatus::kSample:
        break;
      case ExchangeStatus::kNothing:
        bump(silences_);
        link_silent_ = rtbus::seconds_between(last_answer_ns_, rtbus::monotonic_ns()) > settings_.lost_after_s;
        if (link_silent_) return Ended::kLost;
        break;
      case ExchangeStatus::kFault:
        return Ended::kFault;
      case ExchangeStatus::kLost:
        return Ended::kLost;
      case ExchangeStatus::kStopping:
        return Ended::kStopping;
    }
    publish_counters();
  }
  return Ended::kStopping;
}

ExchangeStatus IoDevice::step(Channel& channel) noexcept {
  const auto failed = [](UsbStatus status) {
    return status == UsbStatus::kLost       ? ExchangeStatus::kLost
           : status == UsbStatus::kStopping ? ExchangeStatus::kStopping
                                            : ExchangeStatus::kNothing;
  };
  if (const UsbStatus sent = send(channel); sent != UsbStatus::kOk) return failed(sent);
  DeviceSample sample;
  if (const ExchangeStatus got = receive(channel, sample); got != ExchangeStatus::kSample) return got;
  publish(sample);

  const bool paced = sample.time_ns < last_wait_ns_.load(std::memory_order_relaxed) + kPacedForNs;
  if (!paced || state_.load(std::memory_order_relaxed) != LinkState::kRunning) return ExchangeStatus::kSample;
  await_force(sample_number_,
              sample.time_ns + static_cast<std::uint64_t>(settings_.max_force_wait * static_cast<double>(period_ns_)));
  if (settings_.fetch_first) {
    if (const UsbStatus sent = send(channel); sent != UsbStatus::kOk) return failed(sent);
    return receive(channel, sample);  // its pose is older than the one that the next period fetches
  }
  return ExchangeStatus::kSample;
}

UsbStatus IoDevice::send(Channel& channel) noexcept {
  const std::uint64_t now_ns = channel.now_ns();
  (void)forces_.take(force_);
  Vec3 force_n{};
  bool live = false;
  if (state_.load(std::memory_order_relaxed) == LinkState::kRunning) {
    const bool written = force_.time_ns > running_since_ns_ && now_ns <= force_.time_ns + force_timeout_ns_;
    const bool answering = now_ns <= last_answer_ns_ + force_timeout_ns_;
    live = written && answering;
    if (live) {
      force_n = force_.force_n;
    } else if (force_.time_ns != 0) {
      bump(timed_out_);
    }
  }
  const double dt_s =
      last_send_ns_ == 0 ? 1e-9 * static_cast<double>(period_ns_) : rtbus::seconds_between(last_send_ns_, now_ns);
  last_send_ns_ = now_ns;
  protocol_->set_live(live);
  const UsbStatus status = protocol_->send(channel, force_n, dt_s, now_ns + nanoseconds(settings_.reply_timeout_s));
  // The force that answers a sample leaves once; a repetition says nothing about the delay.
  if (status == UsbStatus::kOk && awaited_ns_ != 0) sample_to_wire_ns_.record(channel.now_ns() - awaited_ns_);
  awaited_ns_ = 0;
  return status;
}

ExchangeStatus IoDevice::receive(Channel& channel, DeviceSample& out) noexcept {
  const ExchangeStatus got =
      protocol_->receive(channel, out, channel.now_ns() + nanoseconds(settings_.reply_timeout_s));
  if (got != ExchangeStatus::kSample) return got;
  last_answer_ns_ = out.time_ns;
  // This process stood still with the answer waiting: where the hand was then says nothing about where it is.
  const bool late = out.time_ns > last_send_ns_ + 2 * nanoseconds(settings_.reply_timeout_s);
  return late ? ExchangeStatus::kNothing : got;
}

void IoDevice::publish(const DeviceSample& sample) noexcept {
  if (last_published_ns_ != 0 && sample.time_ns > last_published_ns_) {
    sample_period_ns_.record(sample.time_ns - last_published_ns_);
  }
  last_published_ns_ = sample.time_ns;
  const LinkState now = protocol_->readiness() == Readiness::kReady ? LinkState::kRunning : LinkState::kNotReady;
  const LinkState before = state_.load(std::memory_order_relaxed);
  if (now == LinkState::kRunning && before != now) running_since_ns_ = rtbus::monotonic_ns();
  if (now == LinkState::kNotReady && before != now) set_state(now);  // before a pose without meaning can be read
  samples_.put({sample, ++sample_number_});
  newest_sample_.store(sample_number_, std::memory_order_seq_cst);

  if (now != before) {
    if (now == LinkState::kNotReady) {
      tell(protocol_->remedy());
    } else if (before == LinkState::kLost) {
      tell("the device is back");
    } else if (before == LinkState::kNotReady) {
      tell("the device is ready");
    }
    set_state(now);  // rings
    report_first(true, {});
    return;
  }
  sample_bell_.fetch_add(1, std::memory_order_seq_cst);
  if (loop_waits_.load(std::memory_order_seq_cst)) futex_wake(sample_bell_);
}

void IoDevice::await_force(std::uint64_t number, std::uint64_t deadline_ns) noexcept {
  io_waits_.store(true, std::memory_order_seq_cst);
  for (;;) {
    const std::uint32_t seen = force_bell_.load(std::memory_order_seq_cst);
    if (answered_.load(std::memory_order_seq_cst) >= number) {
      awaited_ns_ = last_published_ns_;
      break;
    }
    if (rtbus::monotonic_ns() >= deadline_ns) {
      bump(late_forces_);
      break;
    }
    futex_wait(force_bell_, seen, deadline_ns);
  }
  io_waits_.store(false, std::memory_order_relaxed);
}

void IoDevice::publish_counters() noexcept {
  const LinkCounters& counters = protocol_->counters();
  const auto set = [](std::atomic<std::uint64_t>& cell, std::uint64_t value) {
    cell.store(value, std::memory_order_relaxed);
  };
  set(exchanges_, counters.exchanges);
  set(lost_frames_, counters.lost_frames);
  set(bad_frames_, counters.bad_frames);
  set(resyncs_, counters.resyncs);
  set(line_errors_, counters.line_errors);
  set(limited_, counters.clamped);
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
  return out;
}

}  // namespace drivers::usb
