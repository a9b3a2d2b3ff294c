#pragma once
/// @file vendor_devices.hpp
/// Devices that are reached through their makers' libraries or services: what of them is plugged in, by the kernel's
/// own list, and what this machine has installed for them. Nothing of a maker is mapped unless asked for.
#include <memory>
#include <string>
#include <vector>

#include "drivers/driver_module.hpp"
#include "drivers/usb_module/usb_module.hpp"

namespace tools {

/// Devices on the bus with USB ids of such makers, and whether this user may open them and their serial ports and HID
/// nodes, from /sys/bus/usb/devices below `root` ("" but in tests).
[[nodiscard]] std::vector<drivers::usb::FoundDevice> vendor_devices_on_bus(const std::string& root = "");

/// Adds them to a list that may contain them already, without a driver.
void add_vendor_devices(std::vector<drivers::usb::FoundDevice>& devices);

/// The stand-in of a device file, as if plugged in.
[[nodiscard]] drivers::usb::FoundDevice describe_stand_in(const drivers::DeviceConfig& config,
                                                          const std::string& driver);

/// Who may open what is on the bus (`root` as above), and what each maker's module finds on this machine; maps their
/// libraries and asks their devices.
[[nodiscard]] std::vector<drivers::Finding> vendor_findings(const std::string& root = "");

}  // namespace tools
