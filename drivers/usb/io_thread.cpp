// The I/O thread of an IoDevice: finds the device, brings it up, exchanges, and looks for it again when it is lost.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <utility>

#include "drivers/usb/futex.hpp"
#include "drivers/usb/io_device.hpp"
#include "rtbus/clock.hpp"
#include "rtbus/realtime.hpp"

namespace drivers::usb {

namespace {

constexpr std::uint64_t kFirstBackOffNs = 200 * rtbus::kNsPerMs;
constexpr std::uint64_t kLongestBackOffNs = 2 * rtbus::kNsPerS;
/// A loop that has not asked to be paced for so long runs by its own timer.
constexpr std::uint64_t kPacedForNs = 50 * rtbus::kNsPerMs;

std::uint64_t nanoseconds(double seconds) { return static_cast<std::uint64_t>(std::llround(seconds * 1e9)); }

// This thread's alone: a relaxed load and store is enough.
void bump(std::atomic<std::uint64_t>& counter) noexcept {
  counter.store(counter.load(std::memory_order_relaxed) + 1, std::memory_order_relaxed);
}

}  // namespace

void IoDevice::run() noexcept {
  rtbus::name_this_thread("usb_io");
  const rtbus::ThreadScheduling ordinary;
  protocol_ = make_protocol_();
  back_off_ns_ = kFirstBackOffNs;
  std::string told;
  while (!stop_.raised()) {
    const std::string problem = connect_once();
    if (std::exchange(realtime_, false)) ordinary.restore();
    if (stop_.raised()) break;
    if (first_ != nullptr) {
      report_first(false, problem);
      return;
    }
    set_state(LinkState::kLost);
    if (problem != told) tell(problem + "; zero force, looking for it again");
    told = problem;
    if (stop_.sleep_until(rtbus::monotonic_ns() + back_off_ns_)) break;
    back_off_ns_ = std::min(2 * back_off_ns_, kLongestBackOffNs);
  }
  report_first(false, "stopped before the device was brought up");
  tell_figures();
  set_state(LinkState::kStopped);
}

// The channel is closed at the end, before anybody looks for the device again.
std::string IoDevice::connect_once() {
  auto channel = open_(stop_);
  if (!channel) return channel.error().message;
  if (const auto up = protocol_->bring_up(**channel); !up) return up.error().message;
  if (stop_.raised()) return {};
  // From here on a stop waits for the exchange in flight: a device that is left in the middle of one may lose step.
  stop_.hold_back(true);
  const std::uint64_t before = sample_number_;
  const Ended ended = exchange(**channel);
  if (ended != Ended::kLost) protocol_->shut_down(**channel);
  stop_.hold_back(false);
  publish_counters();
  if (ended == Ended::kStopping) return {};
  if (sample_number_ > before) {
    bump(losses_);
    back_off_ns_ = kFirstBackOffNs;
  }
  return ended == Ended::kFault ? protocol_->fault()
         : link_silent_         ? "the device does not answer any more; check its power and cable"
                                : "the device was unplugged";
}

// Firmware and homing take seconds and may fail for ever: all that needs no priority, and must not have the loop's
// core.
void IoDevice::take_priority() noexcept {
  if (std::exchange(realtime_, true)) return;
  // Memory and CPU latency are asked for by the loop, for the whole process.
  (void)rtbus::enter_realtime(
      {.priority = place_.priority, .core = place_.core, .lock_memory = false, .hold_dma_latency = false});
}

void IoDevice::tell_figures() {
  const LinkFigures link = figures();
  if (link.protocol.exchanges == 0) return;
  const auto us = [](std::uint64_t ns) { return 1e-3 * static_cast<double>(ns); };
  char text[400];
  std::snprintf(
      text, sizeof text,
      "USB: %llu exchanges, %llu without answer, %llu bad frames, %llu line errors, %llu commands limited, %llu late "
      "forces, %llu timed out, %llu withheld, %llu losses; sample to wire "
      "p50 %.0f us, p99 %.0f us; period p50 %.0f us, p99 %.0f us",
      static_cast<unsigned long long>(link.protocol.exchanges), static_cast<unsigned long long>(link.silences),
      static_cast<unsigned long long>(link.protocol.bad_frames),
      static_cast<unsigned long long>(link.protocol.line_errors),
      static_cast<unsigned long long>(link.protocol.clamped), static_cast<unsigned long long>(link.late_forces),
      static_cast<unsigned long long>(link.timed_out), static_cast<unsigned long long>(link.withheld),
      static_cast<unsigned long long>(link.losses), us(sample_to_wire_ns_.percentile(0.5)),
      us(sample_to_wire_ns_.percentile(0.99)), us(sample_period_ns_.percentile(0.5)),
      us(sample_period_ns_.percentile(0.99)));
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
    const bool known = force_.withheld == withheld_.load(std::memory_order_relaxed);  // to the loop: the last zero
    const bool written = force_.time_ns > running_since_ns_ && now_ns <= force_.time_ns + force_timeout_ns_;
    const bool answering = now_ns <= last_answer_ns_ + answer_timeout_ns_;
    live = known && written && answering;
    if (live) {
      force_n = force_.force_n;
    } else if (known && force_.time_ns != 0) {
      bump(timed_out_);
      // Where the loop is late it begins anew by itself.
      if (written && force_.force_n != Vec3{}) withheld_.fetch_add(1, std::memory_order_release);
    }
  }
  const double dt_s =
      last_send_ns_ == 0 ? 1e-9 * static_cast<double>(period_ns_) : rtbus::seconds_between(last_send_ns_, now_ns);
  last_send_ns_ = now_ns;
  protocol_->set_live(live);
  const UsbStatus status = protocol_->send(channel, force_n, dt_s, now_ns + nanoseconds(settings_.reply_timeout_s));
  if (live && protocol_->withheld()) withheld_.fetch_add(1, std::memory_order_release);
  pushing_ = live && force_n != Vec3{} && !protocol_->withheld();
  // The force that answers a sample leaves once; a repetition says nothing about the delay.
  if (status == UsbStatus::kOk && awaited_ns_ != 0) sample_to_wire_ns_.record(channel.now_ns() - awaited_ns_);
  awaited_ns_ = 0;
  return status;
}

ExchangeStatus IoDevice::receive(Channel& channel, DeviceSample& out) noexcept {
  const std::uint64_t now_ns = channel.now_ns();
  std::uint64_t deadline_ns = now_ns + nanoseconds(settings_.reply_timeout_s);
  // While the device pushes, nobody waits for it longer than the zero may take to get there.
  if (pushing_) deadline_ns = std::clamp(last_answer_ns_ + answer_timeout_ns_, now_ns, deadline_ns);
  const ExchangeStatus got = protocol_->receive(channel, out, deadline_ns);
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
  if (now == LinkState::kRunning && before != now) {
    take_priority();
    running_since_ns_ = rtbus::monotonic_ns();
  }
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

}  // namespace drivers::usb
