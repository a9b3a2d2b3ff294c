#include "drivers/falcon/falcon_config.hpp"

#include <optional>
#include <utility>

#include "drivers/usb_host/open_options.hpp"
#include "rtbus/eigen.hpp"

namespace drivers::falcon {

std::unique_ptr<DeviceConfig> parse(rtbus::config::Map& file, const virtual_usb::Kind* virtual_kind) {
  FalconFile read = read_settings(file);
  usb::IoSettings io{.info = std::move(read.info)};
  // A chip that answers at once would else hand over samples that wait for most of a period.
  if (read.settings.event_character) io.order = usb::ExchangeOrder::kFetchFirst;
  io.device_paces = !read.settings.event_character;
  const usb::DeviceMatch match{.vendor_id = kVendorId, .product_id = kProductId, .serial = ""};
  const FalconSettings settings = std::move(read.settings);
  usb::UsbTooling tooling{&inspect, [settings](const Vec3& p_DT) -> std::optional<Vec3> {
                            const Kinematics kinematics(settings.geometry);
                            const auto angles = kinematics.inverse_rad(settings.centre_m + rtbus::vector_of(p_DT));
                            if (!angles) return std::nullopt;
                            return rtbus::array_of(kinematics.counts(*angles));
                          }};
  return std::make_unique<usb::UsbDeviceConfig>(
      std::move(io), match, usb::parse_open_options(file, virtual_kind),
      [settings] { return std::make_unique<FalconProtocol>(settings); }, std::move(tooling));
}

usb::Inspection inspect(usb::Channel& channel) { return FalconProtocol(FalconSettings{}).inspect(channel); }

}  // namespace drivers::falcon
