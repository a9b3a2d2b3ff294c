#pragma once
/// @file trace.hpp
/// A record of a run for figures, in bounded memory: full rate at first, then thinner and thinner.
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace tools {

/// Keeps at most kCapacity rows. When they are full, neighbours are merged two by two, and from then on each row stands
/// for twice as many samples. Row needs `void absorb(const Row& later)`, which says what survives a merger: a position
/// stays, the worst latency wins.
template <class Row>
class Trace {
 public:
  static constexpr std::size_t kCapacity = 65536;  ///< 65 s at 1 kHz.

  void add(const Row& row) {
    if (in_last_ > 0 && in_last_ < stride_) {
      rows_.back().absorb(row);
      ++in_last_;
      return;
    }
    if (rows_.size() == kCapacity) {
      for (std::size_t i = 0; i < kCapacity / 2; ++i) {
        rows_[i] = rows_[2 * i];
        rows_[i].absorb(rows_[2 * i + 1]);
      }
      rows_.resize(kCapacity / 2);
      stride_ *= 2;
    }
    rows_.push_back(row);
    in_last_ = 1;
  }

  [[nodiscard]] std::span<const Row> rows() const noexcept { return rows_; }
  [[nodiscard]] std::uint64_t stride() const noexcept { return stride_; }  ///< Samples per row.

 private:
  std::vector<Row> rows_;
  std::uint64_t stride_ = 1;
  std::uint64_t in_last_ = 0;  ///< Samples in the last row.
};

}  // namespace tools
