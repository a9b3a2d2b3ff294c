#include "tools/cli/host/bare_loop.hpp"

#include "rtbus/clock.hpp"

namespace tools {

namespace {

/// The first deadline that lies half a period beside the haptic loop's and a little ahead, so that the thread is up by
/// then and its own start is no overrun.
std::uint64_t first_start_ns(const BareLoopOptions& options) {
  const std::uint64_t ready_ns = rtbus::monotonic_ns() + 20 * rtbus::kNsPerMs;
  const std::uint64_t phase_ns = (options.phase_ns + options.period_ns / 2) % options.period_ns;
  return ready_ns - ready_ns % options.period_ns + phase_ns;
}

}  // namespace

BareLoop::BareLoop(const BareLoopOptions& options)
    : options_(options), pacer_(first_start_ns(options), options.period_ns), thread_([this] { run(); }) {}

void BareLoop::stop() noexcept {
  stop_.store(true, std::memory_order_relaxed);
  if (thread_.joinable()) thread_.join();
}

BareLoopFigures BareLoop::figures(const std::string& beside, double rate_hz) const {
  const auto us = [](std::uint64_t ns) { return static_cast<double>(ns) * 1e-3; };
  BareLoopFigures out;
  out.beside = beside;
  out.rate_hz = rate_hz;
  out.scheduling = grant_.scheduling();
  out.granted = grant_.summary();
  out.ticks = pacer_.served();
  out.due = pacer_.due();
  out.overruns = pacer_.overruns();
  out.wakeup_p50_us = us(wakeup_ns_.percentile(0.50));
  out.wakeup_p99_us = us(wakeup_ns_.percentile(0.99));
  out.wakeup_p999_us = us(wakeup_ns_.percentile(0.999));
  out.wakeup_max_us = us(wakeup_ns_.max());
  return out;
}

void BareLoop::run() noexcept {
  rtbus::name_this_thread("bare_loop");
  // Memory is not locked: that would pin the whole tool for the sake of one page of stack, which is touched all the
  // time. The latency of deep CPU sleep is the haptic node's to hold or not; it acts on the whole machine.
  grant_ = rtbus::enter_realtime(
      {.priority = options_.priority, .core = options_.core, .lock_memory = false, .hold_dma_latency = false});
  while (!stop_.load(std::memory_order_relaxed)) {
    const std::uint64_t due_ns = pacer_.due_ns();
    rtbus::sleep_until(due_ns);
    const std::uint64_t now_ns = rtbus::monotonic_ns();
    wakeup_ns_.record(now_ns > due_ns ? now_ns - due_ns : 0);
    pacer_.advance(rtbus::monotonic_ns());
  }
}

}  // namespace tools
