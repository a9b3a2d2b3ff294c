#pragma once
/// @file device_faults.hpp
/// Faults of makers' devices that can happen while a session runs, on the stand-ins for them: unplugged, silent, not
/// calibrated any more, the service's connection closed. Faults at the start are tests/unit/vendor's.
#include <span>
#include <string>
#include <vector>

namespace tools {

/// One row: what goes wrong, and what the hand is promised then (docs/device-*.md).
struct DeviceFault {
  const char* name;                 ///< "omega_unplugged"
  const char* driver;               ///< It is left out where this driver was not built.
  const char* session;              ///< File beside the session of the other cells.
  std::vector<const char*> faults;  ///< Keys of `virtual:`; their times count from the fault.
  double zero_ms;                   ///< Promised: zero force after the fault.
  double lasts_s;                   ///< The device is well again so long after the fault; < 0: it stays so.
  bool quick;                       ///< Also with --quick: one row per driver.
};

/// Those whose driver was built.
[[nodiscard]] std::vector<const DeviceFault*> device_faults(bool quick);

/// The assignments for `rtbus run --set`. @param trigger File whose appearance is the fault.
[[nodiscard]] std::vector<std::string> assignments_of(const DeviceFault& fault, const std::string& trigger);

}  // namespace tools
