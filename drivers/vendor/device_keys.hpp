#pragma once
/// @file device_keys.hpp
/// What the device files of all vendors' devices have in common.
#include <string>
#include <string_view>
#include <vector>

#include "drivers/device.hpp"
#include "drivers/device_config.hpp"
#include "rtbus/config/document.hpp"

namespace drivers::vendor {

/// "session wall, node haptic0", for those who want the same device.
[[nodiscard]] std::string owner_name(const OpenContext& context);

/// Reads `model`, one of `names`. A model of another vendor's driver is refused with the name of that driver. Throws
/// rtbus::config::Error.
[[nodiscard]] std::string read_model(rtbus::config::Map& file, const std::vector<std::string>& names);

/// The drivers of vendors' devices and the models of each, for that message.
struct DriverModels {
  std::string_view driver;
  std::vector<std::string_view> models;
};
[[nodiscard]] const std::vector<DriverModels>& models_of_vendors();

/// Reads the optional map `limits` over what the model says. `max_force_n` may lower the model's, not raise it.
/// Throws rtbus::config::Error.
void read_limits(rtbus::config::Map& file, DeviceInfo& info);

}  // namespace drivers::vendor
