#pragma once
/// @file vector3.hpp
/// A value of three numbers, for example `position_m: [0, 0.1, 0]`. Both throw Error, as Map::numbers() does.
#include <string_view>
#include <vector>

#include <Eigen/Core>

#include "rtbus/config/document.hpp"

namespace rtbus::config {

[[nodiscard]] inline Eigen::Vector3d read_vector3(Map& map, std::string_view key, Range range) {
  const std::vector<double> v = map.numbers(key, 3, range);
  return {v[0], v[1], v[2]};
}

[[nodiscard]] inline Eigen::Vector3d read_vector3(Map& map, std::string_view key, Range range,
                                                  const Eigen::Vector3d& fallback) {
  return map.has(key) ? read_vector3(map, key, range) : fallback;
}

}  // namespace rtbus::config
