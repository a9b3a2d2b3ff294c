// `rtbus calibrate`: what a device's file should say about this very unit, found out with its user.
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <ctime>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "drivers/usb_module/usb_module.hpp"
#include "rtbus/clock.hpp"
#include "tools/cli/common/command.hpp"
#include "tools/cli/common/interrupt.hpp"
#include "tools/cli/devices/calibrate_steps.hpp"
#include "tools/cli/devices/device_file.hpp"
#include "tools/cli/devices/device_target.hpp"

namespace tools {

namespace {

struct CalibrateOptions {
  TargetOptions target;
  GuideOptions guide;
  std::string output;
  bool overwrite = false;
  bool json = false;
};

/// "# …" lines that tell where a file came from.
std::string header(const std::string& origin, const Calibration& result) {
  char day[32] = "";
  const std::time_t now = std::time(nullptr);
  std::strftime(day, sizeof day, "%Y-%m-%d", std::gmtime(&now));
  std::string out = std::string("# Written by `rtbus calibrate` on ") + day + " from " + origin +
                    ", whose comments explain the keys.\n";
  for (const GuidedStep& step : result.steps) out += "#   " + step.name + ": " + step.what + "\n";
  return out;
}

Calibration calibrate_device(const drivers::usb::UsbModule& module, const DeviceTarget& target,
                             const GuideOptions& guide) {
  // A driver that says what its joints count has a linkage whose ends and forces can be looked at by driving it. The
  // other kind has counters that its user zeroes: it is asked, and gets no force.
  if (module.joint_counts(*target.config, {}).has_value()) return calibrate_falcon(module, *target.config, guide);
  return calibrate_phantom(module, *target.config, guide);
}

int calibrate(const CalibrateOptions& options) {
  const auto failed = [](const std::string& text) {
    std::fprintf(stderr, "rtbus calibrate: %s\n", text.c_str());
    return kExitFailed;
  };
  if (!options.output.empty() && !options.overwrite && std::filesystem::exists(options.output)) {
    return failed(options.output + " exists; name another file, or replace it with --overwrite");
  }
  DeviceTarget target;
  std::vector<rtbus::config::Override> changes;
  try {
    auto found = find_target(options.target);
    if (!found) return failed(found.error());
    target = std::move(*found);
    for (const std::string& text : options.target.assignments) changes.push_back(rtbus::config::parse_override(text));
  } catch (const rtbus::config::Error& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return kExitUsage;
  }
  if (!target.config->has_link()) {
    return failed(target.file + ": only real devices are calibrated; a simulated one is what its file says");
  }

  GuideOptions guide = options.guide;
  guide.force_calibration = number_in(target.yaml, changes, "force_calibration", 1.0);
  Calibration result;
  if (target.config->uses_usb()) {
    const auto module = drivers::usb::load_usb_module();
    if (!module) return failed("looking for USB devices " + module.error());
    result = calibrate_device(**module, target, guide);
  } else {
    try {
      result = calibrate_vendor(options.target, *target.config, guide);
    } catch (const rtbus::config::Error& error) {
      std::fprintf(stderr, "%s\n", error.what());
      return kExitUsage;
    }
  }
  changes.insert(changes.end(), result.changes.begin(), result.changes.end());
  bool fine = result.complete && !interrupted();
  for (const GuidedStep& step : result.steps) fine = fine && step.ok;
  std::string written;
  if (fine && !options.output.empty()) {
    const auto wrote = write_device_file(target.yaml, target.file, changes, header(target.file, result), options.output,
                                         options.overwrite);
    if (!wrote) return failed(wrote.error());
    written = options.output;
  }
  if (options.json) {
    nlohmann::ordered_json report = {{"schema", "rtbus-calibrate/1"},
                                     {"device", target.config->info().model},
                                     {"pass", fine},
                                     {"steps", steps_json(result.steps)}};
    report["changes"] = nlohmann::ordered_json::object();
    for (const auto& change : result.changes) report["changes"][change.path] = change.value;
    report["written"] = written.empty() ? nlohmann::ordered_json(nullptr) : nlohmann::ordered_json(written);
    std::printf("%s\n", report.dump(2).c_str());
  } else {
    print_steps(result.steps);
    for (const auto& change : result.changes) std::printf("  %s: %s\n", change.path.c_str(), change.value.c_str());
    if (!written.empty()) {
      std::printf("written to %s\n", written.c_str());
    } else {
      std::puts(!fine ? "nothing was written: not every step succeeded"
                      : "nothing was written; --output FILE makes a device file of it");
    }
  }
  return fine ? kExitFine : kExitFailed;
}

}  // namespace

Action add_calibrate(rtbus::Command command) {
  auto options = std::make_shared<CalibrateOptions>();
  add_target_options(command, options->target);
  command.option("-o,--output", options->output, "Device file to write; the one that was read stays as it is")
      .type_name("FILE");
  command.flag("--overwrite", options->overwrite, "Replace FILE if it exists");
  command
      .option("--mass", options->guide.mass_kg,
              "Falcon: hang this mass on the grip when asked, to find force_calibration [kg]")
      .range(0.05, 0.6)
      .type_name("KG");
  command.option("--seconds", options->guide.seconds, "Longest wait in each guided step [s]")
      .range(0.1, 600.0)
      .show_default()
      .type_name("S");
  command.flag("--yes", options->guide.yes, "Do not ask before each step; what is to be done has --seconds");
  command.flag("--json", options->json, "Print the outcome as JSON, schema rtbus-calibrate/1");
  command.footer(
      "\nFalcon: homes it, looks at the range of its three encoders, and with --mass KG finds the factor of its "
      "force.\n"
      "Force Dimension: the arm calibrates itself, which moves it, after you have agreed. OpenHaptics: by inkwell or "
      "reset "
      "position.\n"
      "PHANToM-class: which arm it is, whether its counters are those of its home pose, whether they come back to it,\n"
      "and the zero of its stylus. It gets no force.\n"
      "  rtbus calibrate falcon --set firmware=nvent_firmware.bin --mass 0.2 -o my_falcon.yaml");
  return [options] { return calibrate(*options); };
}

}  // namespace tools
