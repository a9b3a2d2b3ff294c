#include "rtbus/event_log.hpp"

#include <bit>

namespace rtbus {

EventLog::EventLog(std::size_t capacity)
    : mask_(std::bit_ceil(capacity < 2 ? std::size_t{2} : capacity) - 1),
      cells_(std::make_unique<Event[]>(mask_ + 1)) {}

std::size_t EventLog::drain(const std::function<void(const Event&)>& sink) {
  const std::uint64_t head = head_.load(std::memory_order_acquire);
  const std::uint64_t first = tail_.load(std::memory_order_relaxed);
  for (std::uint64_t i = first; i != head; ++i) {
    const Event event = cells_[i & mask_];
    tail_.store(i + 1, std::memory_order_release);  // the cell is free again, however long the sink takes
    sink(event);
  }
  return static_cast<std::size_t>(head - first);
}

}  // namespace rtbus
