#pragma once
/// @file simulated_device.hpp
/// The simulated device inside the haptic node: mechanics and hand behind the device interface.
///
/// It advances by the time that really passed between calls and holds the last force meanwhile, so a late loop is felt
/// as on hardware; handed a stepped clock it repeats bit by bit. Samples are stamped with the time of the read: like a
/// real host, nobody knows of the sample jitter.
#include "drivers/device.hpp"
#include "drivers/simulated/mechanics.hpp"
#include "drivers/simulated/simulated_config.hpp"

namespace drivers::simulated {

class SimulatedDevice final : public Device {
 public:
  explicit SimulatedDevice(const SimulatedSettings& settings);
  ~SimulatedDevice() override { SimulatedDevice::stop(); }

  [[nodiscard]] const DeviceInfo& info() const noexcept override { return info_; }
  [[nodiscard]] rtbus::Result<void, DeviceFault> start(std::uint64_t now_ns) override;
  /// Sleeps once, to the device's next sample of `sample_rate_hz` (or to the deadline). A caller that comes late gets
  /// the sample that is due at once; the ones in between are lost, as in a device that keeps only its newest.
  [[nodiscard]] IoStatus wait_sample(std::uint64_t deadline_ns) noexcept override;
  [[nodiscard]] IoStatus read(std::uint64_t now_ns, DeviceSample& out) noexcept RTBUS_NONBLOCKING override;
  [[nodiscard]] IoStatus write(std::uint64_t now_ns, const ForceCommand& command) noexcept RTBUS_NONBLOCKING override;
  [[nodiscard]] std::uint64_t clamped() const noexcept RTBUS_NONBLOCKING override { return clamped_; }
  void stop() noexcept override;

  /// What the hand feels and where the tip really is, for the harness and tests.
  [[nodiscard]] const Mechanics& mechanics() const noexcept { return mechanics_; }
  [[nodiscard]] Mechanics& mechanics() noexcept { return mechanics_; }

 private:
  DeviceInfo info_;
  Mechanics mechanics_;
  std::uint64_t force_timeout_ns_;
  std::uint64_t sample_period_ns_;
  std::uint64_t next_sample_ns_ = 0;
  std::uint64_t clamped_ = 0;
  bool running_ = false;
};

}  // namespace drivers::simulated
