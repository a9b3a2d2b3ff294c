#pragma once
/// @file models.hpp
/// The devices that the simulation knows by name: mechanics and limits, each number with its source in models.cpp.
#include <span>
#include <string_view>

#include "drivers/device.hpp"
#include "drivers/simulated/mechanics.hpp"

namespace drivers::simulated {

struct Model {
  std::string_view name;  ///< `model:` in the device file.
  MechanicsParameters mechanics;
  /// Only what the mechanics do not say: continuous force, slew, stiffness, speed, thermal constant.
  DeviceInfo limits;
};

/// All models; the first is the default.
[[nodiscard]] std::span<const Model> models();

}  // namespace drivers::simulated
