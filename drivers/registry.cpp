#include "drivers/registry.hpp"

#include <algorithm>
#include <array>
#include <vector>

#include "drivers/replay/driver_module.hpp"
#include "drivers/simulated/simulated_config.hpp"
#include "drivers/usb/driver_module.hpp"

namespace drivers {
namespace {

/// The row of a loaded module; null when it has none of that name.
const usb::UsbDriver* find_usb_driver(const usb::UsbModule& module, std::string_view name) {
  for (std::size_t i = 0; i < module.driver_count; ++i) {
    if (module.drivers[i].name == name) return &module.drivers[i];
  }
  return nullptr;
}

std::unique_ptr<DeviceConfig> parse_usb(std::string_view name, rtbus::config::Map& file) {
  const auto module = usb::load_usb_module();
  if (!module) file.fail("driver", module.error());
  const usb::UsbDriver* const driver = find_usb_driver(**module, name);
  if (driver == nullptr) {
    file.fail("driver", std::string("is not in ") + usb::kUsbModuleFile + " of this build; build it anew");
  }
  return driver->parse(file);
}

std::unique_ptr<DeviceConfig> parse_replay(rtbus::config::Map& file) {
  const auto module = load_module<replay::ReplayModule>(replay::kReplayModule);
  if (!module) file.fail("driver", module.error());
  return (*module)->parse(file);
}

// In probing order. A new driver is one row here and one folder; one over USB has a row in drivers/usb/module.cpp too.
constexpr std::array kDrivers{
    DriverEntry{"simulated", "Simulated mechanics with a scripted hand, no hardware", &simulated::parse},
    DriverEntry{"falcon", "Novint Falcon, over USB", [](rtbus::config::Map& file) { return parse_usb("falcon", file); },
                usb::kUsbModuleFile},
    DriverEntry{"phantom", "PHANToM-class arms with Teensy electronics, over USB",
                [](rtbus::config::Map& file) { return parse_usb("phantom", file); }, usb::kUsbModuleFile},
    DriverEntry{"replay", "The hand's motion out of a recording, no hardware", &parse_replay,
                replay::kReplayModule.file},
};

}  // namespace

std::span<const DriverEntry> registered_drivers() noexcept { return kDrivers; }

bool driver_present(const DriverEntry& entry) {
  if (entry.module.empty()) return true;
  if (entry.module == replay::kReplayModule.file) return load_module_head(replay::kReplayModule).has_value();
  const auto module = usb::load_usb_module();
  return module && find_usb_driver(**module, entry.name) != nullptr;
}

std::unique_ptr<DeviceConfig> parse_device(rtbus::config::Map& file) {
  (void)file.choice("schema", {"device/1"});
  std::vector<std::string> names;
  for (const DriverEntry& driver : kDrivers) names.emplace_back(driver.name);
  const std::string name = file.choice("driver", names);
  const auto* driver =
      std::find_if(kDrivers.begin(), kDrivers.end(), [&](const DriverEntry& entry) { return entry.name == name; });
  std::unique_ptr<DeviceConfig> config = driver->parse(file);
  file.finish();
  return config;
}

}  // namespace drivers
