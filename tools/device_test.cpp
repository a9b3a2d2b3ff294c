// `rtbus device-test`: one device, step by step: does it answer, do the encoders move, the buttons, a small force.
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <functional>
#include <iostream>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "drivers/registry.hpp"
#include "rtbus/clock.hpp"
#include "rtbus/config/document.hpp"
#include "tools/command.hpp"
#include "tools/interrupt.hpp"
#include "tools/supervisor.hpp"

namespace tools {

namespace {

constexpr double kMoved_m = 0.010;   // per axis, to believe an encoder
constexpr double kForceShare = 0.1;  // of the device's peak
constexpr double kMostForce_n = 0.5;
constexpr double kRamp_s = 0.3;  // up, and down again
constexpr const char* kPreloaded = "RTBUS_PRELOADED";

struct DeviceTestOptions {
  std::string file;
  std::vector<std::string> assignments;
  double seconds = 10.0;
  bool yes = false;
  bool json = false;
};

struct Step {
  std::string name;
  bool ok = false;
  std::string what;
};

/// A virtual device in this process needs its library in front of the C library: starts this program once more, so.
void restart_with(const std::string& library) {
  if (std::getenv(kPreloaded) != nullptr) return;
  ::setenv(kPreloaded, "1", 1);
  ::setenv("LD_PRELOAD", (folder_of_this_program() + "/" + library).c_str(), 1);
  std::ifstream in("/proc/self/cmdline", std::ios::binary);
  std::vector<std::string> words;
  for (std::string word; std::getline(in, word, '\0');) words.push_back(word);
  std::vector<char*> arguments;
  for (std::string& word : words) arguments.push_back(word.data());
  arguments.push_back(nullptr);
  ::execv("/proc/self/exe", arguments.data());
}

/// The loop that the steps share: one thread, at the device's own pace or by a timer.
class Walk {
 public:
  explicit Walk(drivers::Device& device) : device_(device) {
    const double rate_hz = device.info().sample_rate_hz > 0.0 ? device.info().sample_rate_hz : 1000.0;
    period_ns_ = static_cast<std::uint64_t>(1e9 / rate_hz);
  }

  struct Outcome {
    std::uint64_t samples = 0;
    std::uint64_t lost = 0;
    double elapsed_s = 0.0;
  };
  /// Runs for so long, or until `each` says it has seen enough. `each` gives the force for a sample [N].
  Outcome run(double seconds, const std::function<bool(const drivers::DeviceSample&, double, drivers::Vec3&)>& each) {
    Outcome out;
    const std::uint64_t start_ns = rtbus::monotonic_ns();
    std::uint64_t last_ns = start_ns;
    bool enough = false;
    while (!enough && !interrupted() && out.elapsed_s < seconds) {
      if (!device_.info().can_pace_loop || device_.wait_sample(last_ns + 2 * period_ns_) == drivers::IoStatus::kLost) {
        rtbus::sleep_until(last_ns + period_ns_);
      }
      last_ns = rtbus::monotonic_ns();
      out.elapsed_s = rtbus::seconds_between(start_ns, last_ns);
      drivers::DeviceSample sample;
      drivers::Vec3 force_n{};
      const drivers::IoStatus status = device_.read(last_ns, sample);
      if (status == drivers::IoStatus::kLost) ++out.lost;
      if (status == drivers::IoStatus::kOk) {
        ++out.samples;
        enough = each(sample, out.elapsed_s, force_n);
      }
      if (status != drivers::IoStatus::kOk) force_n = {};
      (void)device_.write(last_ns, {force_n});
      if (std::string notice = device_.take_notice(); !notice.empty()) std::fprintf(stderr, "  %s\n", notice.c_str());
    }
    (void)device_.write(rtbus::monotonic_ns(), {});
    return out;
  }

 private:
  drivers::Device& device_;
  std::uint64_t period_ns_;
};

std::string format(const char* pattern, double a, double b = 0.0, double c = 0.0) {
  char text[160];
  std::snprintf(text, sizeof text, pattern, a, b, c);
  return text;
}

constexpr double kReadyWithin_s = 60.0;

/// Waits for the first sample: until then the driver tells what it waits for, mostly to be homed by hand.
Step test_ready(Walk& walk) {
  const auto seen = walk.run(kReadyWithin_s, [](const drivers::DeviceSample&, double, drivers::Vec3&) { return true; });
  if (seen.samples > 0) return {"ready", true, format("after %.1f s", seen.elapsed_s)};
  return {"ready", false, format("not within %.0f s; do what the lines above say, and try again", kReadyWithin_s)};
}

Step test_rate(Walk& walk) {
  drivers::DeviceSample last;
  const auto seen = walk.run(1.0, [&](const drivers::DeviceSample& sample, double, drivers::Vec3&) {
    last = sample;
    return false;
  });
  const double rate_hz = static_cast<double>(seen.samples) / std::max(seen.elapsed_s, 1e-9);
  return {"answers", seen.samples > 0 && seen.lost < seen.samples,
          format("%.0f samples/s; tip at ", rate_hz) + format("(%.1f, %.1f, %.1f) mm", 1e3 * last.position_m[0],
                                                              1e3 * last.position_m[1], 1e3 * last.position_m[2])};
}

Step test_encoders(Walk& walk, double seconds) {
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
  Step out{"encoders", true, ""};
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const double moved_m = std::max(0.0, high[axis] - low[axis]);
    out.ok = out.ok && moved_m >= kMoved_m;
    out.what += std::string(axis == 0 ? "" : ", ") + "xyz"[axis] + format(" %.1f mm", 1e3 * moved_m);
  }
  if (!out.ok) out.what += "; each axis should move 10 mm";
  return out;
}

Step test_buttons(Walk& walk, double seconds) {
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

Step test_force(Walk& walk, drivers::Device& device) {
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
          format("pushed with up to %.2f N along x, y and z, both ways", peak_n) +
              (all.lost > 0 ? "; the device was lost meanwhile" : "")};
}

bool confirm(const DeviceTestOptions& options, const char* text) {
  std::fprintf(stderr, "%s\n", text);
  if (options.yes) return true;
  std::fprintf(stderr, "  press Enter to go on, Ctrl-C to end: ");
  std::string line;
  return static_cast<bool>(std::getline(std::cin, line)) && !interrupted();
}

int test(const DeviceTestOptions& options) {
  std::unique_ptr<drivers::DeviceConfig> config;
  try {
    std::vector<rtbus::config::Override> overrides;
    for (const std::string& text : options.assignments) overrides.push_back(rtbus::config::parse_override(text));
    auto file = rtbus::config::load(options.file, overrides);
    config = drivers::parse_device(file);
  } catch (const rtbus::config::Error& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return kExitUsage;
  }
  if (const std::string library = config->preload(); !library.empty()) restart_with(library);
  rtbus::Session session;
  session.name = "device-test-" + std::to_string(::getpid());
  auto device = config->open({.session = session, .node_name = "haptic0"});
  const auto failed = [&](const std::string& text) {
    std::fprintf(stderr, "rtbus device-test: %s\n", text.c_str());
    return kExitFailed;
  };
  if (!device) return failed(device.error().message);
  if (auto started = (*device)->start(rtbus::monotonic_ns()); !started) return failed(started.error().message);

  Walk walk(**device);
  std::vector<Step> steps{test_ready(walk)};
  if (steps.back().ok && !interrupted()) steps.push_back(test_rate(walk));
  const bool answers = steps.size() == 2 && steps.back().ok;
  const auto go_on = [&] { return steps.back().ok && !interrupted(); };
  if (go_on() && confirm(options, "encoders: move the handle left and right, up and down, to and fro")) {
    steps.push_back(test_encoders(walk, options.seconds));
  }
  if (!interrupted() && answers && confirm(options, "buttons: press and release each of them")) {
    steps.push_back(test_buttons(walk, options.seconds));
  }
  if (!interrupted() && answers && confirm(options, "force: hold the handle lightly; it will push gently")) {
    steps.push_back(test_force(walk, **device));
  }
  (*device)->stop();

  bool fine = steps.size() == 5;
  for (const Step& step : steps) fine = fine && step.ok;
  if (options.json) {
    nlohmann::ordered_json report = {{"schema", "rtbus-device-test/1"},
                                     {"device", (*device)->info().model},
                                     {"pass", fine},
                                     {"steps", nlohmann::ordered_json::array()}};
    for (const Step& step : steps) {
      report["steps"].push_back({{"name", step.name}, {"pass", step.ok}, {"what", step.what}});
    }
    std::printf("%s\n", report.dump(2).c_str());
  } else {
    for (const Step& step : steps) {
      std::printf("%-9s %-4s %s\n", step.name.c_str(), step.ok ? "ok" : "FAIL", step.what.c_str());
    }
    if (steps.size() < 4) std::puts("ended early");
  }
  return fine ? kExitFine : kExitFailed;
}

}  // namespace

Action add_device_test(CLI::App& command) {
  auto options = std::make_shared<DeviceTestOptions>();
  command.add_option("device", options->file, "Device file, for example config/devices/falcon.yaml")
      ->required()
      ->type_name("FILE");
  command.add_option("--set", options->assignments, "Change a key of the device file")
      ->take_all()
      ->type_name("KEY=VALUE");
  command.add_option("--seconds", options->seconds, "Longest wait in each guided step [s]")
      ->check(CLI::Range(0.1, 600.0))
      ->capture_default_str()
      ->type_name("S");
  command.add_flag("--yes", options->yes, "Do not ask before each step");
  command.add_flag("--json", options->json, "Print the outcome as JSON, schema rtbus-device-test/1");
  return [options] { return test(*options); };
}

}  // namespace tools
