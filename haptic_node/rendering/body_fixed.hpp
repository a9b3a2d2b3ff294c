#pragma once
/// @file body_fixed.hpp
/// A body that never moves. Frame W, SI units.
#include <Eigen/Geometry>

#include "haptic_node/rendering/body_motion.hpp"

namespace haptic {

/// @realtime Yes.
class FixedBody {
 public:
  Eigen::Quaterniond take(const ToldBody& told, BodyMotion& motion) noexcept {
    motion = {};
    motion.centre_m = told.centre_m();
    return Eigen::Quaterniond::Identity();
  }
};

}  // namespace haptic
