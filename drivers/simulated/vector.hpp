#pragma once
/// @file vector.hpp
/// Between the plain arrays of the device interface and Eigen, which the mechanics compute with.
#include <Eigen/Core>

#include "drivers/device.hpp"

namespace drivers::simulated {

[[nodiscard]] inline Eigen::Vector3d to_eigen(const Vec3& v) noexcept { return {v[0], v[1], v[2]}; }
[[nodiscard]] inline Vec3 to_array(const Eigen::Vector3d& v) noexcept { return {v.x(), v.y(), v.z()}; }

}  // namespace drivers::simulated
