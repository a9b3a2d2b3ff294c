#pragma once
/// @file frame.hpp
/// Between the maker's frame (x to the user, y right, z up) and D (x right, y up, z to the user): D = (y, z, x).
#include <Eigen/Geometry>

#include "drivers/device.hpp"

namespace drivers::force_dimension {

[[nodiscard]] inline Vec3 from_maker(const Vec3& v) noexcept { return {v[1], v[2], v[0]}; }
[[nodiscard]] inline Vec3 to_maker(const Vec3& v) noexcept { return {v[2], v[0], v[1]}; }

/// A rotation, given by its matrix in the maker's frame: R_D = P·R·Pᵀ. (w, x, y, z).
[[nodiscard]] inline Quat from_maker(const double (&frame)[3][3]) noexcept {
  constexpr int kFrom[3] = {1, 2, 0};
  Eigen::Matrix3d turned;
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 3; ++column) turned(row, column) = frame[kFrom[row]][kFrom[column]];
  }
  const Eigen::Quaterniond q = Eigen::Quaterniond(turned).normalized();
  return {q.w(), q.x(), q.y(), q.z()};
}

}  // namespace drivers::force_dimension
