#pragma once
/// @file calibrate_steps.hpp
/// The guided steps of `rtbus calibrate`, per kind of device.
#include <string>
#include <vector>

#include "drivers/usb_module/usb_module.hpp"
#include "rtbus/config/document.hpp"
#include "tools/cli/devices/device_target.hpp"
#include "tools/cli/devices/device_walk.hpp"

namespace tools {

struct GuideOptions {
  double mass_kg = 0.0;            ///< That the user hangs on the grip; 0: none.
  double force_calibration = 1.0;  ///< In the device file now.
  double seconds = 30.0;
  bool yes = false;
};

struct Calibration {
  std::vector<GuidedStep> steps;
  std::vector<rtbus::config::Override> changes;  ///< Of the device file.
  bool complete = false;                         ///< Every step was reached.
};

/// Homing; the range of each encoder between the ends of the grip's way; force_calibration when a mass is there.
[[nodiscard]] Calibration calibrate_falcon(const drivers::usb::UsbModule& module, const drivers::DeviceConfig& config,
                                           const GuideOptions& options);

/// A device behind its maker's library calibrates by that, with what its user has to do told. It may move by itself:
/// only after the user has agreed. Throws rtbus::config::Error.
[[nodiscard]] Calibration calibrate_vendor(const TargetOptions& target, const drivers::DeviceConfig& config,
                                           const GuideOptions& options);

/// Which arm; counters zero at home, and again after a way; zero of the stylus. Never a force.
[[nodiscard]] Calibration calibrate_phantom(const drivers::usb::UsbModule& module, const drivers::DeviceConfig& config,
                                            const GuideOptions& options);

}  // namespace tools
