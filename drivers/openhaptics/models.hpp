#pragma once
/// @file models.hpp
/// The devices that OpenHaptics drives, and their limits; models.cpp names the source of each number.
#include <span>
#include <string_view>

#include "drivers/device.hpp"

namespace drivers::openhaptics {

struct Model {
  std::string_view name;        ///< `model:` in the device file.
  std::string_view model_type;  ///< What the library calls it; empty: not known.
  DeviceInfo limits;
};

[[nodiscard]] std::span<const Model> models();

}  // namespace drivers::openhaptics
