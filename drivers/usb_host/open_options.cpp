#include "drivers/usb_host/open_options.hpp"

#include <dlfcn.h>

#include <filesystem>
#include <utility>

#include "drivers/usb_host/libusb_channel.hpp"
#include "drivers/virtual_usb/usbfs_shim.hpp"

namespace drivers::usb {

namespace {

using rtbus::Failure;
using OpenResult = rtbus::Result<ChannelOpener, DeviceFault>;

/// A virtual device on its port; the port goes first.
struct Plugged {
  virtual_usb::VirtualDevice virtual_device;
  std::unique_ptr<virtual_usb::UsbfsPort> port;
  std::shared_ptr<void> watch;  ///< Goes before the port.
};

/// @param context Of the node; null: a tool only asks it something.
OpenResult virtual_opener(const virtual_usb::DeviceMaker& make, const DeviceMatch& match, const OpenContext* context) {
  const auto function =
      reinterpret_cast<virtual_usb::UsbfsShimFunction>(dlsym(RTLD_DEFAULT, virtual_usb::kUsbfsShimSymbol));
  if (function == nullptr) {
    std::error_code failed;
    const auto folder = std::filesystem::read_symlink("/proc/self/exe", failed).parent_path();
    return Failure{DeviceFault{std::string("usb.virtual needs ") + virtual_usb::kUsbfsShimLibrary +
                               " in front of the C library: start the session with `rtbus run`, or set LD_PRELOAD=" +
                               (folder / virtual_usb::kUsbfsShimLibrary).string() + " for this program"}};
  }
  const virtual_usb::UsbfsShim* const shim = function();
  if (shim->abi_version != virtual_usb::kShimAbiVersion || shim->faults_bytes != sizeof(virtual_usb::Faults)) {
    return Failure{DeviceFault{std::string(virtual_usb::kUsbfsShimLibrary) +
                               " belongs to another build of this program; build both again"}};
  }
  auto plugged = std::make_shared<Plugged>();
  plugged->virtual_device = make();
  plugged->port = shim->attach(*plugged->virtual_device.device, plugged->virtual_device.faults);
  if (context != nullptr && plugged->virtual_device.watch) {
    plugged->watch = plugged->virtual_device.watch(*plugged->port, context->session, context->node_name);
  }
  return ChannelOpener([plugged, match](StopFlag& stop) -> rtbus::Result<std::unique_ptr<Channel>, DeviceFault> {
    const int fd = plugged->port->open();
    if (fd < 0) return Failure{DeviceFault{"the virtual device is unplugged"}};
    return LibusbChannel::open_fd(fd, match, stop);
  });
}

}  // namespace

OpenOptions parse_open_options(rtbus::config::Map& file, const virtual_usb::Kind* virtual_kind) {
  OpenOptions out;
  out.serial = file.text("serial", "");
  auto usb = file.optional_map("usb");
  if (!usb) return out;
  if (auto settings = usb->optional_map("virtual")) {
    if (virtual_kind == nullptr) usb->fail("virtual", "is not there for this driver; leave it out");
    out.virtual_device = virtual_kind->parse(*settings);
    settings->finish();
  }
  usb->finish();
  return out;
}

UsbDeviceConfig::UsbDeviceConfig(IoSettings settings, DeviceMatch match, OpenOptions options, ProtocolFactory protocol,
                                 UsbTooling tooling)
    : settings_(std::move(settings)),
      match_(std::move(match)),
      options_(std::move(options)),
      protocol_(std::move(protocol)),
      tooling_(std::move(tooling)) {
  match_.serial = options_.serial;
  settings_.info.serial = options_.serial;
}

std::string UsbDeviceConfig::preload() const { return options_.virtual_device ? virtual_usb::kUsbfsShimLibrary : ""; }

OpenResult UsbDeviceConfig::opener(const OpenContext* context) const {
  if (options_.virtual_device) return virtual_opener(*options_.virtual_device, match_, context);
  return ChannelOpener([match = match_](StopFlag& stop) { return LibusbChannel::open(match, stop); });
}

rtbus::Result<std::unique_ptr<Device>, DeviceFault> UsbDeviceConfig::open(const OpenContext& context) const {
  auto opener = this->opener(&context);
  if (!opener) return Failure{opener.error()};
  const IoThread place{.priority = context.loop_priority + 1, .core = context.loop_core};
  return std::unique_ptr<Device>(make_io_device(settings_, place, protocol_, std::move(*opener)));
}

}  // namespace drivers::usb
