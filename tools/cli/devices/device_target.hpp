#pragma once
/// @file device_target.hpp
/// The device that a user names on the command line: by its device file, or by an ID that `rtbus devices` prints.
#include <memory>
#include <string>
#include <vector>

#include "drivers/registry/registry.hpp"
#include "drivers/usb_module/usb_module.hpp"
#include "rtbus/command_line/command_line.hpp"
#include "rtbus/result.hpp"

namespace tools {

struct TargetOptions {
  std::string device;                      ///< File or ID.
  std::vector<std::string> assignments;    ///< --set, as given.
  std::vector<std::string> virtual_files;  ///< --virtual: device files whose virtual devices count as plugged in.
};

/// Adds DEVICE, --set and --virtual to a command.
void add_target_options(rtbus::Command command, TargetOptions& options);

struct DeviceTarget {
  std::string file;  ///< The device file; of a device that was found by its ID a name for people.
  std::string yaml;  ///< What stands in it, before --set.
  std::unique_ptr<drivers::DeviceConfig> config;
};

/// Reads the file, or looks for the device and makes the file that its driver needs at least. When the device is a
/// virtual one, this program is started once more with the library that it needs, and the call does not return.
/// Throws rtbus::config::Error. The failure is a sentence for the user.
[[nodiscard]] rtbus::Result<DeviceTarget, std::string> find_target(const TargetOptions& options);

/// The device files of --virtual, read. Throws rtbus::config::Error, also for one without a virtual device.
[[nodiscard]] std::vector<std::unique_ptr<drivers::DeviceConfig>> read_virtual_files(
    const std::vector<std::string>& files);

/// What is plugged in: the USB drivers' devices, and those behind makers' libraries, which are not asked. With
/// `virtual_files` the virtual devices of these instead, one per file in their order. Throws rtbus::config::Error.
[[nodiscard]] drivers::usb::FoundDevices find_devices(drivers::usb::ListRequest request,
                                                      const std::vector<std::string>& virtual_files);

/// start(), which Ctrl-C ends.
[[nodiscard]] rtbus::Result<void, drivers::DeviceFault> start_device(drivers::Device& device);

}  // namespace tools
