#include "drivers/virtual_devices/phantom/virtual_arm.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include <Eigen/LU>

namespace drivers::virtual_usb {
namespace {

using Eigen::Vector3d;

constexpr double kSingular = 0.05;  // volume of the Jacobian's unit columns, about 3°

// How far the Jacobian is from singular: 1 for perpendicular columns.
double openness(const Eigen::Matrix3d& jacobian) {
  const double sizes = jacobian.col(0).norm() * jacobian.col(1).norm() * jacobian.col(2).norm();
  return sizes > 0.0 ? std::abs(jacobian.determinant()) / sizes : 0.0;
}

bool solve(const phantom::Kinematics& kinematics, const Vector3d& position_m, phantom::JointAngles& angles,
           phantom::ArmPose& pose) {
  phantom::JointAngles q;
  phantom::ArmPose at;
  if (!kinematics.inverse(position_m, q) || !kinematics.forward(q, at) || openness(at.jacobian_m) < kSingular) {
    return false;
  }
  angles = q;
  pose = at;
  return true;
}

simulated::MechanicsParameters bare(simulated::MechanicsParameters m) {
  m.end_stops = false;
  m.position_quantum_m = 0.0;
  m.force_step_n = 0.0;
  m.max_force_n = 1e3;  // the amplifiers limit
  return m;
}

}  // namespace

bool VirtualArm::reaches(const phantom::Kinematics& kinematics, const Vector3d& position_m) {
  phantom::JointAngles angles;
  phantom::ArmPose pose;
  return solve(kinematics, position_m, angles, pose);
}

VirtualArm::VirtualArm(const phantom::Model& model, simulated::MechanicsParameters mechanics, simulated::Hand hand)
    : kinematics_(model), mechanics_(bare(mechanics), std::move(hand)) {
  follow_tip();
}

void VirtualArm::reset(std::uint64_t now_ns) {
  mechanics_.reset(now_ns);
  follow_tip();
}

bool VirtualArm::place(const Vector3d& position_m) {
  if (!solve(kinematics_, position_m, angles_, pose_)) return false;
  mechanics_.place(position_m, Vector3d::Zero());
  return true;
}

void VirtualArm::follow_tip() {
  if (solve(kinematics_, mechanics_.position_m(), angles_, pose_)) return;
  mechanics_.place(pose_.position_m, Vector3d::Zero());  // against a stop
}

void VirtualArm::advance_to(std::uint64_t now_ns, const std::array<double, 3>& currents_ma) {
  const Vector3d torques_n_m = kinematics_.torques_n_m({currents_ma[0], currents_ma[1], currents_ma[2]});
  const Vector3d force_n = pose_.jacobian_m.transpose().fullPivLu().solve(torques_n_m);
  (void)mechanics_.set_force(force_n, simulated::Mechanics::kNever);
  const std::uint64_t before_ns = mechanics_.time_ns();
  mechanics_.advance_to(now_ns);
  if (mechanics_.time_ns() != before_ns) follow_tip();
}

phantom::Counts VirtualArm::counts() const noexcept {
  const Vector3d counts = kinematics_.counts(angles_);
  phantom::Counts out{};
  for (std::size_t i = 0; i < 3; ++i) out[i] = static_cast<std::int32_t>(std::lround(counts[static_cast<int>(i)]));
  return out;
}

}  // namespace drivers::virtual_usb
