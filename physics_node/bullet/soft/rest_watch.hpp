#pragma once
/// @file rest_watch.hpp
/// For how long no hand and no rigid body has moved.
#include <algorithm>
#include <cstddef>
#include <vector>

#include <Eigen/Core>

namespace physics::bullet {

/// Places are seen in the same order in each step: begin(), see() for each, end(). One thread.
class RestWatch {
 public:
  /// What stays within this of where it was last seen to move, rests: a hand that holds still trembles by less.
  static constexpr double kWay_m = 1e-3;
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
