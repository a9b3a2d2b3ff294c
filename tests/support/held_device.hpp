#pragma once
/// @file held_device.hpp
/// A device and a physics of the test's own, for a haptic loop whose cycles the test calls.
#include <utility>

#include "drivers/device.hpp"
#include "haptic_node/loop.hpp"

namespace tests {

/// A device that reads what the test has put into `sample`, at the time of the read, and answers each write as told.
class HeldDevice final : public drivers::Device {
 public:
  explicit HeldDevice(drivers::DeviceInfo info) : info_(std::move(info)) {}
  [[nodiscard]] const drivers::DeviceInfo& info() const noexcept override { return info_; }
  [[nodiscard]] rtbus::Result<void, drivers::DeviceFault> start(std::uint64_t) override { return {}; }
  [[nodiscard]] drivers::IoStatus read(std::uint64_t now_ns,
                                       drivers::DeviceSample& out) noexcept RTBUS_NONBLOCKING override {
    out = sample;
    out.time_ns = now_ns;
    return drivers::IoStatus::kOk;
  }
  [[nodiscard]] drivers::IoStatus write(std::uint64_t,
                                        const drivers::ForceCommand& command) noexcept RTBUS_NONBLOCKING override {
    asked_n = command.force_n;
    if (answer == drivers::IoStatus::kOk) taken_n = asked_n;
    return answer;
  }
  [[nodiscard]] std::uint64_t clamped() const noexcept RTBUS_NONBLOCKING override { return 0; }
  void stop() noexcept override {}

  drivers::DeviceSample sample{};
  drivers::IoStatus answer = drivers::IoStatus::kOk;
  drivers::Vec3 asked_n{};  ///< By the last write.
  drivers::Vec3 taken_n{};  ///< By the last write that succeeded.

 private:
  drivers::DeviceInfo info_;
};

/// A physics that hears and never answers.
class SilentPhysics final : public haptic::PhysicsLink {
 public:
  void send(const rtbus::DeviceState& state, std::uint64_t) noexcept RTBUS_NONBLOCKING override { heard = state; }
  [[nodiscard]] bool receive(rtbus::Stamped<rtbus::ProxyState>&) noexcept RTBUS_NONBLOCKING override { return false; }
  [[nodiscard]] bool receive(rtbus::Stamped<rtbus::Heartbeat>&) noexcept RTBUS_NONBLOCKING override { return false; }

  rtbus::DeviceState heard;
};

}  // namespace tests
