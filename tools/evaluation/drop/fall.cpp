#include "tools/evaluation/drop/fall.hpp"

#include <algorithm>
#include <cmath>

#include "haptic_node/safety.hpp"
#include "rtbus/clock.hpp"
#include "tools/evaluation/shared/follow_session.hpp"

namespace tools {

namespace {

constexpr double kReleaseStep_m = 0.05e-3;
constexpr double kTail_s = 0.5;
constexpr double kShortestTrace_s = 1.0;

/// What the trace keeps to at its end: the mean of the last kTail_s, and since when it has been within `band` of it.
struct Rest {
  double mean = 0.0;
  double swing = 0.0;
  std::size_t since = 0;
};

Rest find_rest(const std::vector<double>& values, std::size_t begin, std::size_t tail, double band) {
  Rest rest;
  const auto first = values.begin() + static_cast<std::ptrdiff_t>(tail);
  for (auto it = first; it != values.end(); ++it) rest.mean += *it;
  rest.mean /= static_cast<double>(values.end() - first);
  const auto [low, high] = std::minmax_element(first, values.end());
  rest.swing = *high - *low;
  rest.since = begin;
  for (std::size_t i = begin; i < values.size(); ++i) {
    if (std::abs(values[i] - rest.mean) > band) rest.since = i + 1;
  }
  return rest;
}

}  // namespace

const char* to_string(Outcome outcome) noexcept {
  switch (outcome) {
    case Outcome::kNoFall:
      return "no fall";
    case Outcome::kSettled:
      return "settled";
    case Outcome::kOscillating:
      return "oscillating";
    case Outcome::kDiverged:
      return "diverged";
  }
  return "";
}

void FallTrace::append(const rtbus::Telemetry& tick) {
  if (first_ns_ == 0) first_ns_ = tick.device_time_ns;
  time_s.push_back(rtbus::seconds_between(first_ns_, tick.device_time_ns));
  height_m.push_back(tick.position_m[1]);
  force_n.push_back(tick.force_n[1]);
  rendered_n.push_back(tick.rendered_force_n[1]);
  overspeed.push_back((tick.safety & haptic::kOverspeed) != 0);
  // Before the fall a pause does no harm. A proxy is a period and a cycle or two old before the next one comes.
  constexpr double kFalling_m = 0.1e-3;
  if (height_m.front() - height_m.back() < kFalling_m && worst_pause_ms == 0.0) return;
  const double age_ms = static_cast<double>(tick.proxy_age_ns) * 1e-6;
  worst_pause_ms = std::max({worst_pause_ms, tick.wakeup_us * 1e-3, age_ms - step_s * 1e3 - 2.0});
}

std::size_t release_index(const FallTrace& trace) {
  std::size_t i = 0;
  while (i + 1 < trace.height_m.size() && trace.height_m[i + 1] > trace.height_m.front() - kReleaseStep_m) ++i;
  return i;
}

FallFigures judge_fall(const FallTrace& trace, const FallLimits& limits) {
  FallFigures out;
  if (trace.height_m.size() < 2 || trace.time_s.back() < kShortestTrace_s) return out;
  const std::size_t release = release_index(trace);
  if (release + 1 >= trace.height_m.size()) return out;
  const double release_s = trace.time_s[release];
  for (std::size_t i = release; i < trace.height_m.size(); ++i) {
    out.peak_force_n = std::max(out.peak_force_n, std::abs(trace.rendered_n[i]));
    if (std::abs(trace.rendered_n[i]) > trace.max_force_n || trace.overspeed[i] ||
        std::abs(trace.height_m[i]) > limits.run_away_m) {
      out.outcome = Outcome::kDiverged;
      out.diverged_s = trace.time_s[i] - release_s;
      return out;
    }
  }
  std::size_t tail = trace.time_s.size() - 1;
  while (tail > release && trace.time_s.back() - trace.time_s[tail] < kTail_s) --tail;
  const Rest force = find_rest(trace.force_n, release, tail, limits.force_band_n);
  const Rest height = find_rest(trace.height_m, release, tail, limits.height_band_m);
  out.rest_m = height.mean;
  out.swing_n = force.swing;
  const std::size_t since = limits.height_band_m > 0.0 ? height.since : force.since;
  out.outcome = since <= tail ? Outcome::kSettled : Outcome::kOscillating;
  if (out.outcome == Outcome::kSettled) out.settling_s = trace.time_s[since] - release_s;
  return out;
}

FallTrace fall_in_harness(const FallSetup& setup, const HarnessOptions& link) {
  std::vector<rtbus::config::Override> overrides;
  for (const std::string& text : setup.assignments) overrides.push_back(rtbus::config::parse_override(text));
  auto session = rtbus::config::load_session(setup.session_file, overrides);
  Harness harness(session, link);
  FallTrace trace;
  trace.max_force_n = harness.config().safety.max_force_n;
  harness.run(setup.duration_s, [&](const rtbus::Telemetry& tick) { trace.append(tick); });
  return trace;
}

std::optional<FallTrace> fall_for_real(const FallSetup& setup) {
  FollowedSession session({setup.session_file, setup.assignments, "drop", setup.duration_s});
  FallTrace trace;
  trace.max_force_n = session.plan().haptic.front().safety.max_force_n;
  if (session.plan().physics) trace.step_s = session.plan().physics->physics.step_s();
  if (!session.run([&](const rtbus::Telemetry& tick) { trace.append(tick); })) return std::nullopt;
  trace.load = session.load();
  trace.load.pause_ms = trace.worst_pause_ms;
  return trace;
}

}  // namespace tools
