// Calibration of a device behind its maker's library: the library knows how. Nothing of the device file changes.
#include <unistd.h>

#include <string>

#include "rtbus/clock.hpp"
#include "tools/cli/common/interrupt.hpp"
#include "tools/cli/devices/calibrate_steps.hpp"

namespace tools {

namespace {

rtbus::Result<std::unique_ptr<drivers::Device>, drivers::DeviceFault> started(const drivers::DeviceConfig& config) {
  rtbus::Session session;
  session.name = "calibrate-" + std::to_string(::getpid());
  auto device = config.open({.session = session, .node_name = "haptic0"});
  if (!device) return rtbus::Failure{device.error()};
  if (auto up = start_device(**device); !up) return rtbus::Failure{up.error()};
  return std::move(*device);
}

}  // namespace

Calibration calibrate_vendor(const TargetOptions& target, const drivers::DeviceConfig& config,
                             const GuideOptions& options) {
  Calibration out;
  auto device = started(config);
  // It says so itself when it has to move for that.
  if (!device && device.error().message.find("auto_init: true") != std::string::npos) {
    out.steps.push_back({"state", true, "not calibrated"});
    if (!confirm(options.yes,
                 "the arm will now move by itself for some seconds: take your hands off it, and everything "
                 "else out of its way")) {
      out.steps.push_back({"moves", false, "not agreed to; nothing moved"});
      return out;
    }
    TargetOptions moving = target;
    moving.assignments.emplace_back("auto_init=true");
    auto again = find_target(moving);
    if (!again) {
      out.steps.push_back({"moves", false, again.error()});
      return out;
    }
    device = started(*again->config);
    out.steps.push_back({"moves", device.has_value(), device ? "it has calibrated itself" : device.error().message});
  } else {
    out.steps.push_back({"state", device.has_value(), device ? "it answers" : device.error().message});
  }
  if (!device) return out;
  // What its user has to do comes as the driver's own words: an inkwell, a reset position.
  Walk walk(**device);
  out.steps.push_back(wait_until_ready(walk));
  (*device)->stop();
  out.complete = true;
  return out;
}

}  // namespace tools
