#include "tools/cli/devices/device_walk.hpp"

#include <algorithm>
#include <atomic>
#include <cstdio>
#include <iostream>
#include <thread>

#include "rtbus/clock.hpp"
#include "rtbus/realtime.hpp"
#include "tools/cli/common/formatted.hpp"
#include "tools/cli/common/interrupt.hpp"

namespace tools {

namespace {

constexpr double kReadyWithin_s = 60.0;
constexpr std::uint64_t kMaintainEveryNs = 20 * rtbus::kNsPerMs;

/// Calls maintain() as the node's housekeeping thread does, beside read() and write(), for as long as it lives.
class Housekeeping {
 public:
  explicit Housekeeping(drivers::Device& device) : thread_([this, &device] { run(device); }) {}
  ~Housekeeping() {
    ends_.store(true);
    thread_.join();
  }
  Housekeeping(const Housekeeping&) = delete;
  Housekeeping& operator=(const Housekeeping&) = delete;

 private:
  void run(drivers::Device& device) const {
    rtbus::name_this_thread("housekeeping");
    while (!ends_.load()) {
      device.maintain();
      rtbus::sleep_until(rtbus::monotonic_ns() + kMaintainEveryNs);
    }
  }

  std::atomic<bool> ends_{false};
  std::thread thread_;
};

}  // namespace

Walk::Walk(drivers::Device& device) : device_(device) {
  const double rate_hz = device.info().sample_rate_hz > 0.0 ? device.info().sample_rate_hz : 1000.0;
  period_ns_ = static_cast<std::uint64_t>(1e9 / rate_hz);
}

Walk::Outcome Walk::run(double seconds, const Each& each) {
  Outcome out;
  const std::uint64_t start_ns = rtbus::monotonic_ns();
  std::uint64_t last_ns = start_ns;
  bool enough = false;
  const Housekeeping housekeeping(device_);  // a calibration that the driver asks for goes on there
  // A hand, or a weight, hangs on these forces: a busy machine must not be late for them.
  const rtbus::ThreadScheduling ordinary;
  (void)rtbus::prefer_on_time();
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
  ordinary.restore();
  return out;
}

GuidedStep wait_until_ready(Walk& walk) {
  const auto seen = walk.run(kReadyWithin_s, [](const drivers::DeviceSample&, double, drivers::Vec3&) { return true; });
  if (seen.samples > 0) return {"ready", true, formatted("after %.1f s", seen.elapsed_s)};
  return {"ready", false, formatted("not within %.0f s; do what the lines above say, and try again", kReadyWithin_s)};
}

bool confirm(bool yes, const std::string& text) {
  std::fprintf(stderr, "%s\n", text.c_str());
  if (yes) return true;
  std::fprintf(stderr, "  press Enter to go on, Ctrl-C to end: ");
  std::string line;
  return static_cast<bool>(std::getline(std::cin, line)) && !interrupted();
}

void print_steps(const std::vector<GuidedStep>& steps) {
  for (const GuidedStep& step : steps) {
    std::printf("%-9s %-4s %s\n", step.name.c_str(), step.ok ? "ok" : "FAIL", step.what.c_str());
  }
}

nlohmann::ordered_json steps_json(const std::vector<GuidedStep>& steps) {
  auto out = nlohmann::ordered_json::array();
  for (const GuidedStep& step : steps) out.push_back({{"name", step.name}, {"pass", step.ok}, {"what", step.what}});
  return out;
}

}  // namespace tools
