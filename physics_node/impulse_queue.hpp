#pragma once
/// @file impulse_queue.hpp
/// What a hand did to bodies between its samples, until a step of the world gives it to them.
#include <algorithm>
#include <array>
#include <cstddef>
#include <deque>
#include <vector>

#include <Eigen/Core>

#include "rtbus/messages.hpp"

namespace physics {

/// Impulse that a body receives in the next step, evenly between two instants of it.
struct PendingImpulse {
  std::size_t body = 0;
  Eigen::Vector3d impulse_n_s = Eigen::Vector3d::Zero();
  Eigen::Vector3d angular_n_m_s = Eigen::Vector3d::Zero();
  double from = 0.0, to = 1.0;  ///< Shares of the step.
};

/// Each step takes as much of the hand's time as it lasts itself, as long as so much has been told: the world's weights
/// act for just as long as the hand pushes. (A steady push whose samples come in bunches would be no push in one step
/// and twice the push in the next: a light body rattles, and what is about to tip gets blows.) What a gap has left over
/// drains within seconds: it is age of the answers, and nothing else, for they say which time of the hand they belong
/// to (queued_s()).
class ImpulseQueue {
 public:
  using Rows = std::array<PendingImpulse, rtbus::kHandImpulseRows>;

  void clear() noexcept {
    told_.clear();
    queued_s_ = 0.0;
  }

  /// The hand's time went on by `seconds`, and it did `rows` meanwhile.
  void tell(const Rows& rows, double seconds) {
    told_.push_back({rows, std::max(seconds, 0.0), 1.0});
    queued_s_ += told_.back().seconds;
  }

  /// So much of the hand's time the next step of `dt_s` seconds would take. @param most_s So much is held back at most.
  /// @param tick_s Between two samples of the hand: so much is no surplus. A step finds a sample more or less than the
  /// one before, and where nothing is left for one that finds less, its body falls for longer than the hand holds it.
  [[nodiscard]] double due_s(double dt_s, double most_s, double tick_s) const noexcept {
    const double spare_s = std::max(0.0, queued_s_ - dt_s);
    const double drained_s = std::max(0.0, spare_s - tick_s) * std::min(1.0, dt_s / kDrain_s);
    return dt_s + std::max(drained_s, spare_s - most_s);
  }

  /// What a step gives to the bodies for which so much of the hand's time is due, each at its time, is added to `out`.
  /// @param most_s No more of it is taken; the end of the step gets nothing then.
  void take(double due_s, double most_s, std::vector<PendingImpulse>& out) {
    double begin_s = 0.0;
    while (!told_.empty()) {
      Told& first = told_.front();
      const double left_s = first.share * first.seconds;
      const double share = begin_s + left_s > most_s ? (most_s - begin_s) / first.seconds : first.share;
      const double end_s = begin_s + share * first.seconds;
      if (share > 0.0) add(first.rows, share, begin_s / due_s, end_s / due_s, out);
      first.share -= share;
      queued_s_ -= share * first.seconds;
      begin_s = end_s;
      if (left_s > share * first.seconds) break;
      told_.pop_front();
    }
    if (told_.empty()) queued_s_ = 0.0;
  }

  /// The bodies have received what the hand did until so long before its newest sample.
  [[nodiscard]] double queued_s() const noexcept { return queued_s_; }

 private:
  static constexpr double kDrain_s = 2.0;

  struct Told {
    Rows rows;
    double seconds;
    double share;  ///< That is left.
  };

  static void add(const Rows& rows, double share, double from, double to, std::vector<PendingImpulse>& out) {
    for (const PendingImpulse& row : rows) {
      if (row.impulse_n_s.isZero(0.0) && row.angular_n_m_s.isZero(0.0)) continue;
      PendingImpulse& given =
          out.emplace_back(PendingImpulse{row.body, share * row.impulse_n_s, share * row.angular_n_m_s});
      if (from < to) {
        given.from = from;
        given.to = to;
      }
    }
  }

  std::deque<Told> told_;
  double queued_s_ = 0.0;
};

}  // namespace physics
