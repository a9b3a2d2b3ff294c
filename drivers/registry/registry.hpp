#pragma once
/// @file registry.hpp
/// Opens the device that a device file describes. One row per driver in registry.cpp.
#include <memory>
#include <span>
#include <string_view>
#include <vector>

#include "drivers/device_config.hpp"
#include "drivers/driver_module.hpp"
#include "rtbus/config/document.hpp"

namespace drivers {

/// One row of the table of drivers.
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
/// The same of a name; false for one that is not registered.
[[nodiscard]] bool driver_present(std::string_view name);

/// DriverModule::look of each maker's module that was built.
[[nodiscard]] std::vector<std::vector<Finding> (*)(bool load)> vendor_looks();

/// Reads a device file (`schema: device/1`, `driver: …`). Throws rtbus::config::Error.
[[nodiscard]] std::unique_ptr<DeviceConfig> parse_device(rtbus::config::Map& file);

}  // namespace drivers
