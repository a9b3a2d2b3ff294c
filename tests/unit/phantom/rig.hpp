#pragma once
/// @file rig.hpp
/// Protocol, channel and virtual arm in simulated time: one exchange per millisecond.
#include <memory>
#include <utility>

#include "drivers/phantom/phantom_protocol.hpp"
#include "drivers/virtual_devices/phantom/virtual_phantom.hpp"
#include "drivers/virtual_usb/virtual_channel.hpp"
#include "rtbus/clock.hpp"

namespace drivers::phantom::testing {

constexpr std::uint64_t kMs = rtbus::kNsPerMs;

inline const Model& model(ModelId id) { return *find_model(static_cast<int>(id)); }

/// A calibrated arm that a rigid hand holds at a point for ever.
inline virtual_usb::VirtualPhantomSettings held(ModelId id, const Eigen::Vector3d& at = Eigen::Vector3d::Zero()) {
  virtual_usb::VirtualPhantomSettings settings;
  settings.model = model(id);
  settings.mechanics = virtual_usb::mechanics_of(settings.model);
  settings.mechanics.start_position_m = at;
  settings.hand = simulated::Hand(simulated::DropMotion{at, 1e6}, simulated::HandImpedance{});
  return settings;
}

struct Rig {
  explicit Rig(virtual_usb::VirtualPhantomSettings settings, HomingMode mode = HomingMode::kCounters,
               PhantomSettings driver = {})
      : device(settings), channel(device, {.interfaces = {0, 1}, .faults = settings.faults}) {
    driver.model = settings.model;
    driver.homing = mode;
    homing = std::make_shared<Homing>(Kinematics(driver.model), mode, driver.home_tolerance_rad);
    protocol = std::make_unique<PhantomProtocol>(driver, homing);
  }

  [[nodiscard]] std::string bring_up() {
    const auto done = protocol->bring_up(channel);
    due_ns = channel.now_ns();
    return done ? "" : done.error().message;
  }

  /// One period: sends, waits for the answer like the I/O thread does, sleeps until the next.
  usb::ExchangeStatus exchange(const Vec3& force_n) {
    const auto sent = protocol->send(channel, force_n, 1e-3, channel.now_ns() + 12 * kMs);
    usb::ExchangeStatus got = usb::ExchangeStatus::kLost;
    if (sent != usb::UsbStatus::kLost) got = protocol->receive(channel, sample, channel.now_ns() + 12 * kMs);
    due_ns = std::max(due_ns + kMs, channel.now_ns());
    (void)channel.sleep_until(due_ns);
    device.advance_to(channel.now_ns());
    return got;
  }

  /// @returns exchanges that gave a sample.
  int run(int exchanges, const Vec3& force_n = {}) {
    int samples = 0;
    for (int i = 0; i < exchanges; ++i) samples += exchange(force_n) == usb::ExchangeStatus::kSample;
    return samples;
  }

  [[nodiscard]] Eigen::Vector3d tip_force_n() { return device.arm().mechanics().applied_force_n(); }
  [[nodiscard]] Eigen::Vector3d measured_m() const {
    return {sample.position_m[0], sample.position_m[1], sample.position_m[2]};
  }

  virtual_usb::VirtualPhantom device;
  virtual_usb::VirtualChannel channel;
  std::shared_ptr<Homing> homing;
  std::unique_ptr<PhantomProtocol> protocol;
  DeviceSample sample;
  std::uint64_t due_ns = 0;
};

}  // namespace drivers::phantom::testing
