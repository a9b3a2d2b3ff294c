#pragma once
/// @file motor_commands.hpp
/// From a force at the grip to the three motor commands of a frame, and back.
#include <array>
#include <cstdint>
#include <string_view>

#include <Eigen/Core>

#include "drivers/falcon/falcon_kinematics.hpp"

namespace drivers::falcon {

/// Counts of motor command per joint torque [1/(N·m)], as published. They disagree by a half, so a calibration factor
/// multiplies them (docs/devices.md).
/// Martin and Hillier, ACRA 2009: 1.9835e-5 N·m at the motor per count, drive ratio 7.62.
inline constexpr double kGainMartinHillier = 1.0 / (1.9835e-5 * 7.62);
/// libnifalcon: matched by eye, drives about 1.5 times harder.
inline constexpr double kGainLibnifalcon = 10000.0;

struct MotorCommands {
  std::array<std::int16_t, 3> count{};
  bool limited = false;  ///< Scaled down as one, so that the force keeps its direction; or refused (not finite).
};

/// Commands for a force [N, frame B] at a position and its angles. Zero for a force that is not finite and where the
/// mechanism is singular. `gain` in counts per N·m. Positive commands pull the grip towards the body.
[[nodiscard]] MotorCommands commands_for_force(const Kinematics& kinematics, const Eigen::Vector3d& position_m,
                                               const Eigen::Vector3d& angles_rad, const Eigen::Vector3d& force_n,
                                               double gain) noexcept;

/// The force [N, frame B] that these commands make: the inverse of the above. Zero where the mechanism is singular.
[[nodiscard]] Eigen::Vector3d force_of_commands(const Kinematics& kinematics, const Eigen::Vector3d& position_m,
                                                const Eigen::Vector3d& angles_rad,
                                                const std::array<std::int16_t, 3>& count, double gain) noexcept;

}  // namespace drivers::falcon
