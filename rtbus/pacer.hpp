#pragma once
/// @file pacer.hpp
/// Deadlines of a periodic loop, and an honest count of those it missed.
#include <cstdint>

#include "rtbus/realtime.hpp"

namespace rtbus {

/// Deadlines lie at start + k·period. A cycle that ends after later deadlines have passed skips them: they are counted
/// as overruns, never caught up, so that a pause of the machine does not end in a burst of cycles. Always: due = served
/// + overruns. @realtime Yes, all of it.
class Pacer {
 public:
  Pacer(std::uint64_t start_ns, std::uint64_t period_ns) noexcept
      : period_ns_(period_ns), due_ns_(start_ns + period_ns) {}

  /// Deadline of the cycle to come (or that is running).
  [[nodiscard]] std::uint64_t due_ns() const noexcept { return due_ns_; }
  [[nodiscard]] std::uint64_t period_ns() const noexcept { return period_ns_; }

  /// The cycle of due_ns() is over at `now_ns`: moves on to the first deadline still ahead. @returns the deadlines
  /// skipped.
  std::uint64_t advance(std::uint64_t now_ns) noexcept RTBUS_NONBLOCKING {
    ++served_;
    due_ns_ += period_ns_;
    if (now_ns < due_ns_) return 0;
    const std::uint64_t skipped = (now_ns - due_ns_) / period_ns_ + 1;
    due_ns_ += skipped * period_ns_;
    overruns_ += skipped;
    return skipped;
  }

  [[nodiscard]] std::uint64_t served() const noexcept { return served_; }
  [[nodiscard]] std::uint64_t overruns() const noexcept { return overruns_; }
  [[nodiscard]] std::uint64_t due() const noexcept { return served_ + overruns_; }

 private:
  std::uint64_t period_ns_;
  std::uint64_t due_ns_;
  std::uint64_t served_ = 0;
  std::uint64_t overruns_ = 0;
};

}  // namespace rtbus
