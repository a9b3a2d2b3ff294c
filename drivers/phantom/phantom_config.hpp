#pragma once
/// @file phantom_config.hpp
/// The device file of a PHANToM-class device (`driver: phantom`), checked. Every key is explained in
/// config/devices/vintage_phantom.yaml.
#include <memory>

#include "drivers/phantom/phantom_protocol.hpp"
#include "drivers/registry.hpp"
#include "rtbus/config/document.hpp"

namespace drivers::phantom {

/// What the device file says, besides what all USB drivers have in common.
struct PhantomFile {
  PhantomSettings settings;
  DeviceInfo info;
  bool fetch_first = true;  ///< Two exchanges per period; see usb::IoSettings.
};

/// Reads the driver's own keys. Throws rtbus::config::Error.
[[nodiscard]] PhantomFile read_file(rtbus::config::Map& file);

/// Reads what follows `schema` and `driver` in a device file. Throws rtbus::config::Error.
[[nodiscard]] std::unique_ptr<DeviceConfig> parse(rtbus::config::Map& file);

}  // namespace drivers::phantom
