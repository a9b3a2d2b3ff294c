#pragma once
// A virtual device on a usbfs descriptor of this process, and a protocol over it: the real libusb path without a bus.
#include <sched.h>

#include <atomic>
#include <cstring>
#include <memory>
#include <vector>

#include "drivers/usb_host/libusb_channel.hpp"
#include "drivers/usb_host/usb_line.hpp"
#include "drivers/virtual_usb/usbfs_shim.hpp"
#include "tests/support/echo_device.hpp"

namespace tests {

/// An echo device, plugged in.
struct EchoPort {
  explicit EchoPort(const drivers::virtual_usb::Faults& faults = {}, bool high_speed = false)
      : device(u"E1", high_speed), port(rtbus_usbfs_shim()->attach(device, faults)) {}

  rtbus::Result<std::unique_ptr<drivers::usb::Channel>, drivers::DeviceFault> open(drivers::usb::StopFlag& stop) {
    const int fd = port->open();
    if (fd < 0) return rtbus::Failure{drivers::DeviceFault{"the virtual device is unplugged"}};
    return drivers::usb::LibusbChannel::open_fd(fd, {EchoDevice::kVendor, EchoDevice::kProduct, "", {0}}, stop);
  }
  template <class Change>
  void locked(Change change) {
    port->locked(change);
  }

  EchoDevice device;
  std::unique_ptr<drivers::virtual_usb::UsbfsPort> port;
};

/// 16 bytes there, 16 bytes back: a number and the force; the measurement is the force that arrived, as a position.
class EchoProtocol final : public drivers::usb::Protocol {
 public:
  using Channel = drivers::usb::Channel;
  using UsbStatus = drivers::usb::UsbStatus;
  using ExchangeStatus = drivers::usb::ExchangeStatus;

  struct Settings {
    std::string fail_with = {};                   ///< bring_up() fails with this text.
    bool wait_in_bring_up = false;                ///< Never ends by itself.
    const std::atomic<bool>* homed = nullptr;     ///< Null: always ready.
    const std::atomic<bool>* fault = nullptr;     ///< receive() reports a fault while it is set.
    const std::atomic<bool>* withhold = nullptr;  ///< send() makes a force zero while it is set.
    std::atomic<int>* bring_up_policy = nullptr;  ///< How the thread was scheduled in bring_up(), …
    std::atomic<int>* exchange_policy = nullptr;  ///< … and in the newest send().
    std::atomic<int>* shut_downs = nullptr;
  };
  explicit EchoProtocol(Settings settings) : settings_(std::move(settings)) {}

  rtbus::Result<void, drivers::DeviceFault> bring_up(Channel& channel) override {
    if (settings_.bring_up_policy != nullptr) settings_.bring_up_policy->store(::sched_getscheduler(0));
    if (!settings_.fail_with.empty()) return rtbus::Failure{drivers::DeviceFault{settings_.fail_with}};
    while (settings_.wait_in_bring_up) {
      if (channel.sleep_until(channel.now_ns() + 1'000'000'000) == UsbStatus::kStopping) {
        return rtbus::Failure{drivers::DeviceFault{"stopped"}};
      }
    }
    return {};
  }

  UsbStatus send(Channel& channel, const drivers::Vec3& asked_n, double, std::uint64_t deadline_ns) noexcept override {
    if (settings_.exchange_policy != nullptr) settings_.exchange_policy->store(::sched_getscheduler(0));
    const bool withhold = settings_.withhold != nullptr && settings_.withhold->load();
    withheld_ = withhold && asked_n != drivers::Vec3{};
    const drivers::Vec3 force_n = withhold ? drivers::Vec3{} : asked_n;
    const float frame[4] = {static_cast<float>(++number_ % 1000), static_cast<float>(force_n[0]),
                            static_cast<float>(force_n[1]), static_cast<float>(force_n[2])};
    std::memcpy(out_, frame, sizeof frame);
    return channel.write(out_, deadline_ns);
  }

  ExchangeStatus receive(Channel& channel, drivers::DeviceSample& out, std::uint64_t deadline_ns) noexcept override {
    if (settings_.fault != nullptr && settings_.fault->load()) return ExchangeStatus::kFault;
    std::size_t got = 0;
    for (;;) {
      switch (channel.read(in_, got, deadline_ns)) {
        case UsbStatus::kOk:
          break;
        case UsbStatus::kLost:
          return ExchangeStatus::kLost;
        case UsbStatus::kStopping:
          return ExchangeStatus::kStopping;
        default:
          ++counters_.lost_frames;
          return ExchangeStatus::kNothing;
      }
      float frame[4];
      std::memcpy(frame, in_, sizeof frame);
      if (got != sizeof frame || frame[0] != static_cast<float>(number_ % 1000)) {  // a late answer to an older one
        ++counters_.bad_frames;
        continue;
      }
      ++counters_.exchanges;
      out.time_ns = channel.now_ns();
      out.position_m = {1e-3 * frame[1], 1e-3 * frame[2], 1e-3 * frame[3]};
      return ExchangeStatus::kSample;
    }
  }

  void shut_down(Channel& channel) noexcept override {
    (void)send(channel, {}, 0.001, channel.now_ns() + 20'000'000);
    if (settings_.shut_downs != nullptr) ++*settings_.shut_downs;
  }

  drivers::usb::Readiness readiness() const noexcept override {
    return settings_.homed == nullptr || settings_.homed->load() ? drivers::usb::Readiness::kReady
                                                                 : drivers::usb::Readiness::kNotHomed;
  }
  std::string remedy() const override { return "move the handle to its rest"; }
  std::string fault() const override { return "the device reports overheating"; }
  bool withheld() const noexcept override { return withheld_; }
  const drivers::usb::LinkCounters& counters() const noexcept override { return counters_; }

 private:
  Settings settings_;
  drivers::usb::LinkCounters counters_;
  std::uint64_t number_ = 0;
  bool withheld_ = false;
  std::uint8_t out_[16] = {};
  std::uint8_t in_[512] = {};
};

/// Force of a command [N].
inline drivers::Vec3 force_of(const std::vector<std::uint8_t>& command) {
  float frame[4] = {};
  if (command.size() == sizeof frame) std::memcpy(frame, command.data(), sizeof frame);
  return {frame[1], frame[2], frame[3]};
}
/// Force that the echo device got last [N]; under the port's lock.
inline drivers::Vec3 force_at(const EchoDevice& device) { return force_of(device.last_command); }

}  // namespace tests
