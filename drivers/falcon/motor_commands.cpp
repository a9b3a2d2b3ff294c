#include "drivers/falcon/motor_commands.hpp"

#include <Eigen/LU>

#include <algorithm>
#include <cmath>

#include "drivers/falcon/falcon_frame.hpp"

namespace drivers::falcon {

MotorCommands commands_for_force(const Kinematics& kinematics, const Eigen::Vector3d& position_m,
                                 const Eigen::Vector3d& angles_rad, const Eigen::Vector3d& force_n,
                                 double gain) noexcept {
  MotorCommands out;
  if (!force_n.allFinite()) {
    out.limited = true;
    return out;
  }
  const auto jacobian = kinematics.jacobian(position_m, angles_rad);
  if (!jacobian) {
    out.limited = !force_n.isZero(0.0);
    return out;
  }
  Eigen::Vector3d command = -gain * (jacobian->transpose() * force_n);
  const double largest = command.cwiseAbs().maxCoeff();
  if (!std::isfinite(largest)) {
    out.limited = true;
    return out;
  }
  if (largest > kMaxCommand) {
    command *= kMaxCommand / largest;
    out.limited = true;
  }
  for (int i = 0; i < 3; ++i) {
    const long rounded = std::clamp<long>(std::lround(command[i]), -kMaxCommand, kMaxCommand);
    out.count[static_cast<std::size_t>(i)] = static_cast<std::int16_t>(rounded);
  }
  return out;
}

Eigen::Vector3d force_of_commands(const Kinematics& kinematics, const Eigen::Vector3d& position_m,
                                  const Eigen::Vector3d& angles_rad, const std::array<std::int16_t, 3>& count,
                                  double gain) noexcept {
  const auto jacobian = kinematics.jacobian(position_m, angles_rad);
  if (!jacobian) return Eigen::Vector3d::Zero();
  const Eigen::Vector3d torque_n_m = Eigen::Vector3d(count[0], count[1], count[2]) / -gain;
  return jacobian->transpose().inverse() * torque_n_m;
}

}  // namespace drivers::falcon
