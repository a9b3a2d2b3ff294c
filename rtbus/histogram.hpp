#pragma once
/// @file histogram.hpp
/// Latencies counted in fixed memory: log-linear bins of at most 1/64 relative width, so a percentile is right to 1.6
/// %.
#include <array>
#include <atomic>
#include <bit>
#include <cstddef>
#include <cstdint>

#include "rtbus/realtime.hpp"

namespace rtbus {

/// One thread records; any thread may read at any time and sees each record sooner or later. 15 KiB.
/// Below 128 ns every bin is 1 ns wide; above, each power of two is cut into 64 equal bins, up to 2^36 ns (69 s),
/// which takes everything longer.
class Histogram {
 public:
  /// Counts one duration. @realtime Yes, wait-free; a few nanoseconds.
  void record(std::uint64_t ns) noexcept RTBUS_NONBLOCKING {
    bump(bins_[index_of(ns)], 1);
    bump(count_, 1);
    bump(sum_ns_, ns);
    if (ns > max_ns_.load(std::memory_order_relaxed)) max_ns_.store(ns, std::memory_order_relaxed);
  }

  /// The value that a share `p` (0…1) of all records does not exceed [ns], by nearest rank; 0 when empty.
  /// It is the middle of its bin, and the exact maximum where the bin holds it.
  [[nodiscard]] std::uint64_t percentile(double p) const noexcept {
    // Sum the bins instead of asking count(): they may have grown since.
    std::uint64_t total = 0;
    for (const auto& bin : bins_) total += bin.load(std::memory_order_relaxed);
    if (total == 0) return 0;
    const double wanted = p * static_cast<double>(total);
    auto rank = static_cast<std::uint64_t>(wanted);
    if (static_cast<double>(rank) < wanted || rank == 0) ++rank;
    const std::uint64_t max_ns = max();
    if (rank >= total) return max_ns;
    std::uint64_t seen = 0;
    for (std::size_t i = 0; i < kBins; ++i) {
      seen += bins_[i].load(std::memory_order_relaxed);
      if (seen >= rank) return middle_of(i) < max_ns ? middle_of(i) : max_ns;
    }
    return max_ns;
  }

  [[nodiscard]] std::uint64_t count() const noexcept { return count_.load(std::memory_order_relaxed); }
  [[nodiscard]] std::uint64_t max() const noexcept { return max_ns_.load(std::memory_order_relaxed); }
  [[nodiscard]] double mean() const noexcept {
    const std::uint64_t records = count();
    return records == 0 ? 0.0
                        : static_cast<double>(sum_ns_.load(std::memory_order_relaxed)) / static_cast<double>(records);
  }

  /// Calls visit(low_ns, high_ns, count) for each bin that holds something, in order; a bin is [low, high). Any thread.
  template <class Visit>
  void for_each_bin(Visit&& visit) const {
    for (std::size_t i = 0; i < kBins; ++i) {
      const std::uint64_t in_bin = bins_[i].load(std::memory_order_relaxed);
      if (in_bin == 0) continue;
      const std::size_t shift = i < 2 * kSub ? 0 : i / kSub - 1;
      const std::uint64_t low = i < 2 * kSub ? i : (kSub + i % kSub) << shift;
      visit(low, low + (std::uint64_t{1} << shift), in_bin);
    }
  }

  /// Forgets everything. By the recording thread only. @realtime Yes, some microseconds.
  void reset() noexcept RTBUS_NONBLOCKING {
    for (auto& bin : bins_) bin.store(0, std::memory_order_relaxed);
    count_.store(0, std::memory_order_relaxed);
    sum_ns_.store(0, std::memory_order_relaxed);
    max_ns_.store(0, std::memory_order_relaxed);
  }

 private:
  static constexpr int kSubBits = 6;  // 64 bins per power of two
  static constexpr std::size_t kSub = std::size_t{1} << kSubBits;
  static constexpr int kMaxBits = 36;
  static constexpr std::size_t kBins = (kMaxBits - kSubBits + 1) * kSub;

  /// A single writer needs no atomic read-modify-write, which would cost ten times as much.
  static void bump(std::atomic<std::uint64_t>& cell, std::uint64_t by) noexcept RTBUS_NONBLOCKING {
    cell.store(cell.load(std::memory_order_relaxed) + by, std::memory_order_relaxed);
  }
  static constexpr std::size_t index_of(std::uint64_t ns) noexcept RTBUS_NONBLOCKING {
    if (ns >> kMaxBits != 0) return kBins - 1;
    if (ns < kSub) return static_cast<std::size_t>(ns);
    const int shift = static_cast<int>(std::bit_width(ns)) - 1 - kSubBits;
    return static_cast<std::size_t>(shift) * kSub + static_cast<std::size_t>(ns >> shift);
  }
  static constexpr std::uint64_t middle_of(std::size_t index) noexcept {
    if (index < 2 * kSub) return index;
    const std::size_t shift = index / kSub - 1;
    const std::uint64_t low = (kSub + index % kSub) << shift;
    return low + ((std::uint64_t{1} << shift) - 1) / 2;
  }

  std::array<std::atomic<std::uint64_t>, kBins> bins_{};
  std::atomic<std::uint64_t> count_{0};
  std::atomic<std::uint64_t> sum_ns_{0};
  std::atomic<std::uint64_t> max_ns_{0};
};

}  // namespace rtbus
