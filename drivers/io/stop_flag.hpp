#pragma once
/// @file stop_flag.hpp
/// Ends the blocking calls of a Channel from another thread.
#include <atomic>
#include <cstdint>
#include <functional>
#include <mutex>
#include <utility>

namespace drivers::io {

/// Raised by whoever stops a driver; asked by the Channel in every wait. While held back (an exchange is in flight, or
/// the zero force of shut_down() still has to leave) blocking calls go on to their own deadlines.
/// Threads: raise() any; everything else the I/O thread.
class StopFlag {
 public:
  /// @realtime No: it takes a lock and makes a system call to end a wait.
  void raise();
  /// For another start(). Nobody may be waiting.
  void lower() noexcept { word_.store(0); }

  [[nodiscard]] bool raised() const noexcept { return word_.load(std::memory_order_acquire) != 0; }
  /// Raised and not held back: give up waiting now.
  [[nodiscard]] bool ends_waits() const noexcept { return !held_back_.load(std::memory_order_relaxed) && raised(); }
  void hold_back(bool on) noexcept { held_back_.store(on, std::memory_order_relaxed); }

  /// Sleeps until then or until raised. @returns true when the flag ended it.
  bool sleep_until(std::uint64_t deadline_ns) const noexcept;

  /// What ends a wait that does not sleep on this flag (libusb's). Called by raise(); empty: nothing.
  void set_waker(std::function<void()> waker) {
    const std::lock_guard lock(mutex_);
    waker_ = std::move(waker);
  }

 private:
  std::atomic<std::uint32_t> word_{0};  ///< Also the futex of sleep_until().
  std::atomic<bool> held_back_{false};
  std::mutex mutex_;
  std::function<void()> waker_;
};

}  // namespace drivers::io
