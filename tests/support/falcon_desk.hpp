#pragma once
/// @file falcon_desk.hpp
/// A virtual Falcon that is plugged in, its driver through libusb, and a loop, all in this process and in real time.
#include <algorithm>
#include <memory>

#include "drivers/falcon/boot_stream.hpp"
#include "drivers/falcon/falcon_protocol.hpp"
#include "drivers/usb_host/libusb_channel.hpp"
#include "drivers/usb_host/usb_line.hpp"
#include "drivers/virtual_devices/falcon/virtual_falcon.hpp"
#include "drivers/virtual_usb/usbfs_shim.hpp"
#include "rtbus/clock.hpp"

namespace tests {

using namespace drivers;
using namespace drivers::falcon;
using Eigen::Vector3d;
using virtual_usb::VirtualFalcon;
using virtual_usb::VirtualFalconSettings;

inline DeviceInfo info() {
  DeviceInfo out;
  out.model = "novint_falcon";
  out.max_force_n = 8.0;
  out.force_timeout_s = 0.020;
  out.can_pace_loop = true;
  out.sample_rate_hz = 1000.0;
  return out;
}

inline VirtualFalconSettings held(const Vector3d& at_m) {
  VirtualFalconSettings out;
  out.arm.homing = virtual_usb::FalconHoming::kDone;
  out.arm.hand = {simulated::HoldMotion{at_m}, {2000.0, 20.0, 0.15, 40.0}};
  out.arm.mechanics.start_position_m = at_m;
  return out;
}

// A Falcon that is plugged in, its driver, and a loop.
class Desk {
 public:
  explicit Desk(const VirtualFalconSettings& settings, bool event_character = false)
      : falcon(settings), port(rtbus_usbfs_shim()->attach(falcon, settings.board.faults)) {
    FalconSettings driver;
    FirmwareImage image = make_firmware_image(synthetic_boot_stream(2000), "synthetic").value();
    image.known_as = "synthetic";
    driver.firmware = std::make_shared<const FirmwareImage>(std::move(image));
    driver.event_character = event_character;
    usb::IoSettings io{.info = info()};
    if (event_character) io.order = usb::ExchangeOrder::kFetchFirst;
    io.device_paces = !event_character;
    device = usb::make_io_device(
        io, usb::IoThread{}, [driver] { return std::make_unique<FalconProtocol>(driver); },
        [this](usb::StopFlag& stop) -> rtbus::Result<std::unique_ptr<usb::Channel>, DeviceFault> {
          const int fd = port->open();
          if (fd < 0) return rtbus::Failure{DeviceFault{"unplugged"}};
          return usb::LibusbChannel::open_fd(fd, {.vendor_id = kVendorId, .product_id = kProductId, .serial = ""},
                                             stop);
        });
  }
  ~Desk() {
    device->stop();
    port.reset();
  }

  // The loop, paced by the device, for so many samples or until it took too long.
  template <class Law>
  int loop(int samples, Law law) {
    const std::uint64_t give_up_ns = rtbus::monotonic_ns() + 60 * rtbus::kNsPerS;
    int done = 0;
    while (done < samples && rtbus::monotonic_ns() < give_up_ns) {
      const std::uint64_t deadline_ns = rtbus::monotonic_ns() + 2 * rtbus::kNsPerMs;
      if (device->wait_sample(deadline_ns) == IoStatus::kLost) rtbus::sleep_until(deadline_ns);
      const std::uint64_t now_ns = rtbus::monotonic_ns();
      if (device->read(now_ns, sample) != IoStatus::kOk) continue;
      ++done;
      (void)device->write(now_ns, {law(sample)});
    }
    return done;
  }

  Vector3d applied_n() {
    Vector3d out;
    port->locked([&] {
      falcon.arm().advance_to(rtbus::monotonic_ns());
      out = falcon.arm().mechanics().applied_force_n();
    });
    return out;
  }

  VirtualFalcon falcon;
  std::unique_ptr<virtual_usb::UsbfsPort> port;
  std::unique_ptr<usb::IoDevice> device;
  DeviceSample sample;
};

}  // namespace tests
