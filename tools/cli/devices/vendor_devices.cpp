#include "tools/cli/devices/vendor_devices.hpp"

#include <fcntl.h>
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
  int product_id;       ///< −1: all of the vendor's.
  const char* product;  ///< How its name begins; empty: any.
  const char* driver;
  const char* how;
  const char* maker;
};

constexpr const char* kAll = "`rtbus devices --all` says what is installed for it";

// The Haply Inverse3 has the ids of every Teensy with a serial port, 16c0:0483. Newer ones tell their name; older ones
// cannot be told from any other Teensy, and their grip's receiver stands for them.
constexpr VendorId kVendorIds[] = {
    {0x1451, -1, "", "force_dimension", "through the maker's SDK", "Force Dimension"},
    {0x2988, -1, "", "openhaptics", "through the maker's OpenHaptics", "3D Systems"},
    {0x2fe3, 0x0100, "", "haply", "through the maker's Inverse Service", "Haply"},
    {0x16c0, 0x0483, "Haply", "haply", "through the maker's Inverse Service", "Haply"},
};

constexpr const char* kRules =
    " not permitted; install the rules once: sudo cp config/udev/70-rtbus-haptics.rules /etc/udev/rules.d/ && "
    "sudo udevadm control --reload && sudo udevadm trigger, then replug it";

const VendorId* find(const FoundDevice& device) {
  for (const VendorId& each : kVendorIds) {
    const bool same_id =
        each.vendor_id == device.vendor_id && (each.product_id < 0 || each.product_id == device.product_id);
    if (same_id && device.product.starts_with(each.product)) return &each;
  }
  return nullptr;
}

/// Serial ports and HID nodes of a USB device, which the makers' libraries open: "/dev/ttyACM0", "/dev/hidraw3".
std::vector<std::string> ports_of(const fs::path& usb_device) {
  std::vector<std::string> out;
  std::error_code failed;
  // Links in it, which lead to drivers and subsystems, are not followed.
  for (fs::recursive_directory_iterator it(usb_device, failed), end; !failed && it != end; it.increment(failed)) {
    const std::string kind = it->path().parent_path().filename();
    if ((kind == "tty" || kind == "hidraw") && it->is_directory(failed)) {
      out.push_back("/dev/" + it->path().filename().string());
    }
  }
  std::sort(out.begin(), out.end());
  return out;
}

/// Whether this process may use the node, by the user that it acts for.
bool may_open(const std::string& node) { return ::faccessat(AT_FDCWD, node.c_str(), R_OK | W_OK, AT_EACCESS) == 0; }

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
  if (device.remedy.empty()) device.remedy = kAll;
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
    device.product = line_of(folder / "product");
    const VendorId* const vendor = find(device);
    if (vendor == nullptr) continue;
    device.serial = line_of(folder / "serial");
    char node[64];
    std::snprintf(node, sizeof node, "/dev/bus/usb/%03d/%03d", std::atoi(line_of(folder / "busnum").c_str()),
                  std::atoi(line_of(folder / "devnum").c_str()));
    device.node = node;
    std::vector<std::string> nodes = ports_of(folder);
    nodes.insert(nodes.begin(), device.node);
    std::string refused;
    for (const std::string& each : nodes) {
      if (!may_open(root + each)) refused += (refused.empty() ? "" : ", ") + each;
    }
    device.permitted = refused.empty();
    if (!device.permitted) device.remedy = refused + kRules;
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
      device.kernel_driver = same->kernel_driver;
      device.in_use_by = same->in_use_by;
      *same = std::move(device);  // with its ports
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

std::vector<drivers::Finding> vendor_findings(const std::string& root) {
  std::vector<drivers::Finding> out;
  for (const FoundDevice& device : vendor_devices_on_bus(root)) {
    out.push_back({std::string(find(device)->maker) + " " + device.usb_id(), device.permitted,
                   device.permitted ? "plugged in, may be opened" : "plugged in",
                   device.permitted ? "" : device.remedy});
  }
  for (const auto& look : drivers::vendor_looks()) {
    for (drivers::Finding& each : look(true)) out.push_back(std::move(each));
  }
  return out;
}

}  // namespace tools
