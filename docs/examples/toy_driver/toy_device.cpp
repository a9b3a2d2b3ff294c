#include "toy_device.hpp"

#include <algorithm>
#include <cmath>

namespace toy {

namespace {

class Config final : public drivers::DeviceConfig {
 public:
  explicit Config(drivers::DeviceInfo info) : info_(std::move(info)) {}
  const drivers::DeviceInfo& info() const noexcept override { return info_; }
  rtbus::Result<std::unique_ptr<drivers::Device>, drivers::DeviceFault> open(
      const drivers::OpenContext&) const override {
    return std::unique_ptr<drivers::Device>(std::make_unique<Device>(info_));  // hardware is touched by start() only
  }

 private:
  drivers::DeviceInfo info_;
};

}  // namespace

std::unique_ptr<drivers::DeviceConfig> parse(rtbus::config::Map& file) {
  drivers::DeviceInfo info;
  info.model = "toy";
  info.simulated = true;
  info.max_force_n = file.number("max_force_n", {0.1, 10.0}, 5.0);
  info.continuous_force_n = std::min(1.5, info.max_force_n);
  info.max_stiffness_n_per_m = 500.0;
  info.apparent_mass_kg = file.number("mass_kg", {0.01, 10.0}, 0.1);
  info.viscous_damping_n_s_per_m = 1.0;
  return std::make_unique<Config>(std::move(info));
}

rtbus::Result<void, drivers::DeviceFault> Device::start(std::uint64_t now_ns) {
  position_m_ = velocity_m_s_ = force_n_ = {};
  clamped_ = 0;
  time_ns_ = now_ns;
  running_ = true;
  return {};
}

void Device::advance(std::uint64_t now_ns) noexcept {
  constexpr std::uint64_t kStep_ns = 100'000, kLongestGap_ns = 1'000'000'000;
  if (now_ns > time_ns_ + kLongestGap_ns) time_ns_ = now_ns - kLongestGap_ns;  // every loop is bounded
  const double dt = 1e-9 * static_cast<double>(kStep_ns);
  while (time_ns_ + kStep_ns <= now_ns) {
    time_ns_ += kStep_ns;
    if (time_ns_ >= force_end_ns_) force_n_ = {};  // nobody has written for force_timeout_s
    for (std::size_t i = 0; i < 3; ++i) {          // m·v' = f − b·v, the damper implicit
      velocity_m_s_[i] = (info_.apparent_mass_kg * velocity_m_s_[i] + dt * force_n_[i]) /
                         (info_.apparent_mass_kg + dt * info_.viscous_damping_n_s_per_m);
      position_m_[i] =
          std::clamp(position_m_[i] + dt * velocity_m_s_[i], info_.workspace_min_m[i], info_.workspace_max_m[i]);
    }
  }
}

drivers::IoStatus Device::read(std::uint64_t now_ns, drivers::DeviceSample& out) noexcept {
  if (!running_) return drivers::IoStatus::kLost;
  advance(now_ns);
  const bool fresh = time_ns_ != out.time_ns;
  out.position_m = position_m_;
  out.time_ns = time_ns_;
  return fresh ? drivers::IoStatus::kOk : drivers::IoStatus::kStale;
}

drivers::IoStatus Device::write(std::uint64_t now_ns, const drivers::ForceCommand& command) noexcept {
  if (!running_) return drivers::IoStatus::kLost;
  advance(now_ns);
  const drivers::Vec3& f = command.force_n;
  // Not std::hypot of three: libstdc++'s gives 0 for (0, NaN, 0).
  const double norm = std::sqrt(f[0] * f[0] + f[1] * f[1] + f[2] * f[2]);
  double share = 1.0;
  if (!std::isfinite(norm)) {
    share = 0.0;
  } else if (norm > info_.max_force_n * (1.0 + 1e-9)) {  // rounding is no excess
    share = info_.max_force_n / norm;                    // keeps the direction
  }
  if (share < 1.0) ++clamped_;
  for (std::size_t i = 0; i < 3; ++i) force_n_[i] = share > 0.0 ? share * f[i] : 0.0;
  force_end_ns_ = now_ns + static_cast<std::uint64_t>(1e9 * info_.force_timeout_s);
  return drivers::IoStatus::kOk;
}

void Device::stop() noexcept {
  force_n_ = {};
  running_ = false;
}

}  // namespace toy
