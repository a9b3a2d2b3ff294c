// Guided calibration of a PHANToM-class arm. It is asked, never driven: no command carries a current.
#include <algorithm>
#include <cstdio>
#include <cstdlib>

#include "rtbus/clock.hpp"
#include "tools/cli/common/formatted.hpp"
#include "tools/cli/common/interrupt.hpp"
#include "tools/cli/devices/calibrate_steps.hpp"

namespace tools {

namespace {

using drivers::usb::Inspection;
using drivers::usb::Probe;

constexpr std::uint64_t kAskEveryNs = 50 * rtbus::kNsPerMs;
constexpr int kHeldAsks = 10;              // in a row, half a second: held, not passed
constexpr std::int32_t kAwayCounts = 500;  // some 20 degrees and more on every model

std::int32_t farthest(const Inspection& seen) {
  std::int32_t out = 0;
  for (const std::int32_t count : seen.counters) out = std::max(out, std::abs(count));
  return out;
}

std::string counters_text(const Inspection& seen) {
  std::string out;
  for (const std::int32_t count : seen.counters) out += (out.empty() ? "" : ", ") + std::to_string(count);
  return "counters " + out;
}

/// Asks until it is held at home, at most so long. @param away_first Only after it was somewhere else.
bool held_at_home(Probe& probe, double seconds, bool away_first, Inspection& last, std::vector<double>& stylus_rad) {
  const std::uint64_t end_ns = rtbus::monotonic_ns() + static_cast<std::uint64_t>(seconds * 1e9);
  bool away = !away_first;
  int held = 0;
  while (!interrupted() && rtbus::monotonic_ns() < end_ns) {
    last = probe.ask();
    away = away || (last.answered && farthest(last) > kAwayCounts);
    const bool home = away && last.answered && last.homed;
    if (held == 0 || !home) stylus_rad.assign(last.stylus_angle_rad.size(), 0.0);
    held = home ? held + 1 : 0;
    for (std::size_t i = 0; home && i < last.stylus_angle_rad.size(); ++i) {
      stylus_rad[i] += last.stylus_angle_rad[i] / kHeldAsks;
    }
    if (held == kHeldAsks) return true;
    (void)sleep_unless_interrupted(kAskEveryNs);
  }
  return false;
}

}  // namespace

Calibration calibrate_phantom(const drivers::usb::UsbModule& module, const drivers::DeviceConfig& config,
                              const GuideOptions& options) {
  Calibration out;
  auto probe = module.probe(config);
  if (!probe) {
    out.steps.push_back({"arm", false, probe.error().message});
    return out;
  }
  Inspection seen = (*probe)->ask();
  out.steps.push_back({"arm", seen.answered, seen.answered ? "it is a " + seen.model : seen.remedy});
  if (!seen.answered) return out;
  if (!seen.model_key.empty() && seen.model_key != config.info().model) {
    out.steps.back().what += ", not what the device file says: model is changed";
    out.changes.push_back({"model", seen.model_key});
  }

  std::vector<double> stylus_rad;
  if (!confirm(options.yes,
               "home: hold the arm " + seen.home +
                   ", the stylus straight on; press the calibration button of its controller there, unless "
                   "it was plugged in there. A zero that is made in any other pose is wrong for good")) {
    return out;
  }
  const bool home = held_at_home(**probe, options.seconds, false, seen, stylus_rad);
  out.steps.push_back({"home", home, counters_text(seen) + (home ? ", those of the home pose" : "; " + seen.remedy)});
  if (!home) return out;
  const std::vector<double> zero_rad = stylus_rad;

  if (!confirm(options.yes, "return: move the arm far to all sides, bring it home again, and hold it there"))
    return out;
  const bool back = held_at_home(**probe, options.seconds, true, seen, stylus_rad);
  out.steps.push_back(
      {"return", back,
       counters_text(seen) + (back ? ": it came back"
                                   : "; they should be near 0 again at home after a way of at least 500: "
                                     "was it moved, is it home, or does an encoder lose counts?")});
  if (!back) return out;

  if (!zero_rad.empty()) {
    std::string list;
    for (const double each : zero_rad) list += (list.empty() ? "" : ", ") + formatted("%.4f", each);
    out.steps.push_back({"stylus", true, "its sensors show " + list + " rad when it is straight"});
    out.changes.push_back({"gimbal.zero_rad", "[" + list + "]"});
  }
  out.complete = true;
  return out;
}

}  // namespace tools
