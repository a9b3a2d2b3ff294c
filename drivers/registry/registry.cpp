#include "drivers/registry/registry.hpp"

#include <algorithm>
#include <array>
#include <cstdlib>
#include <filesystem>
#include <map>
#include <sstream>
#include <string>
#include <vector>

#include "drivers/simulated/simulated_config.hpp"
#include "drivers/usb_module/usb_module.hpp"

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

/// A module with one driver and nothing besides.
constexpr ModuleFile driver_module(const char* file, const char* remedy) {
  return {file, kDriverModuleSymbol, kDriverAbiVersion, remedy};
}
constexpr ModuleFile kReplay =
    driver_module("libdrivers_replay.so", "build with RTBUS_WITH_HDF5=ON (Debian package libhdf5-dev)");
constexpr char kNothingOfTheMaker[] = "build it, which needs nothing of the maker: tools/build vendor_drivers";
constexpr ModuleFile kForceDimension = driver_module("libdrivers_force_dimension.so", kNothingOfTheMaker);
constexpr ModuleFile kOpenHaptics = driver_module("libdrivers_openhaptics.so", kNothingOfTheMaker);
constexpr ModuleFile kHaply =
    driver_module("libdrivers_haply.so",
                  "build it: tools/build vendor_drivers (needs RTBUS_WITH_HAPLY=ON and the Debian package "
                  "libwebsockets-dev)");
constexpr std::array kMakerModules{kForceDimension, kOpenHaptics, kHaply};

std::unique_ptr<DeviceConfig> parse_by(const ModuleFile& module, rtbus::config::Map& file) {
  const auto table = load_module<DriverModule>(module);
  if (!table) file.fail("driver", table.error());
  return (*table)->parse(file);
}
template <const ModuleFile& module>
std::unique_ptr<DeviceConfig> parse_module(rtbus::config::Map& file) {
  return parse_by(module, file);
}

/// A driver that was built outside this source tree.
std::unique_ptr<DeviceConfig> parse_foreign(const std::string& module, rtbus::config::Map& file) {
  return parse_by(driver_module(module.c_str(), "name a driver module (docs/writing-a-driver.md)"), file);
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
    DriverEntry{"replay", "The hand's motion out of a recording, no hardware", &parse_module<kReplay>, kReplay.file},
    DriverEntry{"force_dimension", "Force Dimension omega, delta, sigma, lambda, by the maker's SDK",
                &parse_module<kForceDimension>, kForceDimension.file},
    DriverEntry{"openhaptics", "3D Systems Touch and SensAble PHANToM, by the maker's OpenHaptics",
                &parse_module<kOpenHaptics>, kOpenHaptics.file},
    DriverEntry{"haply", "Haply Inverse3 and VerseGrip, by the maker's Inverse Service", &parse_module<kHaply>,
                kHaply.file},
};

}  // namespace

std::span<const DriverEntry> registered_drivers() noexcept { return kDrivers; }

bool driver_present(const DriverEntry& entry) {
  if (entry.module.empty()) return true;
  if (entry.module != usb::kUsbModuleFile) {
    return load_module_head(driver_module(std::string(entry.module).c_str(), "")).has_value();
  }
  const auto module = usb::load_usb_module();
  return module && find_usb_driver(**module, entry.name) != nullptr;
}

bool driver_present(std::string_view name) {
  const auto drivers = registered_drivers();
  return std::any_of(drivers.begin(), drivers.end(),
                     [name](const DriverEntry& entry) { return entry.name == name && driver_present(entry); });
}

std::vector<std::vector<Finding> (*)(bool)> vendor_looks() {
  std::vector<std::vector<Finding> (*)(bool)> out;
  for (const ModuleFile& maker : kMakerModules) {
    const auto table = load_module<DriverModule>(maker);
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
