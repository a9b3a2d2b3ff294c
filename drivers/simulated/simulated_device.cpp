#include "drivers/simulated/simulated_device.hpp"

#include <cmath>

#include "rtbus/clock.hpp"
#include "rtbus/eigen.hpp"

namespace drivers::simulated {

SimulatedDevice::SimulatedDevice(const SimulatedSettings& settings)
    : info_(settings.info),
      mechanics_(settings.mechanics, settings.hand),
      force_timeout_ns_(settings.force_timeout_ns()),
      sample_period_ns_(static_cast<std::uint64_t>(std::llround(1e9 / settings.sample_rate_hz))) {}

rtbus::Result<void, DeviceFault> SimulatedDevice::start(std::uint64_t now_ns) {
  mechanics_.reset(now_ns);
  mechanics_.begin_script(now_ns);
  next_sample_ns_ = now_ns + sample_period_ns_;
  clamped_ = 0;
  running_ = true;
  return {};
}

IoStatus SimulatedDevice::wait_sample(std::uint64_t deadline_ns) noexcept {
  if (!running_) return IoStatus::kLost;
  if (next_sample_ns_ > deadline_ns) {
    rtbus::sleep_until(deadline_ns);
    return IoStatus::kTimeout;
  }
  rtbus::sleep_until(next_sample_ns_);
  const std::uint64_t now_ns = rtbus::monotonic_ns();
  next_sample_ns_ += sample_period_ns_ * ((now_ns - next_sample_ns_) / sample_period_ns_ + 1);
  return IoStatus::kOk;
}

IoStatus SimulatedDevice::read(std::uint64_t now_ns, DeviceSample& out) noexcept RTBUS_NONBLOCKING {
  if (!running_) return IoStatus::kLost;
  mechanics_.advance_to(now_ns);
  out.position_m = rtbus::array_of(mechanics_.measure(now_ns));
  out.orientation_wxyz = {1, 0, 0, 0};
  out.buttons = mechanics_.buttons();
  out.time_ns = now_ns;
  return IoStatus::kOk;
}

IoStatus SimulatedDevice::write(std::uint64_t now_ns, const ForceCommand& command) noexcept RTBUS_NONBLOCKING {
  if (!running_) return IoStatus::kLost;
  mechanics_.advance_to(now_ns);
  if (!mechanics_.set_force(rtbus::vector_of(command.force_n), now_ns + force_timeout_ns_)) ++clamped_;
  return IoStatus::kOk;
}

void SimulatedDevice::stop() noexcept {
  mechanics_.set_force(Eigen::Vector3d::Zero(), Mechanics::kNever);
  running_ = false;
}

}  // namespace drivers::simulated
