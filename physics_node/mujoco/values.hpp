#pragma once
/// @file values.hpp
/// MuJoCo's arrays as vectors, and vectors as fields of rtbus_engine.h.
#include <algorithm>

#include <Eigen/Geometry>

namespace mujoco {

using ConstVector = Eigen::Map<const Eigen::Vector3d>;
using MutableVector = Eigen::Map<Eigen::Vector3d>;

/// A structure of rtbus_engine.h, empty.
template <class T>
T sized() {
  T out{};
  out.struct_bytes = sizeof out;
  return out;
}
inline void put(const Eigen::Vector3d& from, double (&out)[3]) { std::copy_n(from.data(), 3, out); }
inline void put(const Eigen::Quaterniond& from, double (&out)[4]) {
  out[0] = from.w(), out[1] = from.x(), out[2] = from.y(), out[3] = from.z();
}

}  // namespace mujoco
