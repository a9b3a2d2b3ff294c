#pragma once
/// @file replay_config.hpp
/// `driver: replay`: the hand's motion comes from a recording, so that methods are compared on the same motion.
#include <memory>

#include "drivers/device_config.hpp"
#include "rtbus/config/document.hpp"

namespace drivers::replay {

/// Reads the keys `file`, `topic`, `from_s`, `to_s`, `model`, `limits`, and looks whether the recording has the motion;
/// it is loaded when the device is opened.
/// Throws rtbus::config::Error.
[[nodiscard]] std::unique_ptr<DeviceConfig> parse(rtbus::config::Map& file);

}  // namespace drivers::replay
