#pragma once
/// @file usbfs_shim.hpp
/// Virtual devices behind file descriptors that libusb takes for usbfs ones (libusb_wrap_sys_device).
///
/// libvirtual_usb.so defines ioctl, read, lseek and close in front of the C library's: for the descriptors it made it
/// answers as the kernel's usbfs does, anything else it passes on. It has to come first in the search order of the
/// process: a program links it, or it is named in LD_PRELOAD (`rtbus run` does that for nodes whose device file has
/// `usb: {virtual: …}`). Everything above the descriptor is the real thing: libusb, transfers, unplugging.
///
/// The descriptor is the writing end of a pipe of one page: libusb waits for POLLOUT, which a byte in the pipe holds
/// off until a transfer is done; unplugging closes the reading end, which gives POLLERR, as usbfs does.
///
/// @par Threads
/// One thread per device lets its time pass (`usb_virtual`, SCHED_FIFO where granted). A lock per device; any thread.
#include <cstdint>
#include <functional>
#include <memory>
#include <string>

#include "drivers/virtual_usb/usb_device.hpp"

namespace drivers::virtual_usb {

/// The socket that a virtual device is plugged into.
class UsbfsPort {
 public:
  virtual ~UsbfsPort() = default;  ///< Unplugs. Descriptors that are still open give ENODEV.

  /// A descriptor for libusb_wrap_sys_device(), to be closed by the caller; one at a time. −1: errno is ENODEV while
  /// unplugged, EBUSY while another one is open.
  [[nodiscard]] virtual int open() = 0;
  virtual void unplug() = 0;
  virtual void replug() = 0;
  /// As if the kernel's driver of that name had the interface: claiming it needs detaching.
  virtual void bind_kernel_driver(int interface, const std::string& name) = 0;
  [[nodiscard]] virtual std::string kernel_driver(int interface) = 0;
  /// Runs `change` while the device stands still; then whatever it made possible happens.
  virtual void locked(const std::function<void()>& change) = 0;
};

/// Raise it when UsbfsPort, UsbDevice, Faults or this table change.
inline constexpr std::uint32_t kShimAbiVersion = 2;

struct UsbfsShim {
  std::uint32_t abi_version;
  std::uint32_t faults_bytes;  ///< sizeof(Faults) as the library saw it.
  /// Plugs the device in. It must outlive the port. Of the faults, unplug_at_s and replug_after_s are the port's.
  std::unique_ptr<UsbfsPort> (*attach)(UsbDevice& device, const Faults& faults);
};

/// The one symbol of libvirtual_usb.so that is asked for by name.
using UsbfsShimFunction = const UsbfsShim* (*)();
inline constexpr char kUsbfsShimSymbol[] = "rtbus_usbfs_shim";
inline constexpr char kUsbfsShimLibrary[] = "libvirtual_usb.so";

}  // namespace drivers::virtual_usb

extern "C" const drivers::virtual_usb::UsbfsShim* rtbus_usbfs_shim();
