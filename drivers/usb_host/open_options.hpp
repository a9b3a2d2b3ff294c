#pragma once
/// @file open_options.hpp
/// What all device files of USB drivers have in common, and the DeviceConfig made from it.
///
///     serial: "A1B2C3"            # which one, when several are plugged in
///     usb:
///       virtual: {…}              # no hardware: a virtual device inside the node (drivers/virtual_usb/kind.hpp)
///
/// A driver's parse() reads its own keys, calls parse_open_options() and returns a UsbDeviceConfig. The kind of virtual
/// device comes from the row in drivers/usb_module/module.cpp; null: there is none for this driver.
///
///     std::unique_ptr<DeviceConfig> parse(rtbus::config::Map& file, const virtual_usb::Kind* virtual_kind) {
///       Settings settings = read_my_keys(file);
///       IoSettings io{.info = info_of(settings)};
///       DeviceMatch match{.vendor_id = 0x0403, .product_id = 0xcb48};
///       return std::make_unique<usb::UsbDeviceConfig>(io, match, usb::parse_open_options(file, virtual_kind),
///                                                     [settings] { return std::make_unique<MyProtocol>(settings); });
///     }
#include <memory>
#include <optional>
#include <string>

#include "drivers/device_config.hpp"
#include "drivers/usb/inspection.hpp"
#include "drivers/usb_host/usb_line.hpp"
#include "drivers/virtual_usb/kind.hpp"
#include "rtbus/config/document.hpp"

namespace drivers::usb {

struct OpenOptions {
  std::string serial;                                      ///< Empty: the only one.
  std::optional<virtual_usb::DeviceMaker> virtual_device;  ///< `usb: {virtual: …}`.
};

/// Reads `serial` and `usb`. @param virtual_kind What `usb: {virtual: …}` makes; null: the key is an error.
/// Throws rtbus::config::Error.
[[nodiscard]] OpenOptions parse_open_options(rtbus::config::Map& file, const virtual_usb::Kind* virtual_kind);

/// What tools may ask of a driver besides driving its device; each may be empty.
struct UsbTooling {
  Inspector inspect;
  /// Encoder counts [count] that belong to a position of the tip [m, frame D]; none where the linkage cannot be.
  std::function<std::optional<Vec3>(const Vec3& position_m)> joint_counts;
};

/// A checked device file of a USB driver.
class UsbDeviceConfig final : public DeviceConfig {
 public:
  UsbDeviceConfig(IoSettings settings, DeviceMatch match, OpenOptions options, ProtocolFactory protocol,
                  UsbTooling tooling = {});

  [[nodiscard]] const DeviceInfo& info() const noexcept override { return settings_.info; }
  [[nodiscard]] bool uses_usb() const noexcept override { return true; }
  [[nodiscard]] std::string preload() const override;
  /// Makes the IoDevice; nothing is asked of the bus before its start().
  [[nodiscard]] rtbus::Result<std::unique_ptr<Device>, DeviceFault> open(const OpenContext& context) const override;

  [[nodiscard]] const DeviceMatch& match() const noexcept { return match_; }
  [[nodiscard]] const UsbTooling& tooling() const noexcept { return tooling_; }
  /// A fresh virtual device of this file; null: it is about a real one.
  [[nodiscard]] virtual_usb::VirtualDevice make_virtual() const {
    return options_.virtual_device ? (*options_.virtual_device)() : virtual_usb::VirtualDevice{};
  }
  /// How the device is reached. For a virtual one: a fresh device, which lives as long as the opener.
  /// @param context Of the node that drives it; null: a tool that asks it something.
  [[nodiscard]] rtbus::Result<ChannelOpener, DeviceFault> opener(const OpenContext* context = nullptr) const;

 private:
  IoSettings settings_;
  DeviceMatch match_;
  OpenOptions options_;
  ProtocolFactory protocol_;
  UsbTooling tooling_;
};

}  // namespace drivers::usb
