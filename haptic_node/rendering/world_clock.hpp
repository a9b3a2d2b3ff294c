#pragma once
/// @file world_clock.hpp
/// When, in the hand's time, the world was as an answer says.
#include <algorithm>
#include <cmath>
#include <cstdint>

#include "rtbus/realtime.hpp"

namespace haptic {

/// Physics steps evenly; the samples of the hand that its steps read come unevenly over a network. Where they are far
/// apart, the world has moved for less time than the hand, and a body would be taken to be where it was some
/// milliseconds before. The mean of both is right: this keeps it. @realtime Everything.
class WorldClock {
 public:
  void forget() noexcept { steps_ = 0; }

  /// An answer. @returns how much later the sample was that it belongs to than the world was by that mean [s].
  [[nodiscard]] double sample_after_world_s(std::uint64_t step_index, double step_s,
                                            std::uint64_t sample_ns) noexcept RTBUS_NONBLOCKING {
    const double run_s = step_s * static_cast<double>(step_index - step_index_);
    const double sampled_s = 1e-9 * static_cast<double>(sample_ns - sample_ns_);
    const bool goes_on = steps_ > 0 && step_index > step_index_ && sample_ns >= sample_ns_;
    step_index_ = step_index;
    sample_ns_ = sample_ns;
    after_s_ = goes_on ? after_s_ + sampled_s - run_s : 0.0;
    if (!goes_on || std::abs(after_s_) > kMost_s) {  // another run of physics, or one that does not keep its pace
      steps_ = 1;
      after_s_ = 0.0;
      return 0.0;
    }
    const double share = std::max(1.0 / static_cast<double>(++steps_), -std::expm1(-run_s / kMean_s));
    return after_s_ -= std::min(share, 1.0) * after_s_;
  }

 private:
  static constexpr double kMean_s = 0.5;
  static constexpr double kMost_s = 0.5;

  std::uint64_t steps_ = 0;  ///< Answers that the mean is of.
  std::uint64_t step_index_ = 0;
  std::uint64_t sample_ns_ = 0;
  double after_s_ = 0.0;
};

}  // namespace haptic
