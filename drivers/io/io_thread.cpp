// The I/O thread of an IoDevice: finds the device, brings it up, exchanges, and looks for it again when it is lost.
#include <algorithm>
#include <cstdio>
#include <utility>

#include "drivers/io/io_device.hpp"
#include "rtbus/clock.hpp"
#include "rtbus/realtime.hpp"

namespace drivers::io {

namespace {

constexpr std::uint64_t kFirstBackOffNs = 200 * rtbus::kNsPerMs;
constexpr std::uint64_t kLongestBackOffNs = 2 * rtbus::kNsPerS;
/// A device is silent only after so many exchanges without an answer, however long they took: this process may have
/// stood still itself.
constexpr int kSilentExchanges = 3;

}  // namespace

void IoDevice::run() noexcept {
  rtbus::name_this_thread(settings_.thread_name);
  const rtbus::ThreadScheduling ordinary;
  line_ = make_line_();
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
    port_.set_state(LinkState::kLost);
    if (problem != told) tell(problem + "; zero force, looking for it again");
    told = problem;
    if (stop_.sleep_until(rtbus::monotonic_ns() + back_off_ns_)) break;
    back_off_ns_ = std::min(2 * back_off_ns_, kLongestBackOffNs);
  }
  report_first(false, "stopped before the device was brought up");
  tell_figures();
  port_.set_state(LinkState::kStopped);
}

// The line is closed at the end, before anybody looks for the device again.
std::string IoDevice::connect_once() {
  if (const auto up = line_->connect(stop_); !up) return up.error().message;
  if (std::string news = line_->take_news(); !news.empty()) tell(news);
  // From here on a stop waits for the exchange in flight: a device that is left in the middle of one may lose step.
  stop_.hold_back(true);
  const std::uint64_t before = samples_;
  const Ended ended = stop_.raised() ? Ended::kStopping : exchange();
  line_->disconnect(ended != Ended::kLost);
  stop_.hold_back(false);
  publish_counters();
  if (ended == Ended::kStopping) return {};
  if (samples_ > before) {
    bump(losses_);
    back_off_ns_ = kFirstBackOffNs;
  }
  return ended == Ended::kFault ? line_->fault()
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
      "%s: %llu exchanges, %llu without answer, %llu bad frames, %llu line errors, %llu commands limited, %llu late "
      "forces, %llu timed out, %llu withheld, %llu losses; sample to wire "
      "p50 %.0f us, p99 %.0f us; period p50 %.0f us, p99 %.0f us",
      settings_.link_name, static_cast<unsigned long long>(link.protocol.exchanges),
      static_cast<unsigned long long>(link.silences), static_cast<unsigned long long>(link.protocol.bad_frames),
      static_cast<unsigned long long>(link.protocol.line_errors),
      static_cast<unsigned long long>(link.protocol.clamped), static_cast<unsigned long long>(link.late_forces),
      static_cast<unsigned long long>(link.timed_out), static_cast<unsigned long long>(link.withheld),
      static_cast<unsigned long long>(link.losses), us(sample_to_wire().percentile(0.5)),
      us(sample_to_wire().percentile(0.99)), us(sample_period().percentile(0.5)), us(sample_period().percentile(0.99)));
  tell(text);
}

IoDevice::Ended IoDevice::exchange() noexcept {
  last_send_ns_ = 0;
  link_silent_ = false;
  silent_exchanges_ = 0;
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
    switch (step()) {
      case ExchangeStatus::kSample:
        silent_exchanges_ = 0;
        break;
      case ExchangeStatus::kNothing:
        bump(silences_);
        link_silent_ = ++silent_exchanges_ >= kSilentExchanges &&
                       rtbus::seconds_between(last_answer_ns_, rtbus::monotonic_ns()) > settings_.lost_after_s;
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
    if (std::string news = line_->take_news(); !news.empty()) tell(news);
  }
  return Ended::kStopping;
}

ExchangeStatus IoDevice::step() noexcept {
  const auto failed = [](SendStatus status) {
    return status == SendStatus::kLost       ? ExchangeStatus::kLost
           : status == SendStatus::kStopping ? ExchangeStatus::kStopping
           : status == SendStatus::kFault    ? ExchangeStatus::kFault
                                             : ExchangeStatus::kNothing;
  };
  if (settings_.order == ExchangeOrder::kReceiveThenSend) {
    // Without a measurement the force still has to leave: the device's own time-out, and its zero, come from commands.
    const ExchangeStatus got = receive(sample_);
    if (got != ExchangeStatus::kSample && got != ExchangeStatus::kNothing) return got;
    if (got == ExchangeStatus::kSample) {
      publish(sample_);
      await_force();
    }
    const SendStatus sent = send();
    return sent == SendStatus::kSent ? got : failed(sent);
  }
  if (const SendStatus sent = send(); sent != SendStatus::kSent) return failed(sent);
  if (const ExchangeStatus got = receive(sample_); got != ExchangeStatus::kSample) return got;
  publish(sample_);
  await_force();
  if (settings_.order == ExchangeOrder::kFetchFirst && port_.paced() && port_.state() == LinkState::kRunning) {
    if (const SendStatus sent = send(); sent != SendStatus::kSent) return failed(sent);
    DeviceSample older;  // than the one that the next period fetches
    return receive(older);
  }
  return ExchangeStatus::kSample;
}

SendStatus IoDevice::send() noexcept {
  const std::uint64_t now_ns = rtbus::monotonic_ns();
  const LoopPort::Command command = port_.take_force(now_ns, last_answer_ns_);
  const double dt_s =
      last_send_ns_ == 0 ? 1e-9 * static_cast<double>(period_ns_) : rtbus::seconds_between(last_send_ns_, now_ns);
  last_send_ns_ = now_ns;
  const SendStatus status =
      line_->send(command.force_n, dt_s, command.live, now_ns + rtbus::ns_of(settings_.reply_timeout_s));
  if (command.live && line_->withheld()) port_.withhold();
  pushing_ = command.live && command.force_n != Vec3{} && !line_->withheld();
  if (status == SendStatus::kSent) port_.sent(rtbus::monotonic_ns());
  return status;
}

ExchangeStatus IoDevice::receive(DeviceSample& out) noexcept {
  const std::uint64_t now_ns = rtbus::monotonic_ns();
  std::uint64_t deadline_ns = now_ns + rtbus::ns_of(settings_.reply_timeout_s);
  // While the device pushes, nobody waits for it longer than the zero may take to get there.
  if (pushing_) deadline_ns = std::clamp(last_answer_ns_ + port_.answer_timeout_ns(), now_ns, deadline_ns);
  const ExchangeStatus got = line_->receive(out, deadline_ns);
  if (got != ExchangeStatus::kSample) return got;
  last_answer_ns_ = out.time_ns;
  // This process stood still with the answer waiting: where the hand was then says nothing about where it is.
  const std::uint64_t asked_ns = settings_.order == ExchangeOrder::kReceiveThenSend ? now_ns : last_send_ns_;
  const bool late = out.time_ns > asked_ns + 2 * rtbus::ns_of(settings_.reply_timeout_s);
  return late ? ExchangeStatus::kNothing : got;
}

void IoDevice::publish(const DeviceSample& sample) {
  const LinkState now = line_->readiness() == Readiness::kReady ? LinkState::kRunning : LinkState::kNotReady;
  const LinkState before = port_.state();
  if (now == LinkState::kRunning && before != now) take_priority();
  if (now == LinkState::kNotReady && before != now) port_.set_state(now);  // before a pose without meaning can be read
  ++samples_;
  port_.publish(sample);
  if (now == before) return;
  if (now == LinkState::kNotReady) {
    tell(line_->remedy());
  } else if (before == LinkState::kLost) {
    tell("the device is back");
  } else if (before == LinkState::kNotReady) {
    tell("the device is ready");
  }
  port_.set_state(now);  // rings
  report_first(true, {});
}

void IoDevice::await_force() noexcept {
  if (!port_.paced() || port_.state() != LinkState::kRunning) return;
  (void)port_.await_force(sample_.time_ns +
                          static_cast<std::uint64_t>(settings_.max_force_wait * static_cast<double>(period_ns_)));
}

void IoDevice::publish_counters() noexcept {
  const LinkCounters& counters = line_->counters();
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

}  // namespace drivers::io
