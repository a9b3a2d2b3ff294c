#pragma once
/// @file registry.hpp
/// The virtual USB devices of this build, one row each in registry.cpp. `usb: {virtual: …}` in a device file and
/// `rtbus virtual-device KIND` make them.
#include <functional>
#include <memory>
#include <span>
#include <string>
#include <string_view>

#include "drivers/virtual_usb/usb_device.hpp"
#include "rtbus/config/document.hpp"

namespace drivers::virtual_usb {

/// A device and the faults that its binding has to play (unplug, replug). The model gets the same faults.
struct VirtualDevice {
  std::unique_ptr<UsbDevice> device;
  Faults faults;
};

/// Makes a fresh, powered-up device. Time zero of the device is the first time it is handed.
using DeviceMaker = std::function<VirtualDevice()>;

struct Kind {
  std::string_view name;         ///< "falcon"
  std::string_view description;  ///< One line for people.
  /// Reads and checks the settings of the model, touches nothing else. finish() is called by the caller. A hand script
  /// is the map behind `hand` (written in place or in a file), faults are the map behind `faults`.
  /// Throws rtbus::config::Error.
  DeviceMaker (*parse)(rtbus::config::Map& settings);
};

[[nodiscard]] std::span<const Kind> kinds() noexcept;
/// Null when there is no row of that name.
[[nodiscard]] const Kind* find_kind(std::string_view name) noexcept;

/// Reads the map `faults` (lose_reply, late_reply, late_ms, … as in Faults), if it is there. For the rows' parsers.
[[nodiscard]] Faults parse_faults(rtbus::config::Map& settings);

}  // namespace drivers::virtual_usb
