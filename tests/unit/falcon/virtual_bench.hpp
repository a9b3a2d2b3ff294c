#pragma once
/// @file virtual_bench.hpp
/// A Falcon's protocol on a virtual Falcon in simulated time, and a loop that exchanges with it as the I/O thread does.
#include <functional>
#include <memory>
#include <string>

#include "drivers/falcon/boot_stream.hpp"
#include "drivers/falcon/falcon_protocol.hpp"
#include "drivers/virtual_devices/falcon/virtual_falcon.hpp"
#include "drivers/virtual_usb/virtual_channel.hpp"

namespace tests {

using namespace drivers;

class FalconBench {
 public:
  using Law = std::function<Vec3(const DeviceSample&)>;
  static constexpr double kReplyTimeoutS = 0.008;  // as the I/O thread's

  static std::shared_ptr<const falcon::FirmwareImage> synthetic(const std::string& known_as) {
    falcon::FirmwareImage image = falcon::make_firmware_image(falcon::synthetic_boot_stream(8492), "mine.bin").value();
    image.known_as = known_as;
    return std::make_shared<const falcon::FirmwareImage>(std::move(image));
  }

  explicit FalconBench(virtual_usb::VirtualFalconSettings device_settings = {}, falcon::FalconSettings settings = {},
                       virtual_usb::VirtualChannelOptions options = {})
      : device(std::move(device_settings)), channel(device, options) {
    if (!settings.firmware) settings.firmware = synthetic("known");
    if (settings.firmware->bytes.empty()) settings.firmware.reset();
    protocol = std::make_unique<falcon::FalconProtocol>(std::move(settings));
  }

  /// The reason it failed, or "".
  std::string bring_up() {
    const auto result = protocol->bring_up(channel);
    return result ? "" : result.error().message.empty() ? "(stopping)" : result.error().message;
  }

  /// One exchange; the status of the answer.
  usb::ExchangeStatus exchange(const Vec3& force_n) {
    const std::uint64_t sent_ns = channel.now_ns();
    const double dt_s = last_send_ns == 0 ? 0.0 : static_cast<double>(sent_ns - last_send_ns) * 1e-9;
    last_send_ns = sent_ns;
    const auto deadline_ns = sent_ns + static_cast<std::uint64_t>(kReplyTimeoutS * 1e9);
    switch (protocol->send(channel, force_n, dt_s, deadline_ns)) {
      case usb::UsbStatus::kLost:
        return usb::ExchangeStatus::kLost;
      case usb::UsbStatus::kStopping:
        return usb::ExchangeStatus::kStopping;
      default:
        return protocol->receive(channel, sample, deadline_ns);
    }
  }

  /// Exchanges for so long; the law sees each sample while the device is ready. False when the link was lost.
  bool run(
      double duration_s, const Law& law = [](const DeviceSample&) { return Vec3{}; }) {
    const std::uint64_t end_ns = channel.now_ns() + static_cast<std::uint64_t>(duration_s * 1e9);
    while (channel.now_ns() < end_ns) {
      const bool ready = protocol->readiness() == usb::Readiness::kReady;
      const auto status = exchange(ready ? law(sample) : Vec3{});
      if (status == usb::ExchangeStatus::kLost || status == usb::ExchangeStatus::kStopping) return false;
    }
    return true;
  }

  /// Seconds until all axes were homed and the script runs; −1: not within `limit_s`.
  double home(double limit_s = 5.0) {
    const std::uint64_t start_ns = channel.now_ns();
    while (static_cast<double>(channel.now_ns() - start_ns) < limit_s * 1e9) {
      if (!run(0.01)) return -1.0;
      if (protocol->readiness() == usb::Readiness::kReady && device.arm().script_began_ns() != 0) {
        return static_cast<double>(channel.now_ns() - start_ns) * 1e-9;
      }
    }
    return -1.0;
  }

  virtual_usb::VirtualFalcon device;
  virtual_usb::VirtualChannel channel;
  std::unique_ptr<falcon::FalconProtocol> protocol;
  DeviceSample sample;
  std::uint64_t last_send_ns = 0;
};

}  // namespace tests
