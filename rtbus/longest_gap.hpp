#pragma once
/// @file longest_gap.hpp
/// How long a silent hand is taken to push on.
#include <algorithm>
#include <cmath>
#include <cstdint>

#include "rtbus/clock.hpp"

namespace rtbus {

/// The longest time between two samples of one hand, of late. @realtime Yes.
class LongestGap {
 public:
  /// No longer one is taken into account: a hand that has ended must not push on.
  static constexpr std::uint64_t kLongest_ns = 5 * kNsPerMs;

  /// A sample came so long after the one before it.
  void add(std::uint64_t gap_ns) noexcept {
    const double kept = std::exp(-1e-9 * static_cast<double>(gap_ns) / kForgets_s);
    const auto longest_ns = static_cast<std::uint64_t>(kept * static_cast<double>(ns_));
    ns_ = std::clamp(gap_ns, longest_ns, kLongest_ns);
  }

  /// So long after its newest sample a hand may still push: a tick more than it was silent of late. One message that is
  /// lost is no end, and where none is lost these are two ticks.
  [[nodiscard]] std::uint64_t goes_on_ns(std::uint64_t tick_ns) const noexcept {
    return ns_ + std::min(tick_ns, kLongest_ns);
  }

 private:
  /// The longest is forgotten over about this long.
  static constexpr double kForgets_s = 10.0;
  std::uint64_t ns_ = 0;
};

}  // namespace rtbus
