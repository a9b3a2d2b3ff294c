#pragma once
/// @file driver_module.hpp
/// What the module of the replay driver, libdrivers_replay.so, exports. Nothing else of a node maps HDF5.
#include <memory>

#include "drivers/device_config.hpp"
#include "drivers/module_loader.hpp"
#include "rtbus/config/document.hpp"

namespace drivers::replay {

struct ReplayModule {
  ModuleHead head;
  std::unique_ptr<DeviceConfig> (*parse)(rtbus::config::Map& file);
};

/// Raise its version when DeviceConfig, Device, DeviceInfo, OpenContext or the table change.
inline constexpr ModuleFile kReplayModule{"libdrivers_replay.so", "rtbus_replay_driver", 4,
                                          "build with RTBUS_WITH_HDF5=ON (Debian package libhdf5-dev)"};

}  // namespace drivers::replay
