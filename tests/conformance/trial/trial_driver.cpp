// A driver with a mistake on demand, as a module from outside the tree: the toy driver of docs/examples, spoilt. Which
// test of the conformance suite catches which mistake stands in outside_driver_test.cpp.
#include <array>
#include <cmath>
#include <cstdlib>
#include <limits>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "docs/examples/toy_driver/toy_device.hpp"
#include "drivers/driver_module.hpp"
#include "rtbus/clock.hpp"

namespace trial {
namespace {

using drivers::DeviceInfo;
using drivers::DeviceSample;
using drivers::ForceCommand;
using drivers::IoStatus;
using drivers::Vec3;

/// A mistake that is a wrong figure in DeviceInfo.
struct WrongInfo {
  const char* name;
  void (*spoil)(DeviceInfo& info);
};
constexpr std::array kWrongInfos{
    WrongInfo{"mass_ten_times", [](DeviceInfo& info) { info.apparent_mass_kg *= 10.0; }},
    WrongInfo{"no_model", [](DeviceInfo& info) { info.model.clear(); }},
    WrongInfo{"five_dof", [](DeviceInfo& info) { info.dof_sensed = 5; }},
    WrongInfo{"no_stiffness", [](DeviceInfo& info) { info.max_stiffness_n_per_m = 0.0; }},
    WrongInfo{"continuous_above_peak", [](DeviceInfo& info) { info.continuous_force_n = 2.0 * info.max_force_n; }},
    WrongInfo{"slew_too_slow", [](DeviceInfo& info) { info.max_slew_n_per_ms = 0.1; }},
    WrongInfo{"negative_friction", [](DeviceInfo& info) { info.coulomb_friction_n = -0.1; }},
    WrongInfo{"workspace_reversed", [](DeviceInfo& info) { std::swap(info.workspace_min_m, info.workspace_max_m); }},
    WrongInfo{"timeout_of_a_second", [](DeviceInfo& info) { info.force_timeout_s = 1.0; }},
};

/// The others are wrong behaviour; Device knows them by name.
constexpr std::array kWrongBehaviours{"oversleeps",
                                      "slow_read",
                                      "slow_write",
                                      "reads_before_start",
                                      "reads_after_stop",
                                      "writes_before_start",
                                      "no_stamp",
                                      "stamp_of_the_future",
                                      "stamp_a_second_old",
                                      "stamp_goes_back",
                                      "position_not_a_number",
                                      "orientation_of_zeros",
                                      "never_fresh",
                                      "position_in_mm",
                                      "does_not_clamp",
                                      "clamps_uncounted",
                                      "clamps_each_axis",
                                      "counts_the_limit",
                                      "pushes_twice_as_hard",
                                      "force_reversed",
                                      "axes_swapped",
                                      "takes_not_a_number",
                                      "looks_at_the_first_axis_alone",
                                      "force_never_ends",
                                      "force_survives_stop",
                                      "second_stop_aborts",
                                      "starts_only_once",
                                      "count_survives_stop",
                                      "allocates_in_read",
                                      "allocates_in_write",
                                      "wait_always_times_out",
                                      "wait_works_before_start",
                                      "wait_does_not_wait"};

/// What the mechanics really are. Some mistakes need them to take what a driver should have refused.
DeviceInfo plant_of(const DeviceInfo& truth, const std::string& mistake) {
  DeviceInfo out = truth;
  if (mistake == "does_not_clamp" || mistake == "pushes_twice_as_hard" || mistake == "clamps_each_axis") {
    out.max_force_n = 1e9;
  }
  if (mistake == "force_never_ends") out.force_timeout_s = 3600.0;
  return out;
}

class Device final : public drivers::Device {
 public:
  Device(const DeviceInfo& truth, std::string mistake)
      : info_(truth), toy_(plant_of(truth, mistake)), mistake_(std::move(mistake)) {
    info_.can_pace_loop = true;
    info_.sample_rate_hz = 1000.0;
    for (const WrongInfo& each : kWrongInfos) {
      if (mistake_ == each.name) each.spoil(info_);
    }
  }

  const DeviceInfo& info() const noexcept override { return info_; }

  rtbus::Result<void, drivers::DeviceFault> start(std::uint64_t now_ns) override {
    if (is("starts_only_once") && starts_ > 0) return rtbus::Failure{drivers::DeviceFault{"it was started before"}};
    ++starts_;
    running_ = true;
    stopped_ = false;
    if (is("count_survives_stop")) counted_ += toy_.clamped();
    auto started = toy_.start(now_ns);
    if (is("force_survives_stop")) (void)toy_.write(now_ns, last_);
    return started;
  }

  IoStatus wait_sample(std::uint64_t deadline_ns) noexcept override {
    if (is("wait_works_before_start")) return IoStatus::kOk;
    if (!running_) return IoStatus::kLost;
    if (is("wait_does_not_wait")) return IoStatus::kOk;
    const std::uint64_t next_ns = rtbus::monotonic_ns() + rtbus::kNsPerMs;
    const bool comes = next_ns <= deadline_ns;
    rtbus::sleep_until((comes ? next_ns : deadline_ns) + (is("oversleeps") ? 50 * rtbus::kNsPerMs : 0));
    return comes && !is("wait_always_times_out") ? IoStatus::kOk : IoStatus::kTimeout;
  }

  IoStatus read(std::uint64_t now_ns, DeviceSample& out) noexcept override {
    if (is("slow_read")) rtbus::sleep_until(rtbus::monotonic_ns() + 2 * rtbus::kNsPerMs);
    if (is("allocates_in_read")) spent_.push_back(std::make_unique<int>(1));
    IoStatus status = toy_.read(now_ns, out);
    if (is("reads_before_start") && starts_ == 0) return IoStatus::kOk;
    if (is("reads_after_stop") && starts_ > 0 && !running_) return IoStatus::kOk;
    if (is("never_fresh") && status == IoStatus::kOk) status = IoStatus::kStale;
    ++reads_;
    if (is("no_stamp")) out.time_ns = 0;
    if (is("stamp_of_the_future")) out.time_ns += rtbus::kNsPerS;
    if (is("stamp_a_second_old")) out.time_ns -= rtbus::kNsPerS;
    if (is("stamp_goes_back") && reads_ % 10 == 0) out.time_ns -= 20 * rtbus::kNsPerMs;
    if (is("position_not_a_number")) out.position_m[1] = std::numeric_limits<double>::quiet_NaN();
    if (is("orientation_of_zeros")) out.orientation_wxyz = {};
    if (is("position_in_mm")) {
      for (double& each : out.position_m) each *= 1e3;
    }
    return status;
  }

  IoStatus write(std::uint64_t now_ns, const ForceCommand& command) noexcept override {
    if (is("slow_write")) rtbus::sleep_until(rtbus::monotonic_ns() + 2 * rtbus::kNsPerMs);
    if (is("allocates_in_write")) spent_.push_back(std::make_unique<int>(1));
    if (is("writes_before_start") && starts_ == 0) return IoStatus::kOk;
    last_ = spoilt(command);
    return toy_.write(now_ns, last_);
  }

  std::uint64_t clamped() const noexcept override { return is("clamps_uncounted") ? 0 : toy_.clamped() + counted_; }

  void stop() noexcept override {
    if (is("second_stop_aborts") && std::exchange(stopped_, true)) std::abort();
    running_ = false;
    toy_.stop();
  }

 private:
  [[nodiscard]] bool is(const char* mistake) const noexcept { return mistake_ == mistake; }

  /// What such a driver would send instead.
  ForceCommand spoilt(const ForceCommand& command) noexcept {
    ForceCommand out = command;
    Vec3& f = out.force_n;
    const double norm_n = std::sqrt(f[0] * f[0] + f[1] * f[1] + f[2] * f[2]);
    const double limit_n = info_.max_force_n;
    if (is("clamps_each_axis") && norm_n > limit_n) {
      for (double& each : f) each = std::fmin(std::fmax(each, -limit_n / std::sqrt(2.0)), limit_n / std::sqrt(2.0));
      ++counted_;
    }
    if (is("pushes_twice_as_hard") && norm_n > limit_n) {
      for (double& each : f) each *= 2.0 * limit_n / norm_n;
      ++counted_;
    }
    if (is("counts_the_limit") && norm_n > 0.999 * limit_n) ++counted_;
    if (is("force_reversed")) f = {-f[0], -f[1], -f[2]};
    if (is("axes_swapped")) std::swap(f[0], f[1]);
    const bool unseen = is("takes_not_a_number") || (is("looks_at_the_first_axis_alone") && std::isfinite(f[0]));
    if (unseen && !std::isfinite(norm_n)) {
      for (double& each : f) each = std::isfinite(each) ? each : 0.0;
    }
    return out;
  }

  DeviceInfo info_;
  toy::Device toy_;
  std::string mistake_;
  std::vector<std::unique_ptr<int>> spent_;
  ForceCommand last_;
  bool running_ = false, stopped_ = false;
  int starts_ = 0, reads_ = 0;
  std::uint64_t counted_ = 0;
};

class Config final : public drivers::DeviceConfig {
 public:
  Config(std::unique_ptr<drivers::DeviceConfig> toy, std::string mistake)
      : toy_(std::move(toy)), mistake_(std::move(mistake)) {}
  const DeviceInfo& info() const noexcept override { return toy_->info(); }
  rtbus::Result<std::unique_ptr<drivers::Device>, drivers::DeviceFault> open(
      const drivers::OpenContext&) const override {
    return std::unique_ptr<drivers::Device>(std::make_unique<Device>(toy_->info(), mistake_));
  }

 private:
  std::unique_ptr<drivers::DeviceConfig> toy_;
  std::string mistake_;
};

std::unique_ptr<drivers::DeviceConfig> parse(rtbus::config::Map& file) {
  std::vector<std::string> names{"none"};
  for (const WrongInfo& each : kWrongInfos) names.emplace_back(each.name);
  for (const char* const each : kWrongBehaviours) names.emplace_back(each);
  std::string mistake = file.choice("mistake", names);
  return std::make_unique<Config>(toy::parse(file), std::move(mistake));
}

}  // namespace
}  // namespace trial

RTBUS_DRIVER_MODULE("trial", "The toy driver with a mistake on demand", &trial::parse)
