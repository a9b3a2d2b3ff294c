#pragma once
/// @file driver_module.hpp
/// What the module of the USB drivers, libdrivers_usb.so, exports. It is loaded by dlopen when a device file names one
/// of its drivers, or for `rtbus devices`, so that nothing else maps libusb. Like an engine's module it carries C++
/// types and belongs to the build it was made with; it is never unloaded.
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "drivers/module_loader.hpp"
#include "drivers/registry.hpp"
#include "drivers/virtual_usb/registry.hpp"

namespace drivers::usb {

/// A device on the bus, for people.
struct FoundDevice {
  std::uint16_t vendor_id = 0;
  std::uint16_t product_id = 0;
  std::string serial;  ///< Empty: none, or not readable.
  std::string product;
  std::string node;           ///< "/dev/bus/usb/001/002"
  std::string driver;         ///< The `driver:` that takes it; empty: none of ours.
  std::string kernel_driver;  ///< That has an interface now; empty: none.
  bool permitted = false;     ///< This user may open it.
  std::string remedy;         ///< What to do, if anything.
};

struct FoundDevices {
  std::vector<FoundDevice> devices;
  std::string problem;  ///< Why the bus could not be looked at; empty: it could.
};

struct UsbDriver {
  const char* name;  ///< `driver:` in the device file.
  std::uint16_t vendor_id;
  std::uint16_t product_id;
  std::unique_ptr<DeviceConfig> (*parse)(rtbus::config::Map& file);
};

/// Raise it when DeviceConfig, Device, DeviceInfo, OpenContext or this table change.
inline constexpr std::uint32_t kUsbAbiVersion = 2;

struct UsbModule {
  ModuleHead head;  ///< First, whatever else changes.
  const UsbDriver* drivers;
  std::size_t driver_count;
  FoundDevices (*list)();
  const virtual_usb::Kind* (*find_kind)(std::string_view name);
  std::vector<std::string> (*kind_names)();
};

inline constexpr char kUsbModuleSymbol[] = "rtbus_usb_drivers";
inline constexpr char kUsbModuleFile[] = "libdrivers_usb.so";

/// Loads the module, once per process. The text of the failure says what is missing and how to get it.
/// In the programs, not in the module.
[[nodiscard]] rtbus::Result<const UsbModule*, std::string> load_usb_module();

}  // namespace drivers::usb
