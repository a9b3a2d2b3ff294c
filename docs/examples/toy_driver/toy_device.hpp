#pragma once
// A driver without hardware: the tip is a mass on a damper, and only the force moves it.
// docs/writing-a-driver.md says what each function has to promise.
#include "drivers/device.hpp"
#include "drivers/device_config.hpp"
#include "rtbus/config/document.hpp"

namespace toy {

/// Reads the keys of a device file with `driver: toy`. Throws rtbus::config::Error.
std::unique_ptr<drivers::DeviceConfig> parse(rtbus::config::Map& file);

class Device final : public drivers::Device {
 public:
  explicit Device(const drivers::DeviceInfo& info) : info_(info) {}
  ~Device() override { stop(); }

  const drivers::DeviceInfo& info() const noexcept override { return info_; }
  rtbus::Result<void, drivers::DeviceFault> start(std::uint64_t now_ns) override;
  drivers::IoStatus read(std::uint64_t now_ns, drivers::DeviceSample& out) noexcept RTBUS_NONBLOCKING override;
  drivers::IoStatus write(std::uint64_t now_ns,
                          const drivers::ForceCommand& command) noexcept RTBUS_NONBLOCKING override;
  std::uint64_t clamped() const noexcept RTBUS_NONBLOCKING override { return clamped_; }
  void stop() noexcept override;

 private:
  void advance(std::uint64_t now_ns) noexcept RTBUS_NONBLOCKING;

  drivers::DeviceInfo info_;
  bool running_ = false;
  std::uint64_t time_ns_ = 0;       ///< Up to here the motion has been computed.
  std::uint64_t force_end_ns_ = 0;  ///< When the force ends by itself.
  drivers::Vec3 position_m_{}, velocity_m_s_{}, force_n_{};
  std::uint64_t clamped_ = 0;
};

}  // namespace toy
