#include "drivers/io/stop_flag.hpp"

#include "drivers/io/futex.hpp"

namespace drivers::io {

void StopFlag::raise() {
  word_.store(1, std::memory_order_seq_cst);
  futex_wake(word_);
  const std::lock_guard lock(mutex_);
  if (waker_) waker_();
}

bool StopFlag::sleep_until(std::uint64_t deadline_ns) const noexcept {
  // Held back, it is an ordinary sleep.
  if (held_back_.load(std::memory_order_relaxed)) {
    rtbus::sleep_until(deadline_ns);
    return false;
  }
  while (!raised()) {
    if (rtbus::monotonic_ns() >= deadline_ns) return false;
    futex_wait(word_, 0, deadline_ns);
  }
  return true;
}

}  // namespace drivers::io
