#pragma once
/// @file body_driven.hpp
/// A kinematic body: it goes on as it went, whatever pushes. Frame W, SI units.
#include <Eigen/Geometry>

#include "haptic_node/rendering/body_motion.hpp"

namespace haptic {

/// @realtime Yes.
class DrivenBody {
 public:
  /// @returns its turn from the answer's instant to now.
  Eigen::Quaterniond take(const ToldBody& told, const SinceAnswer& since, BodyMotion& motion) noexcept {
    motion = told.motion();
    motion.centre_m += since.seconds() * motion.velocity_m_s;
    return turn_of(motion.angular_velocity_rad_s, since.seconds());
  }
  void advance(const StepSolution& step, BodyMotion& motion) noexcept {
    motion.centre_m += step.h * motion.velocity_m_s;
  }
};

}  // namespace haptic
