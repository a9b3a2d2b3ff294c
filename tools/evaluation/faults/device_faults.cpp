#include "tools/evaluation/faults/device_faults.hpp"

#include <algorithm>

#include "drivers/registry/registry.hpp"

namespace tools {
namespace {

/// Force time-out of the drivers, and the omega's watchdog; one tick on top.
constexpr double kForceTimeout_ms = 20.0 + 1.0;
/// The stand-in's own choice for the service, whose delay until idle is not established.
constexpr double kServiceIdle_ms = 100.0 + 1.0;

const std::vector<DeviceFault>& all() {
  static const std::vector<DeviceFault> rows{
      {"omega_unplugged",
       "force_dimension",
       "wall_virtual_omega.yaml",
       {"faults.unplug_at_s=0", "faults.replug_after_s=1"},
       kForceTimeout_ms,
       1.0,
       true},
      {"omega_silent",
       "force_dimension",
       "wall_virtual_omega.yaml",
       {"block_at_s=0", "block_s=0.3"},
       kForceTimeout_ms,
       0.3,
       false},
      {"omega_uncalibrated",
       "force_dimension",
       "wall_virtual_omega.yaml",
       {"lose_calibration_at_s=0"},
       kForceTimeout_ms,
       -1.0,
       false},
      {"touch_unplugged",
       "openhaptics",
       "wall_virtual_touch.yaml",
       {"faults.unplug_at_s=0"},
       kForceTimeout_ms,
       -1.0,
       false},
      {"touch_uncalibrated",
       "openhaptics",
       "wall_virtual_touch.yaml",
       {"uncalibrate_at_s=0"},
       kForceTimeout_ms,
       -1.0,
       false},
      {"touch_calibrated_again",
       "openhaptics",
       "wall_virtual_touch.yaml",
       {"uncalibrate_at_s=0", "docked_at_s=0.5"},
       kForceTimeout_ms,
       0.5,
       true},
      {"inverse3_unplugged",
       "haply",
       "wall_virtual_inverse3.yaml",
       {"faults.unplug_at_s=0", "faults.replug_after_s=1"},
       kServiceIdle_ms,
       1.0,
       false},
      {"inverse3_silent",
       "haply",
       "wall_virtual_inverse3.yaml",
       {"mute_at_s=0", "mute_for_s=1"},
       kForceTimeout_ms,
       1.0,
       false},
      {"inverse3_service_closes", "haply", "wall_virtual_inverse3.yaml", {"close_at_s=0"}, kServiceIdle_ms, 0.0, true}};
  return rows;
}

bool built(const DeviceFault& fault) {
  const auto drivers = drivers::registered_drivers();
  return std::any_of(drivers.begin(), drivers.end(), [&](const drivers::DriverEntry& driver) {
    return driver.name == fault.driver && driver_present(driver);
  });
}

}  // namespace

std::vector<const DeviceFault*> device_faults(bool quick) {
  std::vector<const DeviceFault*> out;
  for (const DeviceFault& row : all()) {
    if ((row.quick || !quick) && built(row)) out.push_back(&row);
  }
  return out;
}

std::vector<std::string> assignments_of(const DeviceFault& fault, const std::string& trigger) {
  const std::string unit = "haptic.0.device.virtual.";
  std::vector<std::string> out{unit + "publish_state=true", unit + "faults.trigger=" + trigger};
  for (const char* const each : fault.faults) out.push_back(unit + each);
  return out;
}

}  // namespace tools
