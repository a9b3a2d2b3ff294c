// A driver with a mistake on demand, as a module from outside the tree: the toy driver of docs/examples, spoilt.
#include <memory>
#include <string>

#include "docs/examples/toy_driver/toy_device.hpp"
#include "drivers/driver_module.hpp"
#include "rtbus/clock.hpp"

namespace trial {
namespace {

class Device final : public drivers::Device {
 public:
  Device(const drivers::DeviceInfo& truth, std::string mistake)
      : info_(truth), toy_(truth), mistake_(std::move(mistake)) {
    info_.can_pace_loop = true;
    info_.sample_rate_hz = 1000.0;
    if (mistake_ == "mass_ten_times") info_.apparent_mass_kg *= 10.0;
  }

  const drivers::DeviceInfo& info() const noexcept override { return info_; }
  rtbus::Result<void, drivers::DeviceFault> start(std::uint64_t now_ns) override {
    running_ = true;
    return toy_.start(now_ns);
  }
  drivers::IoStatus wait_sample(std::uint64_t deadline_ns) noexcept override {
    if (!running_) return drivers::IoStatus::kLost;
    const std::uint64_t next_ns = rtbus::monotonic_ns() + rtbus::kNsPerMs;
    const bool comes = next_ns <= deadline_ns;
    rtbus::sleep_until((comes ? next_ns : deadline_ns) + (mistake_ == "oversleeps" ? 50 * rtbus::kNsPerMs : 0));
    return comes ? drivers::IoStatus::kOk : drivers::IoStatus::kTimeout;
  }
  drivers::IoStatus read(std::uint64_t now_ns, drivers::DeviceSample& out) noexcept override {
    if (mistake_ == "slow_read") rtbus::sleep_until(rtbus::monotonic_ns() + 2 * rtbus::kNsPerMs);
    return toy_.read(now_ns, out);
  }
  drivers::IoStatus write(std::uint64_t now_ns, const drivers::ForceCommand& command) noexcept override {
    return toy_.write(now_ns, command);
  }
  std::uint64_t clamped() const noexcept override { return toy_.clamped(); }
  void stop() noexcept override {
    running_ = false;
    toy_.stop();
  }

 private:
  drivers::DeviceInfo info_;
  toy::Device toy_;
  std::string mistake_;
  bool running_ = false;
};

class Config final : public drivers::DeviceConfig {
 public:
  Config(std::unique_ptr<drivers::DeviceConfig> toy, std::string mistake)
      : toy_(std::move(toy)), mistake_(std::move(mistake)) {}
  const drivers::DeviceInfo& info() const noexcept override { return toy_->info(); }
  rtbus::Result<std::unique_ptr<drivers::Device>, drivers::DeviceFault> open(
      const drivers::OpenContext&) const override {
    return std::unique_ptr<drivers::Device>(std::make_unique<Device>(toy_->info(), mistake_));
  }

 private:
  std::unique_ptr<drivers::DeviceConfig> toy_;
  std::string mistake_;
};

std::unique_ptr<drivers::DeviceConfig> parse(rtbus::config::Map& file) {
  std::string mistake = file.choice("mistake", {"none", "oversleeps", "slow_read", "mass_ten_times"});
  return std::make_unique<Config>(toy::parse(file), std::move(mistake));
}

}  // namespace
}  // namespace trial

RTBUS_DRIVER_MODULE("trial", "The toy driver with a mistake on demand", &trial::parse)
