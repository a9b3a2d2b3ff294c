#pragma once
/// @file latest_cell.hpp
/// The newest value from one thread to another, without waiting and without locks: three slots, of which the writer
/// owns one, the reader one, and the third, the newest finished one, changes hands by an atomic exchange.
#include <array>
#include <atomic>
#include <cstdint>

#include "rtbus/realtime.hpp"

namespace haptic {

/// One writer, one reader. @realtime Both ends, wait-free.
template <class T>
class LatestCell {
 public:
  void put(const T& value) noexcept RTBUS_NONBLOCKING {
    slots_[mine_] = value;
    mine_ = middle_.exchange(static_cast<std::uint8_t>(mine_ | kFresh), std::memory_order_acq_rel) & kIndex;
  }
  /// True, with the value, when one has been put since the last call.
  [[nodiscard]] bool take(T& out) noexcept RTBUS_NONBLOCKING {
    if ((middle_.load(std::memory_order_relaxed) & kFresh) == 0) return false;
    theirs_ = middle_.exchange(theirs_, std::memory_order_acq_rel) & kIndex;
    out = slots_[theirs_];
    return true;
  }

 private:
  static constexpr std::uint8_t kIndex = 3;
  static constexpr std::uint8_t kFresh = 4;
  std::array<T, 3> slots_{};
  std::uint8_t mine_ = 0;                ///< Writer's.
  std::uint8_t theirs_ = 1;              ///< Reader's.
  std::atomic<std::uint8_t> middle_{2};  ///< The third, with kFresh while the reader has not seen it.
};

}  // namespace haptic
