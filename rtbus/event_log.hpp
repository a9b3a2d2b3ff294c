#pragma once
/// @file event_log.hpp
/// Fixed-size records out of one realtime thread, drained by another that may format, log and wait.
#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>

#include "rtbus/realtime.hpp"

namespace rtbus {

/// One thing that happened. The node defines its codes and turns them into sentences when it drains.
struct Event {
  std::uint64_t stamp_ns = 0;      ///< CLOCK_MONOTONIC.
  std::int32_t code = 0;           ///< An enumerator of the node.
  std::array<double, 3> values{};  ///< Up to three figures; what they are depends on the code.
};

/// Single producer, single consumer. When it is full the newest event is dropped and counted: the producer never waits.
class EventLog {
 public:
  /// Allocates `capacity` records, rounded up to a power of two. @realtime No.
  explicit EventLog(std::size_t capacity = 256);

  /// Producer's side. @realtime Yes, wait-free. @return false when it was dropped.
  bool push(std::uint64_t stamp_ns, std::int32_t code, double a = 0.0, double b = 0.0,
            double c = 0.0) noexcept RTBUS_NONBLOCKING {
    const std::uint64_t head = head_.load(std::memory_order_relaxed);
    // Acquire: the consumer has finished with the cell before it is filled anew.
    if (head - tail_.load(std::memory_order_acquire) > mask_) {
      dropped_.store(dropped_.load(std::memory_order_relaxed) + 1, std::memory_order_relaxed);  // one producer: no RMW
      return false;
    }
    cells_[head & mask_] = Event{stamp_ns, code, {a, b, c}};
    head_.store(head + 1, std::memory_order_release);  // publishes the cell
    return true;
  }

  /// Consumer's side: hands over everything that is there, oldest first. @realtime No. @return how many.
  std::size_t drain(const std::function<void(const Event&)>& sink);

  /// Events that found no room since construction. Any thread.
  [[nodiscard]] std::uint64_t dropped() const noexcept { return dropped_.load(std::memory_order_relaxed); }

 private:
  std::uint64_t mask_;
  std::unique_ptr<Event[]> cells_;
  alignas(64) std::atomic<std::uint64_t> head_{0};  ///< Written by the producer.
  std::atomic<std::uint64_t> dropped_{0};
  alignas(64) std::atomic<std::uint64_t> tail_{0};  ///< Written by the consumer.
};

}  // namespace rtbus
