#include "drivers/falcon/falcon_config.hpp"

#include <utility>

#include "drivers/usb/open_options.hpp"

namespace drivers::falcon {

std::unique_ptr<DeviceConfig> parse(rtbus::config::Map& file) {
  FalconFile read = read_settings(file);
  usb::IoSettings io{.info = std::move(read.info)};
  // A chip that answers at once would else hand over samples that wait for most of a period.
  io.fetch_first = read.settings.event_character;
  io.device_paces = !io.fetch_first;
  const usb::DeviceMatch match{.vendor_id = kVendorId, .product_id = kProductId, .serial = ""};
  return std::make_unique<usb::UsbDeviceConfig>(
      std::move(io), match, usb::parse_open_options(file, "falcon"),
      [settings = std::move(read.settings)] { return std::make_unique<FalconProtocol>(settings); });
}

}  // namespace drivers::falcon
