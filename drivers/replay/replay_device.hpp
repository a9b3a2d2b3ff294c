#pragma once
/// @file replay_device.hpp
/// A device that moves as a recorded one did. Forces are taken and have no effect: the motion is what it was.
#include <cstdint>
#include <vector>

#include "drivers/device.hpp"
#include "rtbus/clock.hpp"

namespace drivers::replay {

/// Recorded samples, in order of time, at least one.
using Motion = std::vector<DeviceSample>;

/// Replays by the time handed in: a loop that ticks as the recorded one did sees exactly the samples that it saw, with
/// the same intervals between them. Where the recording has a gap, and after its end, the device is lost: nobody knows
/// where the hand was.
class ReplayDevice final : public Device {
 public:
  /// Longer than a loop at 500 Hz ever leaves between two samples, far shorter than a node's restart.
  static constexpr std::uint64_t kGap_ns = 20 * rtbus::kNsPerMs;

  ReplayDevice(DeviceInfo info, Motion motion);

  [[nodiscard]] const DeviceInfo& info() const noexcept override { return info_; }
  [[nodiscard]] rtbus::Result<void, DeviceFault> start(std::uint64_t now_ns) override;
  [[nodiscard]] IoStatus read(std::uint64_t now_ns, DeviceSample& out) noexcept RTBUS_NONBLOCKING override;
  [[nodiscard]] IoStatus write(std::uint64_t now_ns, const ForceCommand& command) noexcept RTBUS_NONBLOCKING override;
  [[nodiscard]] std::uint64_t clamped() const noexcept RTBUS_NONBLOCKING override { return clamped_; }
  void stop() noexcept override { running_ = false; }

 private:
  DeviceInfo info_;
  Motion motion_;
  bool running_ = false;
  bool begun_ = false;
  std::uint64_t begin_ns_ = 0;  ///< When the first sample was read: the motion begins there.
  std::size_t next_ = 0;        ///< First sample that has not been given yet.
  std::uint64_t tolerance_ns_ = 0;
  std::uint64_t clamped_ = 0;
};

}  // namespace drivers::replay
