#pragma once
/// @file open_options.hpp
/// What all device files of USB drivers have in common, and the DeviceConfig made from it.
///
///     serial: "A1B2C3"            # which one, when several are plugged in
///     usb:
///       virtual: {…}              # no hardware: a virtual device inside the node (drivers/virtual_usb/registry.hpp)
///
/// A driver's parse() reads its own keys, calls parse_open_options() and returns a UsbDeviceConfig:
///
///     std::unique_ptr<DeviceConfig> parse(rtbus::config::Map& file) {
///       Settings settings = read_my_keys(file);
///       IoSettings io{.info = info_of(settings)};
///       DeviceMatch match{.vendor_id = 0x0403, .product_id = 0xcb48};
///       return std::make_unique<usb::UsbDeviceConfig>(io, match, usb::parse_open_options(file, "falcon"),
///                                                     [settings] { return std::make_unique<MyProtocol>(settings); });
///     }
#include <memory>
#include <optional>
#include <string>
#include <string_view>

#include "drivers/registry.hpp"
#include "drivers/usb/io_device.hpp"
#include "drivers/virtual_usb/registry.hpp"
#include "rtbus/config/document.hpp"

namespace drivers::usb {

struct OpenOptions {
  std::string serial;                                      ///< Empty: the only one.
  std::optional<virtual_usb::DeviceMaker> virtual_device;  ///< `usb: {virtual: …}`.
};

/// Reads `serial` and `usb`. @param virtual_kind The row of virtual_usb::kinds() behind `usb: {virtual: …}`.
/// Throws rtbus::config::Error.
[[nodiscard]] OpenOptions parse_open_options(rtbus::config::Map& file, std::string_view virtual_kind);

/// A checked device file of a USB driver.
class UsbDeviceConfig final : public DeviceConfig {
 public:
  UsbDeviceConfig(IoSettings settings, DeviceMatch match, OpenOptions options, ProtocolFactory protocol);

  [[nodiscard]] const DeviceInfo& info() const noexcept override { return settings_.info; }
  [[nodiscard]] bool uses_usb() const noexcept override { return true; }
  [[nodiscard]] std::string preload() const override;
  /// Makes the IoDevice; nothing is asked of the bus before its start().
  [[nodiscard]] rtbus::Result<std::unique_ptr<Device>, DeviceFault> open(const OpenContext& context) const override;

 private:
  IoSettings settings_;
  DeviceMatch match_;
  OpenOptions options_;
  ProtocolFactory protocol_;
};

}  // namespace drivers::usb
