#pragma once
/// @file mapping.hpp
/// From the device's frame D to the world W and back: rotation, offset, scale of positions and of forces, clutch.
#include <cstdint>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "rtbus/messages.hpp"
#include "rtbus/realtime.hpp"

namespace haptic {

/// x_W = offset + s·q_WD·x_D and F_W = force_scale·q_WD·F_D. With force_scale = 1/s power is preserved:
/// F_W·v_W = F_D·v_D, and a stiffness K at the device is K/s² in the world.
struct MappingConfig {
  Eigen::Quaterniond q_WD = Eigen::Quaterniond::Identity();
  Eigen::Vector3d offset_m = Eigen::Vector3d::Zero();  ///< p_WD: where the device's origin is in the world.
  double position_scale = 1.0;                         ///< s, metres of world per metre of device.
  double force_scale = 1.0;                            ///< Newtons in the world per newton at the device.

  /// Factor of a stiffness, a damping or a mass from the device to the world. @realtime Yes.
  [[nodiscard]] double gain_to_world() const noexcept RTBUS_NONBLOCKING {
    return rtbus::gain_to_world(position_scale, force_scale);
  }
};

/// @realtime Yes, all of it.
class Mapping {
 public:
  /// @param first_epoch Should differ from that of a process before this one, whose answers may still be on their way.
  explicit Mapping(const MappingConfig& config, std::uint32_t first_epoch = 1) noexcept;

  [[nodiscard]] Eigen::Vector3d position_to_world(const Eigen::Vector3d& p_D) const noexcept RTBUS_NONBLOCKING;
  [[nodiscard]] Eigen::Vector3d velocity_to_world(const Eigen::Vector3d& v_D) const noexcept RTBUS_NONBLOCKING;
  [[nodiscard]] Eigen::Quaterniond orientation_to_world(const Eigen::Quaterniond& q_DT) const noexcept
      RTBUS_NONBLOCKING;
  [[nodiscard]] Eigen::Vector3d position_to_device(const Eigen::Vector3d& p_W) const noexcept RTBUS_NONBLOCKING;
  [[nodiscard]] Eigen::Vector3d velocity_to_device(const Eigen::Vector3d& v_W) const noexcept RTBUS_NONBLOCKING;
  [[nodiscard]] Eigen::Vector3d force_to_world(const Eigen::Vector3d& f_D) const noexcept RTBUS_NONBLOCKING;
  [[nodiscard]] Eigen::Vector3d force_to_device(const Eigen::Vector3d& f_W) const noexcept RTBUS_NONBLOCKING;

  /// Shifts the offset so that the device at p_D is at p_W in the world. The set-point jumps there with it, so no
  /// spring is stretched by the change; the epoch tells physics and method to forget the old one.
  void rebase(const Eigen::Vector3d& p_D, const Eigen::Vector3d& p_W) noexcept RTBUS_NONBLOCKING;

  /// The same mapping under a new epoch: whatever answers the old one is void.
  void renew() noexcept RTBUS_NONBLOCKING { ++epoch_; }

  [[nodiscard]] const MappingConfig& config() const noexcept { return config_; }
  [[nodiscard]] std::uint32_t epoch() const noexcept { return epoch_; }

 private:
  MappingConfig config_;
  Eigen::Matrix3d rotation_WD_;
  std::uint32_t epoch_;
};

}  // namespace haptic
