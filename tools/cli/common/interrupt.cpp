#include "tools/cli/common/interrupt.hpp"

#include <signal.h>

#include <algorithm>
#include <atomic>

#include "rtbus/clock.hpp"

namespace tools {

namespace {

std::atomic<int> g_count{0};
std::atomic<int> g_signal{0};
static_assert(std::atomic<int>::is_always_lock_free, "written by a signal handler");

void on_signal(int number) {
  g_signal.store(number, std::memory_order_relaxed);
  g_count.fetch_add(1, std::memory_order_relaxed);
}

}  // namespace

void catch_interrupts() noexcept {
  struct sigaction action {};
  action.sa_handler = &on_signal;
  sigemptyset(&action.sa_mask);
  sigaction(SIGINT, &action, nullptr);
  sigaction(SIGTERM, &action, nullptr);
  signal(SIGCHLD, SIG_DFL);  // a parent that ignores it would hide from us that a node has ended
  struct sigaction hangup {};
  // nohup(1) has it ignored, and means it.
  if (sigaction(SIGHUP, nullptr, &hangup) == 0 && hangup.sa_handler != SIG_IGN) sigaction(SIGHUP, &action, nullptr);
}

bool interrupted() noexcept { return interrupt_count() > 0; }
int interrupt_count() noexcept { return g_count.load(std::memory_order_relaxed); }
int interrupt_signal() noexcept { return g_signal.load(std::memory_order_relaxed); }

bool sleep_unless_interrupted(std::uint64_t duration_ns) noexcept {
  // Slices, because a signal that another thread received, or that came just before the sleep, does not shorten it.
  constexpr std::uint64_t kSlice_ns = 50 * rtbus::kNsPerMs;
  const std::uint64_t end_ns = rtbus::monotonic_ns() + duration_ns;
  for (std::uint64_t now_ns = rtbus::monotonic_ns(); now_ns < end_ns; now_ns = rtbus::monotonic_ns()) {
    if (interrupted()) return false;
    rtbus::sleep_until(std::min(end_ns, now_ns + kSlice_ns));
  }
  return !interrupted();
}

}  // namespace tools
