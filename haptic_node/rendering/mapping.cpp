#include "haptic_node/rendering/mapping.hpp"

namespace haptic {

Mapping::Mapping(const MappingConfig& config, std::uint32_t first_epoch) noexcept
    : config_(config), rotation_WD_(config.q_WD.normalized().toRotationMatrix()), epoch_(first_epoch) {}

Eigen::Vector3d Mapping::position_to_world(const Eigen::Vector3d& p_D) const noexcept {
  return config_.offset_m + config_.position_scale * (rotation_WD_ * p_D);
}

Eigen::Vector3d Mapping::velocity_to_world(const Eigen::Vector3d& v_D) const noexcept {
  return config_.position_scale * (rotation_WD_ * v_D);
}

Eigen::Quaterniond Mapping::orientation_to_world(const Eigen::Quaterniond& q_DT) const noexcept {
  return config_.q_WD * q_DT;
}

Eigen::Vector3d Mapping::position_to_device(const Eigen::Vector3d& p_W) const noexcept {
  return rotation_WD_.transpose() * (p_W - config_.offset_m) / config_.position_scale;
}

Eigen::Vector3d Mapping::velocity_to_device(const Eigen::Vector3d& v_W) const noexcept {
  return rotation_WD_.transpose() * v_W / config_.position_scale;
}

Eigen::Vector3d Mapping::force_to_world(const Eigen::Vector3d& f_D) const noexcept {
  return config_.force_scale * (rotation_WD_ * f_D);
}

Eigen::Vector3d Mapping::force_to_device(const Eigen::Vector3d& f_W) const noexcept {
  return rotation_WD_.transpose() * f_W / config_.force_scale;
}

void Mapping::rebase(const Eigen::Vector3d& p_D, const Eigen::Vector3d& p_W) noexcept {
  config_.offset_m += p_W - position_to_world(p_D);
  ++epoch_;
}

}  // namespace haptic
