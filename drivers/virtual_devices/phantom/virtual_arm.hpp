#pragma once
/// @file virtual_arm.hpp
/// The arm of a virtual PHANToM: a simulated tip with a hand on it, seen through the linkage. Encoders show the joint
/// angles of the tip's position, motor currents pull at the tip with F = J⁻ᵀ τ. Frame D.
///
/// The linkage's end stops are where it ends: out of reach, behind the axis, or within 3° of a singular pose.
#include <array>
#include <cstdint>

#include "drivers/phantom/phantom_kinematics.hpp"
#include "drivers/simulated/mechanics.hpp"

namespace drivers::virtual_usb {

class VirtualArm {
 public:
  /// `mechanics.start_position_m` must be within reach. End stops and quanta of the mechanics are not used.
  VirtualArm(const phantom::Model& model, simulated::MechanicsParameters mechanics, simulated::Hand hand);

  /// False when the linkage cannot hold the tip there.
  [[nodiscard]] static bool reaches(const phantom::Kinematics& kinematics, const Eigen::Vector3d& position_m);

  void reset(std::uint64_t now_ns);
  void begin_script(std::uint64_t now_ns) { mechanics_.begin_script(now_ns); }

  /// Lets time pass under these motor currents [mA]; call it at least once a millisecond.
  void advance_to(std::uint64_t now_ns, const std::array<double, 3>& currents_ma);

  /// What the motor encoders show, counted from the home pose.
  [[nodiscard]] phantom::Counts counts() const noexcept;
  [[nodiscard]] const simulated::Mechanics& mechanics() const noexcept { return mechanics_; }
  [[nodiscard]] const phantom::Kinematics& kinematics() const noexcept { return kinematics_; }
  /// Carries the tip to another place at once, at rest. @returns false when that is out of reach.
  bool place(const Eigen::Vector3d& position_m);

 private:
  void follow_tip();

  phantom::Kinematics kinematics_;
  simulated::Mechanics mechanics_;
  phantom::JointAngles angles_;
  phantom::ArmPose pose_;
};

}  // namespace drivers::virtual_usb
