// `rtbus device-test`: one device, step by step: does it answer, do the encoders move, the buttons, a small force.
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "drivers/registry/registry.hpp"
#include "rtbus/clock.hpp"
#include "rtbus/config/document.hpp"
#include "tools/cli/common/command.hpp"
#include "tools/cli/common/formatted.hpp"
#include "tools/cli/common/interrupt.hpp"
#include "tools/cli/devices/device_target.hpp"
#include "tools/cli/devices/device_walk.hpp"

namespace tools {

namespace {

constexpr double kMoved_m = 0.010;   // per axis, to believe an encoder
constexpr double kForceShare = 0.1;  // of the device's peak
constexpr double kMostForce_n = 0.5;
constexpr double kRamp_s = 0.3;  // up, and down again

struct DeviceTestOptions {
  TargetOptions target;
  double seconds = 10.0;
  bool yes = false;
  bool json = false;
};

GuidedStep test_rate(Walk& walk) {
  drivers::DeviceSample last;
  const auto seen = walk.run(1.0, [&](const drivers::DeviceSample& sample, double, drivers::Vec3&) {
    last = sample;
    return false;
  });
  const double rate_hz = static_cast<double>(seen.samples) / std::max(seen.elapsed_s, 1e-9);
  return {
      "answers", seen.samples > 0 && seen.lost < seen.samples,
      formatted("%.0f samples/s; tip at ", rate_hz) + formatted("(%.1f, %.1f, %.1f) mm", 1e3 * last.position_m[0],
                                                                1e3 * last.position_m[1], 1e3 * last.position_m[2])};
}

GuidedStep test_encoders(Walk& walk, double seconds) {
  drivers::Vec3 low{1e9, 1e9, 1e9}, high{-1e9, -1e9, -1e9};
  (void)walk.run(seconds, [&](const drivers::DeviceSample& sample, double, drivers::Vec3&) {
    bool all = true;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      low[axis] = std::min(low[axis], sample.position_m[axis]);
      high[axis] = std::max(high[axis], sample.position_m[axis]);
      all = all && high[axis] - low[axis] >= kMoved_m;
    }
    return all;
  });
  GuidedStep out{"encoders", true, ""};
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const double moved_m = std::max(0.0, high[axis] - low[axis]);
    out.ok = out.ok && moved_m >= kMoved_m;
    out.what += std::string(axis == 0 ? "" : ", ") + "xyz"[axis] + formatted(" %.1f mm", 1e3 * moved_m);
  }
  if (!out.ok) out.what += "; each axis should move 10 mm";
  return out;
}

GuidedStep test_buttons(Walk& walk, double seconds) {
  std::uint32_t pressed = 0;
  bool released = false;
  (void)walk.run(seconds, [&](const drivers::DeviceSample& sample, double, drivers::Vec3&) {
    pressed |= sample.buttons;
    released = pressed != 0 && sample.buttons == 0;
    return released;
  });
  std::string which;
  for (int i = 0; i < 32; ++i) {
    if ((pressed >> i & 1u) != 0) which += (which.empty() ? "button " : ", ") + std::to_string(i);
  }
  return {"buttons", true, which.empty() ? "none was pressed (not every device has one)" : which + " pressed"};
}

GuidedStep test_force(Walk& walk, drivers::Device& device) {
  const double peak_n = std::min(kMostForce_n, kForceShare * device.info().max_force_n);
  const std::uint64_t clamped = device.clamped();
  Walk::Outcome all;
  for (std::size_t axis = 0; axis < 3 && !interrupted(); ++axis) {
    for (const double sign : {1.0, -1.0}) {
      const auto seen = walk.run(2.0 * kRamp_s, [&](const drivers::DeviceSample&, double t_s, drivers::Vec3& force_n) {
        force_n[axis] = sign * peak_n * std::max(0.0, 1.0 - std::abs(t_s / kRamp_s - 1.0));
        return false;
      });
      all.samples += seen.samples;
      all.lost += seen.lost;
    }
  }
  const bool ok = all.lost == 0 && all.samples > 0 && device.clamped() == clamped;
  return {"force", ok,
          formatted("pushed with up to %.2f N along x, y and z, both ways", peak_n) +
              (all.lost > 0 ? "; the device was lost meanwhile" : "")};
}

int test(const DeviceTestOptions& options) {
  const auto failed = [](const std::string& text) {
    std::fprintf(stderr, "rtbus device-test: %s\n", text.c_str());
    return kExitFailed;
  };
  std::unique_ptr<drivers::DeviceConfig> config;
  try {
    auto target = find_target(options.target);
    if (!target) return failed(target.error());
    config = std::move(target->config);
  } catch (const rtbus::config::Error& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return kExitUsage;
  }
  rtbus::Session session;
  session.name = "device-test-" + std::to_string(::getpid());
  auto device = config->open({.session = session, .node_name = "haptic0"});
  if (!device) return failed(device.error().message);
  if (auto started = start_device(**device); !started) return failed(started.error().message);

  Walk walk(**device);
  std::vector<GuidedStep> steps{wait_until_ready(walk)};
  if (steps.back().ok && !interrupted()) steps.push_back(test_rate(walk));
  const bool answers = steps.size() == 2 && steps.back().ok;
  const auto go_on = [&] { return steps.back().ok && !interrupted(); };
  if (go_on() && confirm(options.yes, "encoders: move the handle left and right, up and down, to and fro")) {
    steps.push_back(test_encoders(walk, options.seconds));
  }
  if (!interrupted() && answers && confirm(options.yes, "buttons: press and release each of them")) {
    steps.push_back(test_buttons(walk, options.seconds));
  }
  if (!interrupted() && answers && confirm(options.yes, "force: hold the handle lightly; it will push gently")) {
    steps.push_back(test_force(walk, **device));
  }
  (*device)->stop();

  bool fine = steps.size() == 5;
  for (const GuidedStep& step : steps) fine = fine && step.ok;
  if (options.json) {
    nlohmann::ordered_json report = {{"schema", "rtbus-device-test/1"},
                                     {"device", (*device)->info().model},
                                     {"pass", fine},
                                     {"steps", steps_json(steps)}};
    std::printf("%s\n", report.dump(2).c_str());
  } else {
    print_steps(steps);
    if (steps.size() < 4) std::puts("ended early");
  }
  return fine ? kExitFine : kExitFailed;
}

}  // namespace

Action add_device_test(rtbus::Command command) {
  auto options = std::make_shared<DeviceTestOptions>();
  add_target_options(command, options->target);
  command.option("--seconds", options->seconds, "Longest wait in each guided step [s]")
      .range(0.1, 600.0)
      .show_default()
      .type_name("S");
  command.flag("--yes", options->yes, "Do not ask before each step");
  command.flag("--json", options->json, "Print the outcome as JSON, schema rtbus-device-test/1");
  return [options] { return test(*options); };
}

}  // namespace tools
