#pragma once
/// @file resting_device.hpp
/// A device whose tip does not move, for tests of the loop.
#include <array>
#include <cstdint>

#include "drivers/device.hpp"

namespace haptic::test {

class RestingDevice final : public drivers::Device {
 public:
  explicit RestingDevice(const drivers::DeviceInfo& info) : info_(info) {}
  [[nodiscard]] const drivers::DeviceInfo& info() const noexcept override { return info_; }
  [[nodiscard]] rtbus::Result<void, drivers::DeviceFault> start(std::uint64_t) override { return {}; }
  [[nodiscard]] drivers::IoStatus read(std::uint64_t now_ns,
                                       drivers::DeviceSample& out) noexcept RTBUS_NONBLOCKING override {
    out = {};
    out.time_ns = now_ns;
    return drivers::IoStatus::kOk;
  }
  [[nodiscard]] drivers::IoStatus write(std::uint64_t,
                                        const drivers::ForceCommand& command) noexcept RTBUS_NONBLOCKING override {
    force_n = command.force_n;
    return drivers::IoStatus::kOk;
  }
  [[nodiscard]] std::uint64_t clamped() const noexcept RTBUS_NONBLOCKING override { return 0; }
  void stop() noexcept override {}

  std::array<double, 3> force_n{};  ///< As written last.

 private:
  drivers::DeviceInfo info_;
};

}  // namespace haptic::test
