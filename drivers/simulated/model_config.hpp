#pragma once
/// @file model_config.hpp
/// The keys `model` and `limits` of a device file: what a device of that name promises. For the simulated device, and
/// for drivers that have no mechanics of their own.
#include "drivers/device.hpp"
#include "drivers/simulated/mechanics.hpp"
#include "drivers/simulated/models.hpp"
#include "rtbus/config/document.hpp"

namespace drivers::simulated {

/// Reads `model`; the first model when it is left out. Throws rtbus::config::Error.
[[nodiscard]] const Model& parse_model(rtbus::config::Map& file);

/// Reads the `limits:` map over what the model says. Throws rtbus::config::Error.
void parse_limits(rtbus::config::Map& map, MechanicsParameters& mechanics, DeviceInfo& info);

/// What the mechanics say about the device, into `info`.
void complete_info(const MechanicsParameters& mechanics, DeviceInfo& info);

/// Reads `model` and the optional `limits` alone. Throws rtbus::config::Error.
[[nodiscard]] DeviceInfo parse_model_info(rtbus::config::Map& file);

}  // namespace drivers::simulated
