#pragma once
/// @file impulse_balance.hpp
/// Newton's third law in a running session: what the hand felt in a second against what the world received in it.
#include <algorithm>
#include <cstdint>
#include <deque>
#include <iterator>

#include <Eigen/Core>

#include "rtbus/clock.hpp"

namespace tools {

/// Sums impulses in windows of at least one second, both in the device's frame D. A window begins and ends with device
/// samples that steps of physics answer: what a step gives is what was felt between two of them, and nothing lies
/// across the end. The two ends of a coupling that is at work differ by what their springs hold and by the age of the
/// proxy; over a second of a push these vanish beside the push. One thread.
class ImpulseBalance {
 public:
  /// Windows in which the world received less than this say nothing about a ratio [N·s].
  static constexpr double kWorthComparing_n_s = 0.1;
  /// A device holds a force no longer than this without a new one.
  static constexpr std::uint64_t kLongestHold_ns = 20 * rtbus::kNsPerMs;
  /// So much is remembered of what was felt: an answer is younger.
  static constexpr std::uint64_t kRemembered_ns = 3 * rtbus::kNsPerS;

  /// From `time_ns` on the hand feels `force_n`.
  void add_felt(std::uint64_t time_ns, const Eigen::Vector3d& force_n) {
    const Eigen::Vector3d sum_n_s = felt_until(time_ns);
    felt_.push_back({time_ns, sum_n_s, force_n});
    while (felt_.front().time_ns + kRemembered_ns < time_ns) felt_.pop_front();
  }

  /// The world received `impulse_n_s` (as on the hand, mapped to D) for what happened between these two device samples.
  /// Before the first add_felt() it is ignored.
  void add_given(std::uint64_t from_ns, std::uint64_t until_ns, const Eigen::Vector3d& impulse_n_s) {
    if (felt_.empty() || from_ns < felt_.front().time_ns || until_ns <= from_ns) return;
    if (begin_ns_ == 0) {
      begin_ns_ = from_ns;
      felt_before_n_s_ = felt_until(from_ns);
    }
    given_n_s_ += impulse_n_s;
    if (until_ns < begin_ns_ + rtbus::kNsPerS) return;
    const Eigen::Vector3d felt_n_s = felt_until(until_ns);
    compare(felt_n_s - felt_before_n_s_);
    felt_before_n_s_ = felt_n_s;
    given_n_s_.setZero();
    begin_ns_ = until_ns;
  }

  struct Figures {
    double felt_n_s = 0.0, given_n_s = 0.0;  ///< Norms of the sums over the windows compared.
    double worst = 0.0;                      ///< Largest |felt − given| / |given| of a window.
    std::size_t windows = 0;                 ///< Compared: whole seconds with a push worth the name.
  };

  /// Of the windows that are complete.
  [[nodiscard]] Figures figures() const { return {felt_sum_n_s_.norm(), given_sum_n_s_.norm(), worst_, windows_}; }

 private:
  struct Felt {
    std::uint64_t time_ns;
    Eigen::Vector3d before_n_s;  ///< Sum up to time_ns.
    Eigen::Vector3d force_n;     ///< From then on.
  };

  [[nodiscard]] Eigen::Vector3d felt_until(std::uint64_t time_ns) const {
    const auto later = std::upper_bound(felt_.begin(), felt_.end(), time_ns,
                                        [](std::uint64_t time, const Felt& felt) { return time < felt.time_ns; });
    if (later == felt_.begin()) return Eigen::Vector3d::Zero();
    const Felt& felt = *std::prev(later);
    const std::uint64_t until_ns = std::min(time_ns, felt.time_ns + kLongestHold_ns);
    return felt.before_n_s + rtbus::seconds_between(felt.time_ns, until_ns) * felt.force_n;
  }

  void compare(const Eigen::Vector3d& felt_n_s) {
    const double given = given_n_s_.norm();
    if (given < kWorthComparing_n_s) return;
    ++windows_;
    worst_ = std::max(worst_, (felt_n_s - given_n_s_).norm() / given);
    felt_sum_n_s_ += felt_n_s;
    given_sum_n_s_ += given_n_s_;
  }

  std::deque<Felt> felt_;
  std::uint64_t begin_ns_ = 0;  ///< Of the window; 0: none yet.
  Eigen::Vector3d felt_before_n_s_ = Eigen::Vector3d::Zero();
  Eigen::Vector3d given_n_s_ = Eigen::Vector3d::Zero();  ///< In the window.
  Eigen::Vector3d felt_sum_n_s_ = Eigen::Vector3d::Zero(), given_sum_n_s_ = Eigen::Vector3d::Zero();
  double worst_ = 0.0;
  std::size_t windows_ = 0;
};

}  // namespace tools
