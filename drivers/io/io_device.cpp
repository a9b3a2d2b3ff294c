#include "drivers/io/io_device.hpp"

#include <condition_variable>
#include <utility>

#include "rtbus/clock.hpp"

namespace drivers::io {

/// Where start() waits for the outcome of the first attempt.
struct IoDevice::First {
  std::mutex mutex;
  std::condition_variable changed;
  bool done = false;
  bool ok = false;
  std::string message;
};

IoDevice::IoDevice(IoSettings settings, IoThread thread, LineFactory line)
    : settings_(std::move(settings)),
      place_(thread),
      make_line_(std::move(line)),
      period_ns_(rtbus::ns_of(1.0 / settings_.info.sample_rate_hz)),
      port_(settings_.info) {}

rtbus::Result<void, DeviceFault> IoDevice::start(std::uint64_t) {
  stop();
  stop_.lower();
  stop_.hold_back(false);
  for (auto* counter : {&losses_, &silences_}) counter->store(0);
  samples_ = 0;
  port_.reset();
  {
    const std::lock_guard lock(mutex_);
    notice_.clear();
  }
  port_.set_state(LinkState::kOpening);

  First first;
  first_ = &first;
  thread_ = std::thread([this] { run(); });
  std::unique_lock lock(first.mutex);
  first.changed.wait(lock, [&] { return first.done; });
  if (first.ok) return {};
  lock.unlock();
  thread_.join();
  port_.set_state(LinkState::kStopped);
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

void IoDevice::tell(const std::string& text) {
  const std::lock_guard lock(mutex_);
  if (!notice_.empty()) notice_ += "; then: ";
  notice_ += text;
}

std::string IoDevice::take_notice() {
  const std::lock_guard lock(mutex_);
  return std::exchange(notice_, {});
}

LinkFigures IoDevice::figures() const noexcept {
  const auto get = [](const std::atomic<std::uint64_t>& cell) { return cell.load(std::memory_order_relaxed); };
  const rtbus::LinkStats port = port_.stats();
  LinkFigures out;
  out.state = static_cast<LinkState>(port.state);
  out.protocol = {get(exchanges_), get(lost_frames_), get(bad_frames_),
                  get(resyncs_),   get(line_errors_), get(limited_)};
  out.losses = get(losses_);
  out.late_forces = port.late_forces;
  out.timed_out = port.timed_out;
  out.silences = get(silences_);
  out.withheld = port.withheld;
  return out;
}

std::optional<rtbus::LinkStats> IoDevice::link_stats() const {
  const LinkFigures link = figures();
  rtbus::LinkStats out = port_.stats();
  out.exchanges = link.protocol.exchanges;
  out.lost_frames = link.protocol.lost_frames;
  out.bad_frames = link.protocol.bad_frames;
  out.resyncs = link.protocol.resyncs;
  out.line_errors = link.protocol.line_errors;
  out.limited = link.protocol.clamped;
  out.silences = link.silences;
  out.losses = link.losses;
  return out;
}

}  // namespace drivers::io
