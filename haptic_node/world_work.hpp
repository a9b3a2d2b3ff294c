#pragma once
/// @file world_work.hpp
/// Work that the world does on the coupling at the proxy, from the answers of physics: energy that the hand has not put
/// in itself and may be given.
#include <algorithm>
#include <cmath>
#include <utility>

#include <Eigen/Core>

#include "rtbus/realtime.hpp"

namespace haptic {

/// One per loop. @realtime Yes.
class WorldWork {
 public:
  /// @param continuous_force_n Of the device. @param stiffness_n_per_m Of the coupling, at the device.
  WorldWork(double continuous_force_n, double stiffness_n_per_m) noexcept
      : buried_limit_j_(0.5 * continuous_force_n * continuous_force_n / std::max(stiffness_n_per_m, 1.0)) {}

  /// A new mapping epoch: physics puts the proxy onto the hand and counts from zero.
  void begin_anew() noexcept RTBUS_NONBLOCKING { counted_j_ = buried_j_ = 0.0; }

  /// Work since the answer before [J], whatever was lost between them. @param work_j ProxyState::coupling_work_j, at
  /// the device. @param contact_n Mean force of the world on the proxy over the last step, at the device.
  [[nodiscard]] double since_last(double work_j, const Eigen::Vector3d& contact_n) noexcept RTBUS_NONBLOCKING {
    double since_j = work_j - std::exchange(counted_j_, work_j);
    // No hand and no world exchange so much within the time of an answer: another count, or damage.
    if (!(std::abs(since_j) <= kMost_j)) return 0.0;
    // A proxy that started inside a body is pushed out, although nothing that moves has done that work. It counts up to
    // the device's continuous force (decision 0016).
    if (contact_n.norm() <= kNoTouch_n) buried_j_ = -1.0;
    if (buried_j_ >= 0.0) {
      since_j = std::min(since_j, buried_limit_j_ - buried_j_);
      buried_j_ += std::max(0.0, since_j);
    }
    return since_j;
  }

 private:
  static constexpr double kNoTouch_n = 1e-3;  ///< Below this, at the device, the proxy touches nothing.
  static constexpr double kMost_j = 1.0;      ///< Of one answer to the next.

  double buried_limit_j_;
  double counted_j_ = 0.0;  ///< Of the answer before; 0: none since begin_anew().
  /// Positive work since begin_anew(), while the proxy has been in contact without interruption; −1 after its first
  /// free step.
  double buried_j_ = 0.0;
};

}  // namespace haptic
