#include "drivers/replay/replay_device.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

namespace drivers::replay {

ReplayDevice::ReplayDevice(DeviceInfo info, Motion motion) : info_(std::move(info)), motion_(std::move(motion)) {
  // Ticks of this run and of the recorded one begin a little early or late: a sample that is due within a quarter of
  // the median interval counts as due.
  std::vector<std::uint64_t> intervals;
  for (std::size_t i = 1; i < motion_.size(); ++i) intervals.push_back(motion_[i].time_ns - motion_[i - 1].time_ns);
  if (!intervals.empty()) {
    const auto middle = intervals.begin() + static_cast<std::ptrdiff_t>(intervals.size() / 2);
    std::nth_element(intervals.begin(), middle, intervals.end());
    tolerance_ns_ = *middle / 4;
  }
}

rtbus::Result<void, DeviceFault> ReplayDevice::start(std::uint64_t) {
  running_ = true;
  begun_ = false;
  next_ = 0;
  clamped_ = 0;
  return {};
}

IoStatus ReplayDevice::read(std::uint64_t now_ns, DeviceSample& out) noexcept {
  if (!running_) return IoStatus::kLost;
  if (!std::exchange(begun_, true)) begin_ns_ = now_ns;
  const std::uint64_t elapsed_ns = now_ns - begin_ns_;
  const std::uint64_t first_ns = motion_.front().time_ns;
  const std::size_t before = next_;
  // A loop that was held up skips what it missed, as with a real device; bounded by the ticks that were missed.
  while (next_ < motion_.size() && motion_[next_].time_ns - first_ns <= elapsed_ns + tolerance_ns_) ++next_;
  const DeviceSample& sample = motion_[next_ - 1];
  if (elapsed_ns > sample.time_ns - first_ns + kGap_ns) return IoStatus::kLost;
  out = sample;
  out.time_ns = std::min(now_ns, begin_ns_ + (sample.time_ns - first_ns));
  return next_ == before ? IoStatus::kStale : IoStatus::kOk;
}

IoStatus ReplayDevice::write(std::uint64_t, const ForceCommand& command) noexcept {
  if (!running_) return IoStatus::kLost;
  const double norm = std::hypot(command.force_n[0], command.force_n[1], command.force_n[2]);
  if (!(norm <= info_.max_force_n)) ++clamped_;
  return IoStatus::kOk;
}

}  // namespace drivers::replay
