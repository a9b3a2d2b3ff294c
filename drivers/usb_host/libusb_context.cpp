#include "drivers/usb_host/libusb_context.hpp"

#include <libusb.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <utility>

namespace drivers::usb {

namespace {

std::string hex_id(std::uint16_t vendor, std::uint16_t product) {
  char text[16];
  std::snprintf(text, sizeof text, "%04x:%04x", vendor, product);
  return text;
}

/// "/sys/bus/usb/devices/1-2.3"
std::string sysfs_folder(libusb_device* device) {
  std::array<std::uint8_t, 8> ports{};
  const int count = libusb_get_port_numbers(device, ports.data(), static_cast<int>(ports.size()));
  std::string name = std::to_string(libusb_get_bus_number(device));
  if (count <= 0) return "/sys/bus/usb/devices/usb" + name;
  for (int i = 0; i < count; ++i) name += (i == 0 ? "-" : ".") + std::to_string(ports[static_cast<std::size_t>(i)]);
  return "/sys/bus/usb/devices/" + name;
}

std::string first_line(const std::string& file) {
  std::ifstream in(file);
  std::string line;
  std::getline(in, line);
  return line;
}

std::string ask_string(libusb_device_handle* handle, std::uint8_t index) {
  std::array<unsigned char, 256> text{};
  if (index == 0) return "";
  const int got = libusb_get_string_descriptor_ascii(handle, index, text.data(), static_cast<int>(text.size()));
  return got > 0 ? std::string(reinterpret_cast<const char*>(text.data()), static_cast<std::size_t>(got)) : "";
}

std::string kernel_driver(const std::string& folder) {
  std::error_code failed;
  const std::string name = std::filesystem::path(folder).filename();
  for (const auto& entry : std::filesystem::directory_iterator(folder, failed)) {
    const std::string interface = entry.path().filename();
    if (!interface.starts_with(name + ":")) continue;
    const auto driver = std::filesystem::read_symlink(entry.path() / "driver", failed);
    if (!failed && driver.filename() != "usbfs") return driver.filename();
  }
  return "";
}

/// "/dev/ttyACM0" of a serial device whose kernel driver made one.
std::vector<std::string> terminals(const std::string& folder) {
  std::vector<std::string> out;
  std::error_code failed;
  const std::string name = std::filesystem::path(folder).filename();
  for (const auto& interface : std::filesystem::directory_iterator(folder, failed)) {
    if (!interface.path().filename().string().starts_with(name + ":")) continue;
    for (const auto& entry : std::filesystem::directory_iterator(interface.path() / "tty", failed)) {
      out.push_back("/dev/" + entry.path().filename().string());
    }
  }
  return out;
}

UsbListing describe(libusb_device* device, const libusb_device_descriptor& descriptor) {
  UsbListing out;
  out.vendor_id = descriptor.idVendor;
  out.product_id = descriptor.idProduct;
  out.bus = libusb_get_bus_number(device);
  out.address = libusb_get_device_address(device);
  char node[40];
  std::snprintf(node, sizeof node, "/dev/bus/usb/%03d/%03d", out.bus, out.address);
  out.node = node;
  out.readable = ::access(node, R_OK | W_OK) == 0;
  const std::string folder = sysfs_folder(device);
  out.serial = first_line(folder + "/serial");
  out.product = first_line(folder + "/product");
  out.kernel_driver = kernel_driver(folder);
  out.files = terminals(folder);
  out.files.emplace_back(node);
  if (out.readable && (out.serial.empty() || out.product.empty())) {
    libusb_device_handle* raw = nullptr;
    if (libusb_open(device, &raw) == 0) {
      const Handle handle(raw);
      if (out.serial.empty()) out.serial = ask_string(raw, descriptor.iSerialNumber);
      if (out.product.empty()) out.product = ask_string(raw, descriptor.iProduct);
    }
  }
  return out;
}

/// The bus as it is now; references are given back at the end.
struct DeviceList {
  explicit DeviceList(libusb_context* context) : count(libusb_get_device_list(context, &devices)) {}
  ~DeviceList() {
    if (devices != nullptr) libusb_free_device_list(devices, 1);
  }
  DeviceList(const DeviceList&) = delete;
  DeviceList& operator=(const DeviceList&) = delete;
  libusb_device** devices = nullptr;
  ssize_t count;
};

}  // namespace

void ContextDeleter::operator()(libusb_context* context) const noexcept { libusb_exit(context); }
void HandleDeleter::operator()(libusb_device_handle* handle) const noexcept { libusb_close(handle); }

std::vector<std::string> users_of(const std::vector<std::string>& files) {
  std::vector<std::string> out;
  std::error_code failed;
  for (const auto& process : std::filesystem::directory_iterator("/proc", failed)) {
    const std::string pid = process.path().filename();
    if (pid.find_first_not_of("0123456789") != std::string::npos || pid == std::to_string(::getpid())) continue;
    // Of another user's process one sees nothing; claiming the interface then tells.
    for (const auto& fd : std::filesystem::directory_iterator(process.path() / "fd", failed)) {
      const std::string target = std::filesystem::read_symlink(fd.path(), failed);
      if (std::find(files.begin(), files.end(), target) == files.end()) continue;
      out.push_back(first_line(process.path() / "comm") + " (pid " + pid + ")");
      break;
    }
  }
  return out;
}

std::string explain(int error, const std::string& what, const std::vector<std::string>& users) {
  std::string who;
  for (const std::string& user : users) who += (who.empty() ? "" : ", ") + user;
  switch (error) {
    case LIBUSB_ERROR_ACCESS:
      return what + ": permission denied; " + kUdevRemedy;
    case LIBUSB_ERROR_BUSY:
      return what + ": " + (who.empty() ? "another program" : who) + " has it; end that program" +
             (who.empty() ? " (`fuser -v /dev/bus/usb/*/*` names it)" : "");
    case LIBUSB_ERROR_NO_DEVICE:
    case LIBUSB_ERROR_NOT_FOUND:
      return what + ": the device is gone";
    default:
      return what + ": " + libusb_strerror(error);
  }
}

rtbus::Result<Context, DeviceFault> make_context(bool discovery) {
  // libusb keeps the option for all contexts that the process makes from now on: a process that uses handed-in
  // descriptors (virtual devices) does not enumerate as well.
  if (!discovery) libusb_set_option(nullptr, LIBUSB_OPTION_NO_DEVICE_DISCOVERY);
  libusb_context* context = nullptr;
  if (const int error = libusb_init(&context); error != 0) {
    return rtbus::Failure{DeviceFault{explain(error, "starting libusb")}};
  }
  return Context(context);
}

rtbus::Result<Handle, DeviceFault> open_device(libusb_context* context, const DeviceMatch& match) {
  const std::string id = hex_id(match.vendor_id, match.product_id);
  const DeviceList list(context);
  std::vector<std::pair<libusb_device*, UsbListing>> found;
  for (ssize_t i = 0; i < list.count; ++i) {
    libusb_device_descriptor descriptor{};
    if (libusb_get_device_descriptor(list.devices[i], &descriptor) != 0) continue;
    if (descriptor.idVendor != match.vendor_id || descriptor.idProduct != match.product_id) continue;
    found.emplace_back(list.devices[i], describe(list.devices[i], descriptor));
  }
  std::string serials;
  for (const auto& [device, listing] : found) {
    const std::string serial = !listing.serial.empty() ? listing.serial
                               : listing.readable      ? "(none)"
                                                       : "(not readable: " + listing.node + ")";
    serials += (serials.empty() ? "" : ", ") + serial;
  }
  std::vector<libusb_device*> wanted;
  std::string node;
  for (const auto& [device, listing] : found) {
    if (match.serial.empty() || listing.serial == match.serial) {
      wanted.push_back(device);
      node = listing.node;
    }
  }
  if (wanted.empty()) {
    std::string text = "no USB device " + id + (match.serial.empty() ? "" : " with serial " + match.serial);
    text += found.empty() ? " is plugged in; check cable and power, and look at `rtbus devices`"
                          : " is plugged in; there is: " + serials;
    return rtbus::Failure{DeviceFault{text}};
  }
  if (wanted.size() > 1) {
    return rtbus::Failure{DeviceFault{"several USB devices " + id + " are plugged in (" + serials +
                                      "); say which one by `serial:` in the device file"}};
  }
  libusb_device_handle* raw = nullptr;
  if (const int error = libusb_open(wanted.front(), &raw); error != 0) {
    return rtbus::Failure{DeviceFault{explain(error, "opening USB device " + id + " (" + node + ")")}};
  }
  return Handle(raw);
}

rtbus::Result<Handle, DeviceFault> wrap_device(libusb_context* context, int fd) {
  libusb_device_handle* raw = nullptr;
  if (const int error = libusb_wrap_sys_device(context, fd, &raw); error != 0) {
    return rtbus::Failure{DeviceFault{explain(error, "wrapping the open USB descriptor " + std::to_string(fd))}};
  }
  return Handle(raw);
}

std::vector<UsbListing> list_devices(libusb_context* context) {
  std::vector<UsbListing> out;
  const DeviceList list(context);
  for (ssize_t i = 0; i < list.count; ++i) {
    libusb_device_descriptor descriptor{};
    if (libusb_get_device_descriptor(list.devices[i], &descriptor) != 0) continue;
    out.push_back(describe(list.devices[i], descriptor));
  }
  return out;
}

}  // namespace drivers::usb
