#pragma once
/// @file mailbox.hpp
/// The newest value from one thread to another, wait-free for both: three copies, of which the writer owns one, the
/// reader one, and the third changes hands. Neither end ever retries, whoever is preempted where.
#include <array>
#include <atomic>
#include <cstdint>
#include <type_traits>

#include "rtbus/realtime.hpp"

namespace drivers::io {

template <class T>
class Mailbox {
  static_assert(std::is_trivially_copyable_v<T>);

 public:
  /// Writer's side. @realtime Yes, wait-free.
  void put(const T& value) noexcept RTBUS_NONBLOCKING {
    cells_[mine_].value = value;
    // Release: the value goes with the cell. Acquire: the reader has finished with the one that comes back.
    mine_ = shared_.exchange(static_cast<std::uint8_t>(mine_ | kFresh), std::memory_order_acq_rel) & kIndex;
  }

  /// Reader's side: true and the newest value when there is one that was not taken yet. @realtime Yes, wait-free.
  bool take(T& out) noexcept RTBUS_NONBLOCKING {
    if ((shared_.load(std::memory_order_relaxed) & kFresh) == 0) return false;
    theirs_ = shared_.exchange(theirs_, std::memory_order_acq_rel) & kIndex;
    out = cells_[theirs_].value;
    return true;
  }

 private:
  static constexpr std::uint8_t kFresh = 4;
  static constexpr std::uint8_t kIndex = 3;
  struct alignas(64) Cell {
    T value{};
  };
  std::array<Cell, 3> cells_;
  alignas(64) std::uint8_t mine_ = 0;    ///< Writer's.
  alignas(64) std::uint8_t theirs_ = 1;  ///< Reader's.
  alignas(64) std::atomic<std::uint8_t> shared_{2};
};

}  // namespace drivers::io
