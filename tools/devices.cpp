// `rtbus devices`: haptic devices on the USB bus, who takes them, and what keeps one from being used.
#include <cstdio>
#include <iostream>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>

#include "drivers/usb/driver_module.hpp"
#include "tools/command.hpp"
#include "tools/text_table.hpp"

namespace tools {

namespace {

using drivers::usb::FoundDevice;

struct DevicesOptions {
  bool json = false;
  bool all = false;
};

std::string usb_id(const FoundDevice& device) {
  char text[16];
  std::snprintf(text, sizeof text, "%04x:%04x", device.vendor_id, device.product_id);
  return text;
}

nlohmann::ordered_json to_json(const FoundDevice& device) {
  const auto or_null = [](const std::string& text) {
    return text.empty() ? nlohmann::ordered_json(nullptr) : nlohmann::ordered_json(text);
  };
  return {{"usb_id", usb_id(device)},
          {"serial", or_null(device.serial)},
          {"product", or_null(device.product)},
          {"driver", or_null(device.driver)},
          {"node", device.node},
          {"permitted", device.permitted},
          {"kernel_driver", or_null(device.kernel_driver)},
          {"remedy", or_null(device.remedy)}};
}

int devices(const DevicesOptions& options) {
  drivers::usb::FoundDevices found;
  const auto module = drivers::usb::load_usb_module();
  if (module) {
    found = (*module)->list();
  } else {
    found.problem = "looking for USB devices " + module.error();
  }
  if (!options.all) {
    std::erase_if(found.devices, [](const FoundDevice& device) { return device.driver.empty(); });
  }
  if (options.json) {
    nlohmann::ordered_json report = {{"schema", "rtbus-devices/1"}, {"devices", nlohmann::ordered_json::array()}};
    report["problem"] = found.problem.empty() ? nlohmann::ordered_json(nullptr) : nlohmann::ordered_json(found.problem);
    for (const FoundDevice& device : found.devices) report["devices"].push_back(to_json(device));
    std::cout << report.dump(2, ' ', false, nlohmann::ordered_json::error_handler_t::replace) << '\n';
    return kExitFine;
  }
  if (!found.problem.empty()) {
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
                   {"KERNEL DRIVER", kLeft},
                   {"NODE", kLeft}});
  const auto or_dash = [](const std::string& text) { return text.empty() ? std::string("-") : text; };
  for (const FoundDevice& device : found.devices) {
    table.add({usb_id(device), or_dash(device.serial), or_dash(device.product), or_dash(device.driver),
               device.permitted ? "yes" : "no", or_dash(device.kernel_driver), device.node});
  }
  for (const std::string& line : table.lines()) std::printf("%s\n", line.c_str());
  for (const FoundDevice& device : found.devices) {
    if (!device.remedy.empty()) std::printf("%s: %s\n", device.node.c_str(), device.remedy.c_str());
  }
  return kExitFine;
}

}  // namespace

Action add_devices(CLI::App& command) {
  auto options = std::make_shared<DevicesOptions>();
  command.add_flag("--all", options->all, "Also what no driver of ours takes");
  command.add_flag("--json", options->json, "As JSON, schema rtbus-devices/1");
  return [options] { return devices(*options); };
}

}  // namespace tools
