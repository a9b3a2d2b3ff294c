#include "drivers/registry.hpp"

#include <algorithm>
#include <array>
#include <vector>

#include "drivers/simulated/simulated_config.hpp"

namespace drivers {
namespace {

// In probing order. A new driver is one row here and one folder.
constexpr std::array kDrivers{
    DriverEntry{"simulated", "Simulated mechanics with a scripted hand, no hardware", &simulated::parse},
};

}  // namespace

std::span<const DriverEntry> registered_drivers() noexcept { return kDrivers; }

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
