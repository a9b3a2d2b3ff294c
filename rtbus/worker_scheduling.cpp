#include "rtbus/worker_scheduling.hpp"

#include <pthread.h>
#include <sched.h>
#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>

#include "rtbus/clock.hpp"

namespace rtbus {
namespace {

/// The flag keeps threads that the worker starts from inheriting the priority.
bool set_policy(pid_t thread, int policy, int priority) noexcept {
  sched_param parameters{};
  parameters.sched_priority = priority;
  return ::sched_setscheduler(thread, policy | SCHED_RESET_ON_FORK, &parameters) == 0;
}

}  // namespace

void RestAccount::add(double wall_s, double cpu_s) noexcept {
  saved_s_ = std::clamp(saved_s_ + kShare * wall_s - cpu_s, 0.0, kMost_s);
  if (saved_s_ == kMost_s) rests_ = true;
  if (saved_s_ == 0.0) rests_ = false;
}

void WorkerScheduling::enter() noexcept {
  // The nice value stays with the thread, and holds whenever it is not SCHED_FIFO.
  nice_ = ::setpriority(PRIO_PROCESS, 0, kWorkerNice) == 0;
  if (::pthread_getcpuclockid(::pthread_self(), &cpu_clock_) != 0) return;
  worker_.store(::gettid(), std::memory_order_release);
}

std::string WorkerScheduling::summary() const {
  if (fifo_) return "SCHED_FIFO " + std::to_string(kWorkerPriority);
  const bool granted = worker_.load(std::memory_order_acquire) != 0 && nice_;
  return granted ? "nice " + std::to_string(kWorkerNice) : "no priority";
}

void WorkerScheduling::watch() noexcept {
  const pid_t worker = worker_.load(std::memory_order_acquire);
  timespec computed{};
  if (worker == 0 || ::clock_gettime(cpu_clock_, &computed) != 0) return;
  const std::uint64_t now_ns = monotonic_ns();
  const std::uint64_t computed_ns =
      static_cast<std::uint64_t>(computed.tv_sec) * kNsPerS + static_cast<std::uint64_t>(computed.tv_nsec);
  if (seen_ns_ != 0) account_.add(seconds_between(seen_ns_, now_ns), seconds_between(computed_ns_, computed_ns));
  seen_ns_ = now_ns;
  computed_ns_ = computed_ns;
  if (account_.rests() == fifo_) return;
  // Where it may not have the priority, it is asked for again at each look: a limit may be raised.
  const bool done = fifo_ ? set_policy(worker, SCHED_OTHER, 0) : set_policy(worker, SCHED_FIFO, kWorkerPriority);
  if (done) fifo_ = !fifo_;
}

}  // namespace rtbus
