#pragma once
/// @file rest_watch.hpp
/// For how long no hand and no body that does not yield has moved.
#include <algorithm>
#include <cstddef>
#include <vector>

#include <Eigen/Core>

namespace physics::bullet {

/// Places are seen in the same order in each step: begin(), see() for each, end(). One thread.
class RestWatch {
 public:
  /// What stays within this of where it was on the mean over the last kMean_s, rests: a hand that holds still trembles
  /// by less. So a tool that creeps over a soft body, slower than 1 mm/s, rests too.
  static constexpr double kWay_m = 1e-3, kMean_s = 1.0;
  /// A world is at rest by a share that grows from 0 to 1 between this time and twice this time.
  static constexpr double kAfter_s = 0.5;

  void begin() noexcept {
    seen_ = 0;
    moves_ = false;
  }
  void see(const Eigen::Vector3d& place_m) {
    if (seen_ == now_m_.size()) now_m_.emplace_back();
    now_m_[seen_] = place_m;
    moves_ = moves_ || seen_ >= from_m_.size() || !((place_m - from_m_[seen_]).norm() <= kWay_m);
    ++seen_;
  }
  void end(double h) {
    now_m_.resize(seen_);
    moves_ = moves_ || seen_ != from_m_.size();
    rests_s_ = moves_ ? 0.0 : rests_s_ + h;
    if (moves_) from_m_ = now_m_;
    const double share = std::min(1.0, h / kMean_s);
    for (std::size_t i = 0; i < seen_; ++i) from_m_[i] += share * (now_m_[i] - from_m_[i]);
  }

  /// How much the world is at rest, 0 to 1.
  [[nodiscard]] double share() const noexcept { return std::clamp(rests_s_ / kAfter_s - 1.0, 0.0, 1.0); }

 private:
  std::vector<Eigen::Vector3d> from_m_, now_m_;
  std::size_t seen_ = 0;
  bool moves_ = false;
  double rests_s_ = 0.0;
};

}  // namespace physics::bullet
