#include "drivers/falcon/falcon_config.hpp"

#include <optional>
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
  const FalconSettings settings = std::move(read.settings);
  usb::UsbTooling tooling{&inspect, [settings](const Vec3& p_DT) -> std::optional<Vec3> {
                            const Kinematics kinematics(settings.geometry);
                            const auto angles =
                                kinematics.inverse_rad(settings.centre_m + Eigen::Vector3d(p_DT[0], p_DT[1], p_DT[2]));
                            if (!angles) return std::nullopt;
                            const Eigen::Vector3d counts = kinematics.counts(*angles);
                            return Vec3{counts.x(), counts.y(), counts.z()};
                          }};
  return std::make_unique<usb::UsbDeviceConfig>(
      std::move(io), match, usb::parse_open_options(file, "falcon"),
      [settings] { return std::make_unique<FalconProtocol>(settings); }, std::move(tooling));
}

usb::Inspection inspect(usb::Channel& channel) { return FalconProtocol(FalconSettings{}).inspect(channel); }

}  // namespace drivers::falcon
