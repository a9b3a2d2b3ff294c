#pragma once
/// @file eigen.hpp
/// Between the arrays that samples carry (Vec3, Quat) and Eigen, which the nodes compute with. @realtime Yes, all of
/// it. Needs Eigen, which nothing else of the bus does.
#include <Eigen/Core>
#include <Eigen/Geometry>

#include "rtbus/messages.hpp"

namespace rtbus {

[[nodiscard]] inline Eigen::Vector3d vector_of(const Vec3& v) noexcept { return {v[0], v[1], v[2]}; }
[[nodiscard]] inline Vec3 array_of(const Eigen::Vector3d& v) noexcept { return {v.x(), v.y(), v.z()}; }

/// Both orders are (w, x, y, z).
[[nodiscard]] inline Eigen::Quaterniond quaternion_of(const Quat& q) noexcept { return {q[0], q[1], q[2], q[3]}; }
[[nodiscard]] inline Quat array_of(const Eigen::Quaterniond& q) noexcept { return {q.w(), q.x(), q.y(), q.z()}; }

}  // namespace rtbus
