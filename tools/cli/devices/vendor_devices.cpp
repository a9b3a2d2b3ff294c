#include "tools/cli/devices/vendor_devices.hpp"

#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>

#include "drivers/registry/registry.hpp"

namespace tools {

namespace {

namespace fs = std::filesystem;
using drivers::usb::FoundDevice;

struct VendorId {
  std::uint16_t vendor_id;
  int product_id;  ///< −1: all of the vendor's.
  const char* driver;
  const char* how;
};

constexpr const char* kAll = "`rtbus devices --all` says what is installed for it";

// The Haply Inverse3 has the ids of every Teensy with a serial port (16c0:0483), so its grip's receiver stands for it.
constexpr VendorId kVendorIds[] = {
    {0x1451, -1, "force_dimension", "through the maker's SDK"},
    {0x2988, -1, "openhaptics", "through the maker's OpenHaptics"},
    {0x2fe3, 0x0100, "haply", "through the maker's Inverse Service"},
};

constexpr const char* kPermission =
    "not permitted; install the rules once: sudo cp config/udev/70-rtbus-haptics.rules /etc/udev/rules.d/ && "
    "sudo udevadm control --reload && sudo udevadm trigger, then replug it";

const VendorId* find(std::uint16_t vendor_id, std::uint16_t product_id) {
  for (const VendorId& each : kVendorIds) {
    if (each.vendor_id == vendor_id && (each.product_id < 0 || each.product_id == product_id)) return &each;
  }
  return nullptr;
}

std::string line_of(const fs::path& file) {
  std::string out;
  std::getline(std::ifstream(file) >> std::ws, out);
  return out;
}

std::uint16_t id_of(const fs::path& file) {
  return static_cast<std::uint16_t>(std::strtoul(line_of(file).c_str(), nullptr, 16));
}

void complete(FoundDevice& device, const VendorId& vendor) {
  device.driver = vendor.driver;
  device.not_asked = vendor.how;
  device.remedy = device.permitted ? kAll : kPermission;
}

}  // namespace

std::vector<FoundDevice> vendor_devices_on_bus(const std::string& root) {
  std::vector<FoundDevice> out;
  std::error_code failed;
  for (const auto& entry : fs::directory_iterator(root + "/sys/bus/usb/devices", failed)) {
    const fs::path& folder = entry.path();
    FoundDevice device;
    device.vendor_id = id_of(folder / "idVendor");
    device.product_id = id_of(folder / "idProduct");
    const VendorId* const vendor = find(device.vendor_id, device.product_id);
    if (vendor == nullptr) continue;
    device.serial = line_of(folder / "serial");
    device.product = line_of(folder / "product");
    char node[64];
    std::snprintf(node, sizeof node, "/dev/bus/usb/%03d/%03d", std::atoi(line_of(folder / "busnum").c_str()),
                  std::atoi(line_of(folder / "devnum").c_str()));
    device.node = node;
    device.permitted = ::access((root + node).c_str(), R_OK | W_OK) == 0;
    complete(device, *vendor);
    out.push_back(std::move(device));
  }
  return out;
}

void add_vendor_devices(std::vector<FoundDevice>& devices) {
  for (FoundDevice& device : vendor_devices_on_bus()) {
    const auto same = std::find_if(devices.begin(), devices.end(),
                                   [&](const FoundDevice& other) { return other.node == device.node; });
    if (same != devices.end()) {
      complete(*same, *find(same->vendor_id, same->product_id));
    } else {
      devices.push_back(std::move(device));
    }
  }
}

FoundDevice describe_stand_in(const drivers::DeviceConfig& config, const std::string& driver) {
  FoundDevice out;
  for (const VendorId& each : kVendorIds) {
    if (driver == each.driver) out.vendor_id = each.vendor_id;
  }
  out.driver = driver;
  out.product = config.info().model;
  out.serial = config.info().serial;
  out.node = "virtual";
  out.permitted = true;
  return out;
}

std::vector<drivers::Finding> vendor_findings() {
  std::vector<drivers::Finding> out;
  for (const auto& look : drivers::vendor_looks()) {
    for (drivers::Finding& each : look(true)) out.push_back(std::move(each));
  }
  return out;
}

}  // namespace tools
