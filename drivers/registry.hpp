#pragma once
/// @file registry.hpp
/// Opens the device that a device file describes. One row per driver in registry.cpp.
#include <memory>
#include <span>
#include <string>
#include <string_view>

#include "drivers/device.hpp"
#include "rtbus/config/document.hpp"
#include "rtbus/segment.hpp"

namespace drivers {

/// What a driver may need to know besides its own file.
struct OpenContext {
  rtbus::Session session;  ///< For drivers that talk over the bus (a plant in its own process).
  std::string node_name;   ///< "haptic0"
  int loop_priority = 80;  ///< SCHED_FIFO priority of the loop; an I/O thread runs one above it.
  int loop_core = -1;      ///< Core of the loop; −1: the last one this process may use.
};

/// A checked device file, ready to be opened: reading the file and touching the hardware are two steps, so that a wrong
/// file is found before anything starts.
class DeviceConfig {
 public:
  virtual ~DeviceConfig() = default;
  /// Limits and model as the file gives them, before any hardware was asked.
  [[nodiscard]] virtual const DeviceInfo& info() const noexcept = 0;
  /// True when the driver wants a second process that must be started first (`process: own`).
  [[nodiscard]] virtual bool own_process() const noexcept { return false; }
  /// True when opening it maps libusb and starts an I/O thread.
  [[nodiscard]] virtual bool uses_usb() const noexcept { return false; }
  /// File name of a library, beside the programs, that the node's process must have in LD_PRELOAD; empty: none.
  [[nodiscard]] virtual std::string preload() const { return {}; }
  [[nodiscard]] virtual rtbus::Result<std::unique_ptr<Device>, DeviceFault> open(const OpenContext& context) const = 0;
};

struct DriverEntry {
  std::string_view name;         ///< `driver:` in the device file.
  std::string_view description;  ///< For lists.
  /// Reads the rest of the device file. Throws rtbus::config::Error.
  std::unique_ptr<DeviceConfig> (*parse)(rtbus::config::Map& file);
  std::string_view module = {};  ///< File that the driver lives in; empty: in the programs themselves.
};

/// All drivers of this build, in probing order.
[[nodiscard]] std::span<const DriverEntry> registered_drivers() noexcept;

/// False when the driver lives in a module that was not built or is not installed beside this program.
[[nodiscard]] bool driver_present(const DriverEntry& entry);

/// Reads a device file (`schema: device/1`, `driver: …`). Throws rtbus::config::Error.
[[nodiscard]] std::unique_ptr<DeviceConfig> parse_device(rtbus::config::Map& file);

}  // namespace drivers
