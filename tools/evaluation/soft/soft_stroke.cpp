#include "tools/evaluation/soft/soft_stroke.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <span>

#include "rtbus/clock.hpp"
#include "rtbus/config/session.hpp"
#include "tools/cli/common/interrupt.hpp"
#include "tools/evaluation/shared/method_settings.hpp"

namespace tools {

namespace {

/// A force below this is no touch: encoder steps times stiffness, and the damper in free air.
constexpr double kTouch_n = 0.05;
// The script (config/devices/stroke_soft.csv): pressed in at 2 s, still until 3 s, stroking until 6 s. A real session
// is followed from some tenths of a second after its start on.
constexpr double kPressed_s = 2.2, kLifted_s = 5.5;
constexpr double kPicture_s = 4.5;  // stroking

constexpr double kOffset_m = 0.05;       // of the device's origin above the floor, as in the session file
constexpr double kYield_n_per_m = 25.0;  // about what the soft body gives to the hand: the first guess of a depth
constexpr int kTries = 6;                // to bring the means together

}  // namespace

void SoftStroke::append(const rtbus::Telemetry& tick) {
  if (time_s.empty()) first_ns_ = tick.due_ns;
  time_s.push_back(rtbus::seconds_between(first_ns_, tick.due_ns));
  up_n.push_back(tick.force_n[1]);
  norm_n.push_back(std::hypot(tick.force_n[0], tick.force_n[1], tick.force_n[2]));
  absorbed_j = tick.energy_absorbed_j;
}

StrokeFigures judge_stroke(const SoftStroke& stroke) {
  StrokeFigures out;
  const auto index = [&stroke](double time_s) {
    return static_cast<std::size_t>(std::lower_bound(stroke.time_s.begin(), stroke.time_s.end(), time_s) -
                                    stroke.time_s.begin());
  };
  const std::size_t begin = index(kPressed_s), end = index(kLifted_s);
  if (begin >= end) return out;
  const auto held = std::count_if(stroke.norm_n.begin() + static_cast<std::ptrdiff_t>(begin),
                                  stroke.norm_n.begin() + static_cast<std::ptrdiff_t>(end),
                                  [](double force_n) { return force_n > kTouch_n; });
  out.held = static_cast<double>(held) / static_cast<double>(end - begin);
  out.peak_n = *std::max_element(stroke.norm_n.begin(), stroke.norm_n.end());
  out.roughness = roughness(std::span(stroke.up_n).subspan(begin, end - begin), stroke.rate_hz);
  return out;
}

std::vector<std::string> stroke_settings(const SoftOptions& options, const SoftMachine& machine, const char* method,
                                         double depth_m) {
  char text[120];
  std::vector<std::string> out = method_settings(method);
  out.emplace_back("haptic.0.device.hand.impedance=light");
  if (machine.throttle_hz > 0.0) {
    std::snprintf(text, sizeof text, "physics.throttle_hz=%.9g", machine.throttle_hz);
    out.emplace_back(text);
  }
  std::snprintf(text, sizeof text, "haptic.0.coupling.stiffness_n_per_m=%.9g", machine.stiffness_n_per_m);
  out.emplace_back(text);
  std::snprintf(text, sizeof text, "haptic.0.mapping.offset_m=[0,%.9g,0]", kOffset_m - depth_m);
  out.emplace_back(text);
  out.insert(out.end(), options.assignments.begin(), options.assignments.end());
  return out;
}

rtbus::config::SessionConfig load_stroke(const SoftOptions& options, const std::vector<std::string>& assignments) {
  std::vector<rtbus::config::Override> overrides;
  for (const std::string& text : assignments) overrides.push_back(rtbus::config::parse_override(text));
  return rtbus::config::load_session(options.session_file, overrides);
}

SoftStroke stroke_in_harness(const SoftOptions& options, const std::vector<std::string>& assignments,
                             StillFrame* picture) {
  auto session = load_stroke(options, assignments);
  const rtbus::config::Scene scene = session.scene;
  Harness harness(session, {});
  SoftStroke out;
  out.rate_hz = harness.config().rate_hz;
  rtbus::Telemetry last;
  const auto observe = [&](const rtbus::Telemetry& tick) {
    last = tick;
    out.append(tick);
  };
  const double until_s = std::min(kPicture_s, options.duration_s);
  harness.run(until_s, observe);
  if (picture != nullptr) *picture = frame_of(scene, harness, std::span(&last, 1));
  harness.run(options.duration_s - until_s, observe);
  return out;
}

StrokeAtMean stroke_at_mean(const SoftOptions& options, const SoftMachine& machine, const char* method, double mean_n,
                            StillFrame* picture) {
  StrokeAtMean out;
  double depth_m = 0.0;
  for (int attempt = 0; attempt < kTries && !interrupted(); ++attempt) {
    out.stroke = stroke_in_harness(options, stroke_settings(options, machine, method, depth_m), picture);
    out.figures = judge_stroke(out.stroke);
    out.figures.depth_m = depth_m;
    const double missing_n = mean_n - out.figures.roughness.mean_n;
    if (std::abs(missing_n) < 0.9 * kEqualStrokes * out.figures.roughness.mean_n) break;
    if (attempt + 1 < kTries) depth_m = std::clamp(depth_m + missing_n / kYield_n_per_m, -0.016, 0.016);
  }
  return out;
}

}  // namespace tools
