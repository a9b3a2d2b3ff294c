#pragma once
/// @file device_keys.hpp
/// What the device files of all vendors' devices have in common.
#include "drivers/device.hpp"
#include "rtbus/config/document.hpp"

namespace drivers::vendor {

/// Reads the optional map `limits` over what the model says. `max_force_n` may lower the model's, not raise it.
/// Throws rtbus::config::Error.
void read_limits(rtbus::config::Map& file, DeviceInfo& info);

}  // namespace drivers::vendor
