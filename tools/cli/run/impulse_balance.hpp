#pragma once
/// @file impulse_balance.hpp
/// Newton's third law in a running session: impulse on the hand against impulse on the world, per second.
#include <algorithm>
#include <cstdint>
#include <deque>
#include <iterator>

#include <Eigen/Core>

#include "rtbus/clock.hpp"

namespace tools {

/// Sums impulses in windows of at least one second, both in the device's frame D. A window starts and ends with device
/// samples that physics answered, so that no step lies across its end. The two ends of a coupling differ by the
/// springs' stored impulse and by the age of the proxy; over a second of a push both are small. One thread.
class ImpulseBalance {
 public:
  /// Windows with a smaller impulse on the world are not compared [N·s].
  static constexpr double kWorthComparing_n_s = 0.1;
  /// A device holds a force no longer than this without a new one.
  static constexpr std::uint64_t kLongestHold_ns = 20 * rtbus::kNsPerMs;
  /// Forces are kept for so long: answers are younger.
  static constexpr std::uint64_t kRemembered_ns = 3 * rtbus::kNsPerS;
  /// … and no more forces: twice those of the fastest loop.
  static constexpr std::size_t kMostRemembered = 65536;

  /// From `time_ns` on the hand feels `force_n`. A time that is not later than the one before is ignored.
  void add_hand_force(std::uint64_t time_ns, const Eigen::Vector3d& force_n) {
    if (!hand_forces_.empty() && time_ns <= hand_forces_.back().time_ns) return;
    const Eigen::Vector3d sum_n_s = hand_impulse_until(time_ns);
    hand_forces_.push_back({time_ns, sum_n_s, force_n});
    while (hand_forces_.size() > kMostRemembered || time_ns - hand_forces_.front().time_ns > kRemembered_ns)
      hand_forces_.pop_front();
  }

  /// The world received `impulse_n_s` (as on the hand, mapped to D) for what happened between these two device samples.
  /// Before the first add_hand_force() it is ignored.
  void add_world_impulse(std::uint64_t from_ns, std::uint64_t until_ns, const Eigen::Vector3d& impulse_n_s) {
    if (hand_forces_.empty() || from_ns < hand_forces_.front().time_ns || until_ns <= from_ns) return;
    if (begin_ns_ == 0) {
      begin_ns_ = from_ns;
      hand_before_n_s_ = hand_impulse_until(from_ns);
    }
    world_n_s_ += impulse_n_s;
    if (until_ns < begin_ns_ + rtbus::kNsPerS) return;
    const Eigen::Vector3d hand_n_s = hand_impulse_until(until_ns);
    compare(hand_n_s - hand_before_n_s_);
    hand_before_n_s_ = hand_n_s;
    world_n_s_.setZero();
    begin_ns_ = until_ns;
  }

  struct Figures {
    double hand_n_s = 0.0, world_n_s = 0.0;  ///< Norms of the sums over the windows compared.
    double worst = 0.0;                      ///< Largest |hand − world| / |world| of a window.
    std::size_t windows = 0;                 ///< Windows that were compared.
  };

  /// Of the windows that are complete.
  [[nodiscard]] Figures figures() const { return {hand_sum_n_s_.norm(), world_sum_n_s_.norm(), worst_, windows_}; }

 private:
  struct HandForce {
    std::uint64_t time_ns;
    Eigen::Vector3d before_n_s;  ///< Sum up to time_ns.
    Eigen::Vector3d force_n;     ///< From then on.
  };

  [[nodiscard]] Eigen::Vector3d hand_impulse_until(std::uint64_t time_ns) const {
    const auto later = std::upper_bound(hand_forces_.begin(), hand_forces_.end(), time_ns,
                                        [](std::uint64_t time, const HandForce& held) { return time < held.time_ns; });
    if (later == hand_forces_.begin()) return Eigen::Vector3d::Zero();
    const HandForce& held = *std::prev(later);
    const std::uint64_t until_ns = std::min(time_ns, held.time_ns + kLongestHold_ns);
    return held.before_n_s + rtbus::seconds_between(held.time_ns, until_ns) * held.force_n;
  }

  void compare(const Eigen::Vector3d& hand_n_s) {
    const double world_norm_n_s = world_n_s_.norm();
    if (world_norm_n_s < kWorthComparing_n_s) return;
    ++windows_;
    worst_ = std::max(worst_, (hand_n_s - world_n_s_).norm() / world_norm_n_s);
    hand_sum_n_s_ += hand_n_s;
    world_sum_n_s_ += world_n_s_;
  }

  std::deque<HandForce> hand_forces_;
  std::uint64_t begin_ns_ = 0;  ///< Of the window; 0: none yet.
  Eigen::Vector3d hand_before_n_s_ = Eigen::Vector3d::Zero();
  Eigen::Vector3d world_n_s_ = Eigen::Vector3d::Zero();  ///< In the window.
  Eigen::Vector3d hand_sum_n_s_ = Eigen::Vector3d::Zero(), world_sum_n_s_ = Eigen::Vector3d::Zero();
  double worst_ = 0.0;
  std::size_t windows_ = 0;
};

}  // namespace tools
