#pragma once
/// @file driver_module.hpp
/// What a driver that lives in a shared module of its own exports. The drivers of vendors' devices are such modules,
/// and so is a driver that is built outside this source tree (docs/writing-a-driver.md):
///
///     RTBUS_DRIVER_MODULE("mydevice", "My lab's three-axis arm", &mydevice::parse)
///
/// A module carries C++ types: it belongs to the version of rtbus, and to the kind of compiler, that it was built with.
/// The program checks kDriverAbiVersion and the sizes before it calls anything else. A module is never unloaded.
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "drivers/device.hpp"
#include "drivers/device_config.hpp"
#include "rtbus/config/document.hpp"

namespace drivers {

/// Begins the table of every module.
struct ModuleHead {
  std::uint32_t abi_version;                      ///< Of the table behind it, and of what it leads to.
  std::uint32_t info_bytes = sizeof(DeviceInfo);  ///< As the module saw it: catches a forgotten version.
};

/// Raised when Device, DeviceConfig, DeviceInfo, DeviceSample, OpenContext, config::Map or DriverModule change.
inline constexpr std::uint32_t kDriverAbiVersion = 2;

/// One thing that a vendor's device needs on this machine: for `rtbus devices` and `rtbus doctor`.
struct Finding {
  std::string what;    ///< "library libdrd"
  bool ok = false;     ///< False: a device of this vendor cannot work so.
  std::string state;   ///< "SDK 3.16.1", "not installed", …
  std::string remedy;  ///< What to do; empty: nothing.
};

struct DriverModule {
  ModuleHead head;
  const char* name;         ///< `driver:` in messages.
  const char* description;  ///< One line for lists.
  /// Reads a device file after `schema` and `driver`; touches no hardware. Throws rtbus::config::Error.
  std::unique_ptr<DeviceConfig> (*parse)(rtbus::config::Map& file);
  /// Looks what this machine has for the driver's devices. `load`: may map the vendor's library, or ask its service,
  /// and ask devices that nobody uses who they are. Null: there is nothing to look for.
  std::vector<Finding> (*look)(bool load) = nullptr;
};

/// Of the C function that returns the table.
inline constexpr char kDriverModuleSymbol[] = "rtbus_driver_module";

}  // namespace drivers

/// Defines the module's one export. Once per module, outside any namespace; `parse` and `look` as in DriverModule.
#define RTBUS_DRIVER_MODULE_LOOK(name, description, parse, look)                                             \
  extern "C" __attribute__((visibility("default"))) const drivers::ModuleHead* rtbus_driver_module() {       \
    static const drivers::DriverModule module{{drivers::kDriverAbiVersion}, name, description, parse, look}; \
    return &module.head;                                                                                     \
  }
#define RTBUS_DRIVER_MODULE(name, description, parse) RTBUS_DRIVER_MODULE_LOOK(name, description, parse, nullptr)
