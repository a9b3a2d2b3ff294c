#pragma once
/// @file kind.hpp
/// One kind of emulated USB device, as its maker sees it. The kinds of this build:
/// drivers/virtual_devices/kinds.hpp.
#include <functional>
#include <memory>
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

/// Reads the map `faults` (lose_reply, late_reply, late_ms, … as in Faults), if it is there. For the parsers of the
/// kinds.
[[nodiscard]] Faults parse_faults(rtbus::config::Map& settings);

}  // namespace drivers::virtual_usb
