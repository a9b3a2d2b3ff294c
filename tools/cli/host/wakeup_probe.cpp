#include "tools/cli/host/wakeup_probe.hpp"

#include <sys/mman.h>

#include <algorithm>
#include <atomic>
#include <memory>
#include <thread>

#include "rtbus/clock.hpp"
#include "rtbus/histogram.hpp"
#include "rtbus/pacer.hpp"
#include "tools/cli/common/interrupt.hpp"

namespace tools {

WakeupFigures probe_wakeup(const WakeupOptions& options, const std::function<void(double)>& progress) {
  WakeupFigures figures;
  auto latencies = std::make_unique<rtbus::Histogram>();
  std::atomic<bool> done{false};
  const std::uint64_t begin_ns = rtbus::monotonic_ns();
  const auto duration_ns = static_cast<std::uint64_t>(options.duration_s * 1e9);
  std::thread thread([&] {
    rtbus::name_this_thread("wakeup_probe");
    figures.grant = rtbus::enter_realtime(options.request);
    const std::uint64_t start_ns = rtbus::monotonic_ns();
    rtbus::Pacer pacer(start_ns, static_cast<std::uint64_t>(1e9 / options.rate_hz));
    while (pacer.due_ns() <= start_ns + duration_ns && !interrupted()) {
      rtbus::sleep_until(pacer.due_ns());
      const std::uint64_t now_ns = rtbus::monotonic_ns();
      latencies->record(now_ns > pacer.due_ns() ? now_ns - pacer.due_ns() : 0);
      pacer.advance(rtbus::monotonic_ns());
    }
    figures.due = pacer.due();
    figures.served = pacer.served();
    figures.overruns = pacer.overruns();
    done.store(true, std::memory_order_release);
  });
  while (!done.load(std::memory_order_acquire)) {
    if (progress) progress(std::min(1.0, rtbus::seconds_between(begin_ns, rtbus::monotonic_ns()) / options.duration_s));
    rtbus::sleep_until(rtbus::monotonic_ns() + 100 * rtbus::kNsPerMs);
  }
  thread.join();
  if (figures.grant.memory_locked) ::munlockall();
  rtbus::leave_realtime();
  const auto us = [&](double p) { return static_cast<double>(latencies->percentile(p)) * 1e-3; };
  figures.p50_us = us(0.5);
  figures.p99_us = us(0.99);
  figures.p999_us = us(0.999);
  figures.max_us = static_cast<double>(latencies->max()) * 1e-3;
  return figures;
}

}  // namespace tools
