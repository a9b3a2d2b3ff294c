#pragma once
/// @file phantom_config.hpp
/// The device file of a PHANToM-class device (`driver: phantom`), checked. Every key is explained in
/// config/devices/vintage_phantom.yaml.
#include <memory>

#include "drivers/device_config.hpp"
#include "drivers/phantom/phantom_protocol.hpp"
#include "drivers/virtual_usb/kind.hpp"
#include "rtbus/config/document.hpp"

namespace drivers::phantom {

inline constexpr std::uint16_t kVendorId = 0x16c0;  // PJRC's, shared by every Teensy program
inline constexpr std::uint16_t kProductId = 0x0483;

/// What the device file says, besides what all USB drivers have in common.
struct PhantomFile {
  PhantomSettings settings;
  DeviceInfo info;
  bool fetch_first = true;  ///< Two exchanges per period; see usb::IoSettings.
};

/// Reads the driver's own keys. Throws rtbus::config::Error.
[[nodiscard]] PhantomFile read_file(rtbus::config::Map& file);

/// Reads what follows `schema` and `driver` in a device file; see usb::parse_open_options(). Throws
/// rtbus::config::Error.
[[nodiscard]] std::unique_ptr<DeviceConfig> parse(rtbus::config::Map& file, const virtual_usb::Kind* virtual_kind);

/// How the board on this channel is; see PhantomProtocol::inspect().
[[nodiscard]] usb::Inspection inspect(usb::Channel& channel);

}  // namespace drivers::phantom
