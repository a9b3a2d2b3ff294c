// Guided calibration of a Falcon: homing, range of the encoders, factor of the force.
#include <poll.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <iostream>
#include <optional>
#include <utility>

#include "rtbus/clock.hpp"
#include "tools/cli/common/formatted.hpp"
#include "tools/cli/common/interrupt.hpp"
#include "tools/cli/devices/calibrate_steps.hpp"
#include "tools/cli/devices/device_target.hpp"

namespace tools {

namespace {

using drivers::DeviceSample;
using drivers::Vec3;

constexpr double kGravityM_s2 = 9.81;

// What the three encoders of a homed Falcon show: 1600 to 1750 counts to either side (two sources). The three arms are
// alike, so their ends are.
constexpr double kLeastSpanCounts = 1200.0;
constexpr double kFarthestCount = 1900.0;
constexpr double kUnlikeCounts = 450.0;
constexpr double kUnchangedS = 3.0;  // without a new extreme the user has been everywhere

GuidedStep test_range(Walk& walk, const drivers::usb::UsbModule& module, const drivers::DeviceConfig& config,
                      double seconds) {
  Vec3 low{1e9, 1e9, 1e9}, high{-1e9, -1e9, -1e9};
  double changed_s = 0.0;
  (void)walk.run(seconds, [&](const DeviceSample& sample, double now_s, Vec3&) {
    constexpr double kChangeCounts = 20.0;
    const auto counts = module.joint_counts(config, sample.position_m);
    bool wide = counts.has_value();
    for (std::size_t i = 0; counts && i < 3; ++i) {
      if ((*counts)[i] < low[i] - kChangeCounts || (*counts)[i] > high[i] + kChangeCounts) changed_s = now_s;
      low[i] = std::min(low[i], (*counts)[i]);
      high[i] = std::max(high[i], (*counts)[i]);
      wide = wide && high[i] - low[i] >= kLeastSpanCounts;
    }
    return wide && now_s > changed_s + kUnchangedS;
  });
  GuidedStep out{"range", true, ""};
  std::string why;
  for (std::size_t i = 0; i < 3; ++i) {
    out.what +=
        std::string(i == 0 ? "axis " : ", axis ") + std::to_string(i + 1) + formatted(" %.0f to %.0f", low[i], high[i]);
    if (high[i] - low[i] < kLeastSpanCounts) why = "each axis should span 1200 counts: move the grip to all its ends";
    if (low[i] < -kFarthestCount || high[i] > kFarthestCount) why = "no grip gets beyond 1900 counts: home it again";
  }
  const auto unlike = [](const Vec3& ends) {
    return *std::max_element(ends.begin(), ends.end()) - *std::min_element(ends.begin(), ends.end()) > kUnlikeCounts;
  };
  if (why.empty() && (unlike(low) || unlike(high))) {
    why = "the axes end more than 450 counts apart: move the grip to all its ends, or power it off and home it again";
  }
  out.what += " counts (1600 to 1750 to either side are usual)";
  out.ok = why.empty();
  if (!out.ok) out.what += "; " + why;
  return out;
}

/// Carries the grip around the centre by a spring. It rises and falls by the same way again and again, so that dry
/// friction cancels in the mean.
class Carrier {
 public:
  explicit Carrier(double most_n) : most_n_(most_n) {}

  [[nodiscard]] Vec3 force_n(const DeviceSample& sample) {
    const double now_s = static_cast<double>(sample.time_ns) * 1e-9;
    if (!began_) {
      began_ = last_ = sample;
      start_s_ = now_s;
    }
    const double dt_s = std::max(1e-4, static_cast<double>(sample.time_ns - last_->time_ns) * 1e-9);
    const double t_s = now_s - start_s_;
    const double share = std::min(1.0, t_s / kRampS);
    Vec3 force{};
    double square = 0.0;
    for (std::size_t i = 0; i < 3; ++i) {
      double aim_m = began_->position_m[i] * (1.0 - share);
      if (i == 1) aim_m += wave_m(t_s);
      const double speed_m_s = (sample.position_m[i] - last_->position_m[i]) / dt_s;
      speed_m_s_[i] += kSmooth * (speed_m_s - speed_m_s_[i]);
      force[i] = share * (kSpringN_m * (aim_m - sample.position_m[i]) - kDamperN_s_m * speed_m_s_[i]);
      square += force[i] * force[i];
    }
    if (const double norm = std::sqrt(square); norm > most_n_) {
      for (double& each : force) each *= most_n_ / norm;
    }
    last_ = sample;
    return force;
  }
  /// The place in the wave at a sample [periods since the grip was at the centre]; negative before.
  [[nodiscard]] double periods(const DeviceSample& sample) const {
    return (static_cast<double>(sample.time_ns) * 1e-9 - start_s_ - kRampS) / kPeriodS;
  }
  static constexpr double kPeriodS = 1.5;

 private:
  static double wave_m(double t_s) {
    if (t_s < kRampS) return 0.0;
    const double phase = std::fmod((t_s - kRampS) / kPeriodS, 1.0);
    const double triangle = phase < 0.25 ? 4.0 * phase : phase < 0.75 ? 2.0 - 4.0 * phase : 4.0 * phase - 4.0;
    return kAmplitudeM * triangle;
  }
  static constexpr double kRampS = 1.5;
  static constexpr double kAmplitudeM = 0.004;
  static constexpr double kSpringN_m = 400.0;
  static constexpr double kDamperN_s_m = 2.0;
  static constexpr double kSmooth = 0.1;  // per millisecond

  double most_n_;
  std::optional<DeviceSample> began_, last_;
  double start_s_ = 0.0;
  Vec3 speed_m_s_{};
};

/// Mean vertical force over whole waves; none when too few came. A force acts until the next one, so each counts for as
/// long: samples that come late or not at all change nothing. A wave in which the device was lost, or the computer
/// paused for longer than it holds a force, does not count.
std::optional<double> mean_force_n(Walk& walk, Carrier& carrier, double holds_s) {
  constexpr int kWaves = 4;
  struct Sum {
    double impulse_n_s = 0.0, time_s = 0.0;
  };
  Sum all, wave;
  int waves = 0;
  double from = -1.0, in = -1.0, before_s = 0.0, before_n = 0.0;
  (void)walk.run(20.0 * Carrier::kPeriodS, [&](const DeviceSample& sample, double, Vec3& force_n) {
    force_n = carrier.force_n(sample);
    const double now_s = static_cast<double>(sample.time_ns) * 1e-9, periods = carrier.periods(sample);
    const double held_s = now_s - std::exchange(before_s, now_s), held_n = std::exchange(before_n, force_n[1]);
    if (periods < 0.0) return false;
    if (from < 0.0 || held_s > holds_s) {
      from = std::floor(periods) + 1.0;
      wave = {};
    }
    if (periods < from) return false;
    if (std::exchange(in, std::floor(periods)) < std::floor(periods) && wave.time_s > 0.0) {
      all.impulse_n_s += wave.impulse_n_s;
      all.time_s += wave.time_s;
      wave = {};
      ++waves;
    }
    wave.impulse_n_s += held_n * held_s;
    wave.time_s += held_s;
    return waves == kWaves;
  });
  if (waves < kWaves) return std::nullopt;
  return all.impulse_n_s / all.time_s;
}

/// Carries the grip until the user has hung the mass.
bool wait_for_mass(Walk& walk, Carrier& carrier, const GuideOptions& options) {
  std::fprintf(stderr, "%s\n",
               formatted("force: hang %.3f kg on the grip now, gently; it is carried", options.mass_kg).c_str());
  if (!options.yes) std::fprintf(stderr, "  press Enter when it hangs still, Ctrl-C to end: ");
  bool done = false;
  int tick = 0;
  (void)walk.run(options.yes ? options.seconds : 600.0, [&](const DeviceSample& sample, double, Vec3& force_n) {
    force_n = carrier.force_n(sample);
    if (!options.yes && ++tick % 50 == 0) {
      pollfd input{STDIN_FILENO, POLLIN, 0};
      if (::poll(&input, 1, 0) > 0) {
        std::string line;
        done = static_cast<bool>(std::getline(std::cin, line));
        return true;
      }
    }
    return false;
  });
  return (done || options.yes) && !interrupted();
}

GuidedStep test_mass(Walk& walk, const drivers::DeviceInfo& info, const GuideOptions& options, Calibration& out) {
  const double weight_n = options.mass_kg * kGravityM_s2;
  Carrier carrier(std::min(info.max_force_n, 2.0 * weight_n + 2.0));
  const auto alone_n = mean_force_n(walk, carrier, info.force_timeout_s);
  if (!alone_n) return {"force", false, "the device was lost, or the grip did not move freely"};
  if (!wait_for_mass(walk, carrier, options)) return {"force", false, "ended"};
  const auto loaded_n = mean_force_n(walk, carrier, info.force_timeout_s);
  if (!loaded_n) return {"force", false, "the device was lost, or the grip did not move freely"};
  // What was commanded to carry it, over what it weighs.
  const double ratio = (*loaded_n - *alone_n) / weight_n;
  const double factor = options.force_calibration * ratio;
  GuidedStep step{"force", ratio > 0.3 && ratio < 3.0 && factor >= 0.2 && factor <= 5.0,
                  formatted("%.3f kg, %.2f N, were carried by a command of %.2f N", options.mass_kg, weight_n,
                            *loaded_n - *alone_n)};
  if (step.ok) {
    out.changes.push_back({"force_calibration", formatted("%.3f", factor)});
    step.what += formatted("; force_calibration %.3f instead of %.3f", factor, options.force_calibration);
  } else {
    step.what += "; that cannot be: does it hang freely, and on the grip alone?";
  }
  return step;
}

}  // namespace

Calibration calibrate_falcon(const drivers::usb::UsbModule& module, const drivers::DeviceConfig& config,
                             const GuideOptions& options) {
  Calibration out;
  rtbus::Session session;
  session.name = "calibrate-" + std::to_string(::getpid());
  auto device = config.open({.session = session, .node_name = "haptic0"});
  auto started =
      device ? start_device(**device) : rtbus::Result<void, drivers::DeviceFault>(rtbus::Failure{device.error()});
  if (!started) {
    out.steps.push_back({"start", false, started.error().message});
    return out;
  }
  Walk walk(**device);
  const auto go_on = [&] { return out.steps.back().ok && !interrupted(); };
  out.steps.push_back(wait_until_ready(walk));
  if (go_on() && confirm(options.yes,
                         "range: move the grip slowly out and in, left and right, up and down, each until it stops")) {
    out.steps.push_back(test_range(walk, module, config, options.seconds));
    out.complete = options.mass_kg <= 0.0;
  }
  if (options.mass_kg > 0.0 && out.steps.size() == 2 && go_on() &&
      confirm(options.yes, "force: let go of the grip; it will move to the centre and carry itself there")) {
    out.steps.push_back(test_mass(walk, (*device)->info(), options, out));
    out.complete = true;
  }
  (*device)->stop();
  return out;
}

}  // namespace tools
