// `rtbus devices`: haptic devices on the USB bus, who takes them, how they are, and what keeps one from being used.
#include <cstdio>
#include <iostream>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "drivers/usb_module/usb_module.hpp"
#include "rtbus/config/document.hpp"
#include "tools/cli/common/command.hpp"
#include "tools/cli/common/text_table.hpp"
#include "tools/cli/devices/device_target.hpp"
#include "tools/cli/devices/vendor_devices.hpp"

namespace tools {

namespace {

using drivers::usb::FoundDevice;

struct DevicesOptions {
  std::string named;
  std::vector<std::string> virtual_files;
  bool json = false;
  bool all = false;
  bool ask = true;
};

/// "runs, homed"; why it was not asked; "-".
std::string state_text(const FoundDevice& device) {
  if (!device.asked) return device.not_asked.empty() ? "-" : device.not_asked;
  const drivers::usb::Inspection& says = device.says;
  std::string out = says.model;
  for (const std::string& each : {says.firmware.empty() ? "" : "firmware " + says.firmware, says.homing}) {
    if (!each.empty()) out += (out.empty() ? "" : ", ") + each;
  }
  return out;
}

nlohmann::ordered_json to_json(const FoundDevice& device) {
  const auto or_null = [](const std::string& text) {
    return text.empty() ? nlohmann::ordered_json(nullptr) : nlohmann::ordered_json(text);
  };
  const drivers::usb::Inspection& says = device.says;
  return {
      {"usb_id", device.usb_id()},
      {"serial", or_null(device.serial)},
      {"product", or_null(device.product)},
      {"driver", or_null(device.driver)},
      {"node", device.node},
      {"permitted", device.permitted},
      {"kernel_driver", or_null(device.kernel_driver)},
      {"in_use_by", or_null(device.in_use_by)},
      {"asked", device.asked},
      {"not_asked", or_null(device.not_asked)},
      {"model", or_null(says.model)},
      {"firmware", or_null(says.firmware)},
      {"homing", or_null(says.homing)},
      {"homed", device.asked && says.answered ? nlohmann::ordered_json(says.homed) : nlohmann::ordered_json(nullptr)},
      {"counters", says.counters},
      {"remedy", or_null(device.remedy)}};
}

void print_findings(const std::vector<drivers::Finding>& findings) {
  for (const drivers::Finding& each : findings) {
    std::printf("%-32s %s%s%s\n", each.what.c_str(), each.state.c_str(), each.remedy.empty() ? "" : ": ",
                each.remedy.c_str());
  }
}

int devices(const DevicesOptions& options) {
  drivers::usb::FoundDevices found;
  try {
    drivers::usb::ListRequest request;
    request.ask = options.ask;
    request.named = options.named;
    found = find_devices(std::move(request), options.virtual_files);
  } catch (const rtbus::config::Error& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return kExitUsage;
  }
  // The makers' libraries are mapped only when everything is asked for.
  std::vector<drivers::Finding> findings;
  if (options.all && options.ask && options.virtual_files.empty()) findings = vendor_findings();
  if (!options.named.empty() && found.problem.empty()) {
    std::erase_if(found.devices, [&](const FoundDevice& device) { return !device.is(options.named); });
    if (found.devices.empty()) {
      std::fprintf(stderr, "rtbus devices: no device is called %s; without an ID all are shown\n",
                   options.named.c_str());
      return kExitFailed;
    }
  }
  if (!options.all) {
    std::erase_if(found.devices, [](const FoundDevice& device) { return device.driver.empty(); });
  }
  if (options.json) {
    nlohmann::ordered_json report = {{"schema", "rtbus-devices/1"}, {"devices", nlohmann::ordered_json::array()}};
    report["problem"] = found.problem.empty() ? nlohmann::ordered_json(nullptr) : nlohmann::ordered_json(found.problem);
    for (const FoundDevice& device : found.devices) report["devices"].push_back(to_json(device));
    report["vendors"] = nlohmann::ordered_json::array();
    for (const drivers::Finding& each : findings) {
      report["vendors"].push_back(
          {{"what", each.what}, {"ok", each.ok}, {"state", each.state}, {"remedy", each.remedy}});
    }
    std::cout << report.dump(2, ' ', false, nlohmann::ordered_json::error_handler_t::replace) << '\n';
    return kExitFine;
  }
  print_findings(findings);
  if (!found.problem.empty() && found.devices.empty()) {
    std::printf("no USB here: %s\n", found.problem.c_str());
    return kExitFine;
  }
  if (found.devices.empty()) {
    std::puts(options.all ? "nothing is plugged in"
                          : "no haptic device is plugged in; --all shows everything on the bus, and "
                            "`rtbus virtual-device --help` how to try without hardware");
    return kExitFine;
  }
  using enum TextTable::Align;
  TextTable table({{"USB ID", kLeft},
                   {"SERIAL", kLeft},
                   {"PRODUCT", kLeft},
                   {"DRIVER", kLeft},
                   {"PERMITTED", kLeft},
                   {"NODE", kLeft},
                   {"STATE", kLeft}});
  const auto or_dash = [](const std::string& text) { return text.empty() ? std::string("-") : text; };
  for (const FoundDevice& device : found.devices) {
    table.add({device.usb_id(), or_dash(device.serial), or_dash(device.product), or_dash(device.driver),
               device.permitted ? "yes" : "no", device.node, state_text(device)});
  }
  for (const std::string& line : table.lines()) std::printf("%s\n", line.c_str());
  for (const FoundDevice& device : found.devices) {
    if (device.remedy.empty()) continue;
    std::printf("%s%s: %s\n", device.usb_id().c_str(), device.serial.empty() ? "" : (":" + device.serial).c_str(),
                device.remedy.c_str());
  }
  return kExitFine;
}

}  // namespace

Action add_devices(rtbus::Command command) {
  auto options = std::make_shared<DevicesOptions>();
  command.option("device", options->named, "Only this one, by USB ID, serial or driver; a named Teensy is asked too")
      .type_name("ID");
  command
      .option("--virtual", options->virtual_files,
              "Show the virtual devices of these device files, as if plugged in, and not the bus")
      .take_all()
      .type_name("FILE");
  command.flag("!--no-ask", options->ask, "Look only: open no device to ask for its firmware and homing");
  command.flag("--all", options->all,
               "Also what no driver of ours takes, and what is installed of makers' libraries (maps them)");
  command.flag("--json", options->json, "As JSON, schema rtbus-devices/1");
  return [options] { return devices(*options); };
}

}  // namespace tools
