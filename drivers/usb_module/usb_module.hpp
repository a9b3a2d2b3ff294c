#pragma once
/// @file usb_module.hpp
/// What the module of the USB drivers, libdrivers_usb.so, exports. It is loaded by dlopen when a device file names one
/// of its drivers, or for `rtbus devices`, so that nothing else maps libusb. Like an engine's module it carries C++
/// types and belongs to the build it was made with; it is never unloaded.
#include <cstdint>
#include <cstdio>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "drivers/device_config.hpp"
#include "drivers/module_loader.hpp"
#include "drivers/usb/inspection.hpp"
#include "drivers/virtual_usb/kind.hpp"
#include "rtbus/config/document.hpp"

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
  std::string in_use_by;      ///< "haptic_node (pid 4711)"; empty: nobody whom this user may see.
  bool asked = false;         ///< `says` is what it answered just now.
  std::string not_asked;      ///< Why it was not asked.
  Inspection says;
  std::string remedy;  ///< What to do, if anything.

  [[nodiscard]] std::string usb_id() const {  ///< "0403:cb48"
    char text[16];
    std::snprintf(text, sizeof text, "%04x:%04x", vendor_id, product_id);
    return text;
  }
  /// `id` is its VID:PID, its serial number, both ("0403:cb48:VF000001"), or the name of its driver.
  [[nodiscard]] bool is(std::string_view id) const {
    std::string low(id.substr(0, 9));  // of the USB id: written either way
    for (char& c : low) c = c >= 'A' && c <= 'F' ? static_cast<char>(c - 'A' + 'a') : c;
    const bool same_id = low == usb_id();
    return id == driver || (!serial.empty() && id == serial) || (same_id && id.size() == low.size()) ||
           (same_id && id.size() > 10 && id[9] == ':' && id.substr(10) == serial);
  }
};

struct ListRequest {
  bool ask = false;                                  ///< Ask devices that nobody uses how they are.
  std::string named;                                 ///< The ID that the user has named; empty: none. See FoundDevice.
  std::vector<const DeviceConfig*> virtual_devices;  ///< Device files with `usb: {virtual: …}`, as if plugged in.
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
inline constexpr std::uint32_t kUsbAbiVersion = 4;

struct UsbModule {
  ModuleHead head;  ///< First, whatever else changes.
  const UsbDriver* drivers;
  std::size_t driver_count;
  FoundDevices (*list)(const ListRequest& request);
  /// Opens the device of a USB driver's file for being asked. The fault is a sentence for the user.
  rtbus::Result<std::unique_ptr<Probe>, DeviceFault> (*probe)(const DeviceConfig& config);
  /// Encoder counts at a position of the tip; none where the driver cannot say.
  std::optional<Vec3> (*joint_counts)(const DeviceConfig& config, const Vec3& position_m);
  const virtual_usb::Kind* (*find_kind)(std::string_view name);
  std::vector<std::string> (*kind_names)();
};

inline constexpr char kUsbModuleSymbol[] = "rtbus_usb_drivers";
inline constexpr char kUsbModuleFile[] = "libdrivers_usb.so";

/// Loads the module, once per process. The text of the failure says what is missing and how to get it.
/// In the programs, not in the module.
[[nodiscard]] rtbus::Result<const UsbModule*, std::string> load_usb_module();

}  // namespace drivers::usb
