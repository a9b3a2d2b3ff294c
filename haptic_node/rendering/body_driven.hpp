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
    const Eigen::Quaterniond turned = turn_of(motion.angular_velocity_rad_s, since.seconds());
    motion.q_WB = turned * motion.q_WB;
    return turned;
  }
  void advance(const StepSolution& step, BodyMotion& motion) noexcept {
    motion.centre_m += step.h * motion.velocity_m_s;
    if (motion.angular_velocity_rad_s.isZero(0.0)) return;
    motion.q_WB = (turn_of(motion.angular_velocity_rad_s, step.h) * motion.q_WB).normalized();
  }
};

}  // namespace haptic
