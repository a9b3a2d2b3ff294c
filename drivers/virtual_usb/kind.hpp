#pragma once
/// @file kind.hpp
/// One kind of emulated USB device, as its maker sees it. The kinds of this build:
/// drivers/virtual_devices/kinds.hpp.
#include <functional>
#include <memory>
#include <string>
#include <string_view>

#include "drivers/virtual_usb/usb_device.hpp"
#include "rtbus/config/document.hpp"
#include "rtbus/segment.hpp"

namespace drivers::virtual_usb {

class UsbfsPort;

/// When faults act.
struct FaultTimes {
  /// Faults act while this file exists, and times count from its coming. It may come again. Empty: from power-up.
  std::string trigger;
  double for_s = -1.0;  ///< After the trigger [s]; < 0: for ever. What was unplugged is not meant.
};

/// A device and the faults that its binding has to play (unplug, replug). The model gets the same faults.
struct VirtualDevice {
  std::unique_ptr<UsbDevice> device;
  Faults faults;
  /// Somebody at its bench, as long as the object that this makes; empty: nobody. The port outlives it.
  std::function<std::shared_ptr<void>(UsbfsPort& port, const rtbus::Session& session, const std::string& node)> watch{};
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

/// Reads the map `faults` (lose_reply, late_reply, late_ms, … as in Faults; trigger and for_s), if it is there. For the
/// parsers of the kinds.
[[nodiscard]] Faults parse_faults(rtbus::config::Map& settings, FaultTimes& times);

}  // namespace drivers::virtual_usb
