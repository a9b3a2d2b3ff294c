#include "tools/evaluation/stack/push.hpp"

#include <algorithm>
#include <cmath>
#include <span>
#include <utility>

#include "rtbus/clock.hpp"
#include "tools/evaluation/shared/follow_session.hpp"

namespace tools {

namespace {

double percentile(std::vector<double> values, double share) {
  if (values.empty()) return 0.0;
  const auto at = values.begin() + static_cast<std::ptrdiff_t>(share * static_cast<double>(values.size() - 1));
  std::nth_element(values.begin(), at, values.end());
  return *at;
}

std::size_t touch_index(const PushTrace& trace, double gap_mm) {
  std::size_t i = 0;
  while (i < trace.way_mm.size() && trace.way_mm[i] < gap_mm) ++i;
  return i;
}

}  // namespace

void PushTrace::append(const rtbus::Telemetry& tick) {
  if (time_s.empty()) {
    first_ns_ = tick.due_ns;
    start_m_ = tick.position_m[2];
  }
  time_s.push_back(rtbus::seconds_between(first_ns_, tick.due_ns));
  force_n.push_back(tick.force_n[2]);
  way_mm.push_back((start_m_ - tick.position_m[2]) * 1e3);
}

void PushTrace::append(const rtbus::Stamped<rtbus::ProxyState>& step) {
  if (time_s.empty()) return;
  step_time_s.push_back(rtbus::seconds_between(first_ns_, step.stamp_ns));
  step_ms.push_back(step.value.step_compute_s * 1e3);
}

PushFigures judge_push(const PushTrace& trace, double gap_mm) {
  PushFigures out;
  const std::size_t first = touch_index(trace, gap_mm);
  if (first == trace.force_n.size()) return out;
  out.touched_s = trace.time_s[first];
  out.roughness = roughness(std::span(trace.force_n).subspan(first), trace.rate_hz);
  for (std::size_t i = first; i < trace.force_n.size(); ++i) {
    out.peak_n = std::max(out.peak_n, std::abs(trace.force_n[i]));
  }
  return out;
}

PushTrace push_in_harness(const PushSetup& setup, const HarnessOptions& link, StillFrame* end) {
  std::vector<rtbus::config::Override> overrides;
  for (const std::string& text : setup.assignments) overrides.push_back(rtbus::config::parse_override(text));
  auto session = rtbus::config::load_session(setup.session_file, overrides);
  Harness harness(session, link);
  PushTrace trace;
  trace.rate_hz = harness.config().rate_hz;
  std::vector<rtbus::Telemetry> last(harness.hands());
  harness.run_all(setup.duration_s, [&](std::size_t hand, const rtbus::Telemetry& tick) {
    last[hand] = tick;
    if (hand == 0) trace.append(tick);
  });
  if (end != nullptr) *end = frame_of(session.scene, harness, last);
  return trace;
}

std::optional<LivePush> push_for_real(const PushSetup& setup) {
  FollowedSession session({setup.session_file, setup.assignments, "stack", setup.duration_s, /*bare_loop=*/true});
  LivePush out;
  PushTrace& trace = out.trace;
  trace.rate_hz = session.plan().haptic.front().rate_hz;
  rtbus::Telemetry first, last;
  const bool ran = session.run(
      [&](const rtbus::Telemetry& tick) {
        if (trace.time_s.empty()) first = tick;
        last = tick;
        trace.append(tick);
        out.worst_pause_ms = std::max(out.worst_pause_ms, tick.wakeup_us * 1e-3);
      },
      [&](const rtbus::Stamped<rtbus::ProxyState>& step) { trace.append(step); });
  if (!ran) return std::nullopt;

  out.haptic_hz = static_cast<double>(last.tick - first.tick) / rtbus::seconds_between(first.due_ns, last.due_ns);
  out.wakeup_p999_us = session.loop().wakeup_p999_us;
  if (session.bare()) out.bare = *session.bare();
  if (out.bare.due > 0) {
    out.bare_hz = out.bare.rate_hz * static_cast<double>(out.bare.ticks) / static_cast<double>(out.bare.due);
  }
  out.worst_pause_ms = std::max(out.worst_pause_ms, out.bare.wakeup_max_us * 1e-3);
  out.load = session.load();
  out.load.pause_ms = out.worst_pause_ms;

  const std::size_t touched = touch_index(trace, setup.gap_mm);
  const double from_s = touched < trace.time_s.size() ? trace.time_s[touched] : 0.0;
  std::vector<double> steps_ms;
  double first_step_s = 0.0, last_step_s = 0.0;
  for (std::size_t i = 0; i < trace.step_time_s.size(); ++i) {
    if (trace.step_time_s[i] < from_s) continue;
    if (steps_ms.empty()) first_step_s = trace.step_time_s[i];
    last_step_s = trace.step_time_s[i];
    steps_ms.push_back(trace.step_ms[i]);
  }
  if (last_step_s > first_step_s) {
    out.simulation_hz = static_cast<double>(steps_ms.size() - 1) / (last_step_s - first_step_s);
  }
  out.step_p50_ms = percentile(steps_ms, 0.50);
  out.step_p99_ms = percentile(steps_ms, 0.99);
  if (session.plan().physics) {
    const double step_s = session.plan().physics->physics.step_s();
    out.real_time_factor = out.simulation_hz * step_s;
    out.load_and_steps = out.load.with_steps(std::move(steps_ms), 1e3 * step_s);
  }
  return out;
}

}  // namespace tools
