#pragma once
/// @file interval_stats.hpp
/// Rate and jitter of a topic from the stamps that its writer put on the samples.
#include <algorithm>
#include <cmath>
#include <cstdint>

namespace tools {

/// Fed with the samples of one topic in order. An interval counts only between neighbours (sequence numbers one apart):
/// across a gap it would say something about the reader, not about the writer. The mean rate goes over everything.
class IntervalStats {
 public:
  void add(std::uint64_t sequence, std::uint64_t stamp_ns) noexcept {
    // A smaller number: the topic was made anew, a new count begins. What was measured stays.
    if (samples_ > 0 && sequence > last_sequence_) {
      const std::uint64_t steps = sequence - last_sequence_;
      const double elapsed_s = static_cast<double>(static_cast<std::int64_t>(stamp_ns - last_stamp_ns_)) * 1e-9;
      steps_ += steps;
      elapsed_s_ += elapsed_s;
      missed_ += steps - 1;
      if (steps == 1) add_interval(elapsed_s);
    }
    last_sequence_ = sequence;
    last_stamp_ns_ = stamp_ns;
    ++samples_;
  }

  /// Forgets the figures, but not the last sample: the next interval begins there.
  void begin_window() noexcept {
    const IntervalStats before = *this;
    *this = IntervalStats{};
    last_sequence_ = before.last_sequence_;
    last_stamp_ns_ = before.last_stamp_ns_;
    samples_ = before.samples_ > 0 ? 1 : 0;
  }

  [[nodiscard]] std::uint64_t samples() const noexcept { return samples_; }  ///< Fed, in a window the one before too.
  [[nodiscard]] std::uint64_t intervals() const noexcept { return intervals_; }  ///< Between neighbours.
  [[nodiscard]] std::uint64_t missed() const noexcept { return missed_; }        ///< Numbers that were jumped over.
  /// Samples published per second [Hz], those missed included; 0 before two samples.
  [[nodiscard]] double rate_hz() const noexcept {
    return elapsed_s_ > 0.0 ? static_cast<double>(steps_) / elapsed_s_ : 0.0;
  }
  [[nodiscard]] double min_s() const noexcept { return intervals_ > 0 ? min_s_ : 0.0; }
  [[nodiscard]] double max_s() const noexcept { return max_s_; }
  [[nodiscard]] double mean_s() const noexcept { return mean_s_; }
  /// Standard deviation of the intervals [s]; 0 before two.
  [[nodiscard]] double jitter_s() const noexcept {
    return intervals_ > 1 ? std::sqrt(square_sum_ / static_cast<double>(intervals_ - 1)) : 0.0;
  }

 private:
  /// Welford's update: no cancellation when the mean is a thousand times the deviation.
  void add_interval(double interval_s) noexcept {
    min_s_ = intervals_ > 0 ? std::min(min_s_, interval_s) : interval_s;
    max_s_ = std::max(max_s_, interval_s);
    ++intervals_;
    const double off = interval_s - mean_s_;
    mean_s_ += off / static_cast<double>(intervals_);
    square_sum_ += off * (interval_s - mean_s_);
  }

  std::uint64_t samples_ = 0, intervals_ = 0, steps_ = 0, missed_ = 0;
  std::uint64_t last_sequence_ = 0, last_stamp_ns_ = 0;
  double elapsed_s_ = 0.0, min_s_ = 0.0, max_s_ = 0.0, mean_s_ = 0.0, square_sum_ = 0.0;
};

}  // namespace tools
