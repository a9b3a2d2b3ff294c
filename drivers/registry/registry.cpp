#include "drivers/registry/registry.hpp"

#include <algorithm>
#include <array>
#include <cstdlib>
#include <filesystem>
#include <map>
#include <sstream>
#include <string>
#include <vector>

#include "drivers/replay/driver_module.hpp"
#include "drivers/simulated/simulated_config.hpp"
#include "drivers/usb_module/driver_module.hpp"

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
    file.fail("driver", std::string("is not in ") + usb::kUsbModuleFile + " of this build; build it again");
  }
  return driver->parse(file);
}

std::unique_ptr<DeviceConfig> parse_replay(rtbus::config::Map& file) {
  const auto module = load_module<replay::ReplayModule>(replay::kReplayModule);
  if (!module) file.fail("driver", module.error());
  return (*module)->parse(file);
}

/// The module of a vendor's device, all of one kind.
constexpr ModuleFile vendor_module(const char* file) {
  return {file, kDriverModuleSymbol, kDriverAbiVersion, "build it: it needs nothing of the vendor"};
}
constexpr ModuleFile kForceDimension = vendor_module("libdrivers_force_dimension.so");
constexpr ModuleFile kOpenHaptics = vendor_module("libdrivers_openhaptics.so");
constexpr ModuleFile kHaply{"libdrivers_haply.so", kDriverModuleSymbol, kDriverAbiVersion,
                            "build with RTBUS_WITH_HAPLY=ON (Debian package libwebsockets-dev)"};
constexpr std::array kVendorModules{kForceDimension, kOpenHaptics, kHaply};

template <const ModuleFile& module>
std::unique_ptr<DeviceConfig> parse_vendor(rtbus::config::Map& file) {
  const auto table = load_module<DriverModule>(module);
  if (!table) file.fail("driver", table.error());
  return (*table)->parse(file);
}

/// A driver that was built outside this source tree.
std::unique_ptr<DeviceConfig> parse_foreign(const std::string& module, rtbus::config::Map& file) {
  const auto table = load_module<DriverModule>(
      {module.c_str(), kDriverModuleSymbol, kDriverAbiVersion, "name a driver module (docs/writing-a-driver.md)"});
  if (!table) file.fail("driver", table.error());
  return (*table)->parse(file);
}

/// Modules in the folders of $RTBUS_DRIVER_PATH, by the name of their driver: libNAME.so or NAME.so.
std::map<std::string, std::string> drivers_on_path() {
  std::map<std::string, std::string> out;
  const char* const path = std::getenv("RTBUS_DRIVER_PATH");
  std::istringstream folders(path == nullptr ? "" : path);
  for (std::string folder; std::getline(folders, folder, ':');) {
    std::error_code failed;
    for (const auto& entry : std::filesystem::directory_iterator(folder, failed)) {
      std::string name = entry.path().stem().string();
      if (entry.path().extension() != ".so") continue;
      if (name.starts_with("lib")) name.erase(0, 3);
      out.emplace(name, std::filesystem::absolute(entry.path()).string());  // the first folder wins
    }
  }
  return out;
}

// In probing order. A new driver is one row here and one folder; one over USB has a row in
// drivers/usb_module/module.cpp too.
constexpr std::array kDrivers{
    DriverEntry{"simulated", "Simulated mechanics with a scripted hand, no hardware", &simulated::parse},
    DriverEntry{"falcon", "Novint Falcon, over USB", [](rtbus::config::Map& file) { return parse_usb("falcon", file); },
                usb::kUsbModuleFile},
    DriverEntry{"phantom", "PHANToM-class arms with Teensy electronics, over USB",
                [](rtbus::config::Map& file) { return parse_usb("phantom", file); }, usb::kUsbModuleFile},
    DriverEntry{"replay", "The hand's motion out of a recording, no hardware", &parse_replay,
                replay::kReplayModule.file},
    DriverEntry{"force_dimension", "Force Dimension omega, delta, sigma, lambda, by the maker's SDK",
                &parse_vendor<kForceDimension>, kForceDimension.file},
    DriverEntry{"openhaptics", "3D Systems Touch and SensAble PHANToM, by the maker's OpenHaptics",
                &parse_vendor<kOpenHaptics>, kOpenHaptics.file},
    DriverEntry{"haply", "Haply Inverse3 and VerseGrip, by the maker's Inverse Service", &parse_vendor<kHaply>,
                kHaply.file},
};

}  // namespace

std::span<const DriverEntry> registered_drivers() noexcept { return kDrivers; }

bool driver_present(const DriverEntry& entry) {
  if (entry.module.empty()) return true;
  if (entry.module == replay::kReplayModule.file) return load_module_head(replay::kReplayModule).has_value();
  for (const ModuleFile& vendor : kVendorModules) {
    if (entry.module == vendor.file) return load_module_head(vendor).has_value();
  }
  const auto module = usb::load_usb_module();
  return module && find_usb_driver(**module, entry.name) != nullptr;
}

std::vector<std::vector<Finding> (*)(bool)> vendor_looks() {
  std::vector<std::vector<Finding> (*)(bool)> out;
  for (const ModuleFile& vendor : kVendorModules) {
    const auto table = load_module<DriverModule>(vendor);
    if (table && (*table)->look != nullptr) out.push_back((*table)->look);
  }
  return out;
}

std::unique_ptr<DeviceConfig> parse_device(rtbus::config::Map& file) {
  (void)file.choice("schema", {"device/1"});
  std::unique_ptr<DeviceConfig> config;
  if (file.has_map("driver")) {
    rtbus::config::Map driver = file.map("driver");
    config = parse_foreign(driver.existing_file("module"), file);
    driver.finish();
  } else {
    const auto foreign = drivers_on_path();
    std::vector<std::string> names;
    names.reserve(std::size(kDrivers) + foreign.size());
    for (const DriverEntry& driver : kDrivers) names.emplace_back(driver.name);
    for (const auto& [name, module] : foreign) names.push_back(name);
    const std::string name = file.choice("driver", names);
    const auto* driver =
        std::find_if(kDrivers.begin(), kDrivers.end(), [&](const DriverEntry& entry) { return entry.name == name; });
    config = driver != kDrivers.end() ? driver->parse(file) : parse_foreign(foreign.at(name), file);
  }
  file.finish();
  return config;
}

}  // namespace drivers
