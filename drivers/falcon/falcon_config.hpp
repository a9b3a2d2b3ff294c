#pragma once
/// @file falcon_config.hpp
/// The device file of a Novint Falcon (`driver: falcon`). Every key is explained in config/devices/falcon.yaml.
#include <memory>

#include "drivers/device_config.hpp"
#include "drivers/falcon/falcon_protocol.hpp"
#include "drivers/virtual_usb/kind.hpp"
#include "rtbus/config/document.hpp"

namespace drivers::falcon {

/// A checked device file, without what concerns USB.
struct FalconFile {
  FalconSettings settings;
  DeviceInfo info;
};

/// Reads the keys that are the Falcon's own, and its firmware file. Throws rtbus::config::Error.
[[nodiscard]] FalconFile read_settings(rtbus::config::Map& file);

/// The row of the module of USB drivers; see usb::parse_open_options(). Throws rtbus::config::Error.
[[nodiscard]] std::unique_ptr<DeviceConfig> parse(rtbus::config::Map& file, const virtual_usb::Kind* virtual_kind);

/// How a Falcon on this channel is; see FalconProtocol::inspect().
[[nodiscard]] usb::Inspection inspect(usb::Channel& channel);

}  // namespace drivers::falcon
