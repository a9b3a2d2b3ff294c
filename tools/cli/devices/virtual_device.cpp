// `rtbus virtual-device`: a virtual USB device that the kernel's USB/IP client can attach, for any program.
#include <sys/mman.h>
#include <unistd.h>

#include <cstdio>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "drivers/usb_module/usb_module.hpp"
#include "rtbus/config/document.hpp"
#include "tools/cli/common/command.hpp"
#include "tools/cli/common/interrupt.hpp"
#if RTBUS_WITH_USB
#include "drivers/virtual_usb/usbip_server.hpp"
#endif

namespace tools {

namespace {

struct VirtualDeviceOptions {
  std::string kind;
  std::string hand;
  std::string usbip = "127.0.0.1:3240";
  std::vector<std::string> faults;
  std::vector<std::string> assignments;
};

#if RTBUS_WITH_USB

/// The settings of a model are a map like that of a device file; here it begins empty and is filled by options.
drivers::virtual_usb::DeviceMaker read_settings(const VirtualDeviceOptions& options,
                                                const drivers::virtual_usb::Kind& kind) {
  std::vector<rtbus::config::Override> overrides;
  if (!options.hand.empty()) overrides.push_back({"hand", std::filesystem::absolute(options.hand).string()});
  for (const std::string& fault : options.faults) overrides.push_back(rtbus::config::parse_override("faults." + fault));
  for (const std::string& text : options.assignments) overrides.push_back(rtbus::config::parse_override(text));
  const int fd = ::memfd_create("virtual-device", MFD_CLOEXEC);
  constexpr std::string_view kEmpty = "schema: virtual/1\n";
  const std::string file = "/proc/self/fd/" + std::to_string(fd);
  if (fd < 0 || ::write(fd, kEmpty.data(), kEmpty.size()) != static_cast<ssize_t>(kEmpty.size())) {
    throw rtbus::config::Error("no memory for the settings of the device");
  }
  auto map = rtbus::config::load(file, overrides);
  ::close(fd);
  (void)map.choice("schema", {"virtual/1"});
  auto maker = kind.parse(map);
  map.finish();
  return maker;
}

int serve(const VirtualDeviceOptions& options) {
  const auto module = drivers::usb::load_usb_module();
  if (!module) {
    std::fprintf(stderr, "rtbus virtual-device %s\n", module.error().c_str());
    return kExitFailed;
  }
  const drivers::virtual_usb::Kind* const kind = (*module)->find_kind(options.kind);
  if (kind == nullptr) {
    std::string known;
    for (const std::string& name : (*module)->kind_names()) known += (known.empty() ? "" : ", ") + name;
    std::fprintf(stderr, "rtbus virtual-device: %s is not known; choose %s\n", options.kind.c_str(),
                 known.empty() ? "another build: this one has none" : known.c_str());
    return kExitUsage;
  }
  const std::size_t colon = options.usbip.rfind(':');
  const std::string port_text = colon == std::string::npos ? "" : options.usbip.substr(colon + 1);
  if (port_text.empty() || port_text.size() > 5 || port_text.find_first_not_of("0123456789") != std::string::npos ||
      std::stoi(port_text) > 65535) {
    std::fprintf(stderr, "rtbus virtual-device: --usbip %s is not ADDRESS:PORT, for example 127.0.0.1:3240\n",
                 options.usbip.c_str());
    return kExitUsage;
  }
  drivers::virtual_usb::DeviceMaker maker;
  try {
    maker = read_settings(options, *kind);
  } catch (const rtbus::config::Error& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return kExitUsage;
  }
  const std::string address = options.usbip.substr(0, colon);
  auto server =
      drivers::virtual_usb::UsbipServer::listen(maker(), address, static_cast<std::uint16_t>(std::stoi(port_text)));
  if (!server) {
    std::fprintf(stderr, "rtbus virtual-device: %s\n", server.error().c_str());
    return kExitFailed;
  }
  const int port = (*server)->port();
  const std::string tcp_port = port == 3240 ? "" : " --tcp-port " + std::to_string(port);
  std::printf("virtual %s at %s:%d; in another terminal:\n", options.kind.c_str(), address.c_str(), port);
  std::printf("  sudo modprobe vhci-hcd\n");
  std::printf("  sudo usbip%s attach -r %s -b 1-1\n", tcp_port.c_str(), address.c_str());
  std::printf("  rtbus devices                      # sudo usbip detach -p 0 takes it away again\n");
  std::printf("Ctrl-C ends it.\n");
  std::fflush(stdout);
  (*server)->on_event = [&](const std::string& text) {
    std::printf("%s\n", text.c_str());
    std::fflush(stdout);
  };
  (*server)->run([] { return interrupted(); });
  return kExitFine;
}

#else

int serve(const VirtualDeviceOptions&) {
  std::fprintf(stderr, "rtbus virtual-device: built without USB; build with RTBUS_WITH_USB=ON (libusb-1.0-0-dev)\n");
  return kExitFailed;
}

#endif

}  // namespace

Action add_virtual_device(rtbus::Command command) {
  auto options = std::make_shared<VirtualDeviceOptions>();
  command.option("kind", options->kind, "What: falcon, phantom").required().type_name("KIND");
  command.option("--hand", options->hand, "Script of the hand that holds it, as in a simulated device's `hand:`")
      .existing_file()
      .type_name("FILE");
  command.option("--usbip", options->usbip, "Where to listen; anybody who reaches it may attach")
      .show_default()
      .type_name("ADDRESS:PORT");
  command.option("--fault", options->faults, "A fault to play: --fault lose_reply=0.01 (docs/devices.md lists them)")
      .take_all()
      .type_name("NAME=VALUE");
  command.option("--set", options->assignments, "Another setting of the model").take_all().type_name("KEY=VALUE");
  return [options] { return serve(*options); };
}

}  // namespace tools
