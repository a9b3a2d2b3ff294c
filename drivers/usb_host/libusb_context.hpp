#pragma once
/// @file libusb_context.hpp
/// libusb, and devices on its bus: finding the one that a driver wants, and saying what is wrong when it cannot be had.
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "drivers/device.hpp"
#include "drivers/usb/channel.hpp"

struct libusb_context;
struct libusb_device;
struct libusb_device_handle;

namespace drivers::usb {

/// Where the rules that let users open haptic devices are, and how they are installed.
inline constexpr const char* kUdevRemedy =
    "install the rules once (the package rtbus has done so): sudo cp config/udev/70-rtbus-haptics.rules "
    "/etc/udev/rules.d/ && sudo udevadm control "
    "--reload && sudo udevadm trigger, then plug the device in again";

struct ContextDeleter {
  void operator()(libusb_context* context) const noexcept;
};
using Context = std::unique_ptr<libusb_context, ContextDeleter>;

struct HandleDeleter {
  void operator()(libusb_device_handle* handle) const noexcept;
};
using Handle = std::unique_ptr<libusb_device_handle, HandleDeleter>;

/// @param discovery False: libusb looks at no bus, only descriptors handed to it are used.
/// Each context is of its own; opening a lost device again makes a new one, which also finds devices where nobody
/// announces their arrival (containers without udev).
[[nodiscard]] rtbus::Result<Context, DeviceFault> make_context(bool discovery);

/// Opens the device of `match`. The fault says: not found; several, with their serial numbers; permission, with the
/// rules that give it; busy.
[[nodiscard]] rtbus::Result<Handle, DeviceFault> open_device(libusb_context* context, const DeviceMatch& match);

/// Wraps an open usbfs descriptor, which stays the caller's.
[[nodiscard]] rtbus::Result<Handle, DeviceFault> wrap_device(libusb_context* context, int fd);

/// A device on the bus, as far as one can see without opening it.
struct UsbListing {
  std::uint16_t vendor_id = 0;
  std::uint16_t product_id = 0;
  int bus = 0;
  int address = 0;
  std::string serial;         ///< From sysfs, else by opening; empty: none, or not readable.
  std::string product;        ///< Likewise.
  std::string kernel_driver;  ///< Of the first interface that has one; empty: none.
  bool readable = true;       ///< Its node may be opened for reading and writing.
  std::string node;           ///< "/dev/bus/usb/001/002"
  std::vector<std::string>
      files;  ///< Through which a program may be using it: the node, and terminals of a serial one.
};

[[nodiscard]] std::vector<UsbListing> list_devices(libusb_context* context);

/// Programs that have one of these files open, "haptic_node (pid 4711)", as far as this user may see; never this
/// process.
[[nodiscard]] std::vector<std::string> users_of(const std::vector<std::string>& files);

/// The sentence for a libusb error code at `what`: "claiming interface 0: haptic_node (pid 4711) has it; …". `users`:
/// who has the device, where that can be seen.
[[nodiscard]] std::string explain(int libusb_error, const std::string& what,
                                  const std::vector<std::string>& users = {});

}  // namespace drivers::usb
