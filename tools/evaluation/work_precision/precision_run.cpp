#include "tools/evaluation/work_precision/precision_run.hpp"

#include <malloc.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <utility>

#include "tools/evaluation/shared/method_settings.hpp"

namespace tools {

namespace {

std::string assignment(const char* key, double value) {
  char text[120];
  std::snprintf(text, sizeof text, "%s=%.17g", key, value);
  return text;
}

double heap_bytes() {
  const struct mallinfo2 now = ::mallinfo2();
  return static_cast<double>(now.uordblks + now.hblkhd);
}

}  // namespace

std::vector<std::string> assignments_of(const PrecisionScene& scene, const PrecisionCell& cell) {
  std::vector<std::string> out = scene.assignments;
  for (std::string& text : method_settings(cell.method)) out.push_back(std::move(text));
  out.push_back(assignment("haptic.0.rate_hz", cell.haptic_hz));
  out.push_back(assignment("physics.rate_hz", std::max(cell.engine_hz, cell.physics_hz)));
  // Throttled, physics reads the hand, steps, and holds the result back until its period is over.
  if (cell.one_period_late) out.push_back(assignment("physics.throttle_hz", cell.physics_hz));
  if (cell.solver_iterations > 0) {
    out.push_back("physics.solver_iterations=" + std::to_string(cell.solver_iterations));
  }
  return out;
}

PrecisionTrace run_precisely(const PrecisionScene& scene, const PrecisionCell& cell, const AroundWorld& around_world) {
  std::vector<rtbus::config::Override> overrides;
  for (const std::string& text : assignments_of(scene, cell)) overrides.push_back(rtbus::config::parse_override(text));
  auto session = rtbus::config::load_session(scene.session_file, overrides);
  const double before = heap_bytes();
  Harness harness(session, {.measure_cost = true, .around_world = around_world});
  PrecisionTrace trace;
  trace.heap_kib = (heap_bytes() - before) / 1024.0;
  trace.limit_n = harness.config().safety.max_force_n;
  const auto cycles = static_cast<std::size_t>(scene.until_s * cell.haptic_hz) + 1;
  for (auto* values : {&trace.time_s, &trace.position_m, &trace.force_n}) values->reserve(cycles);
  const auto axis = static_cast<std::size_t>(scene.axis);
  harness.run(scene.until_s, [&](const rtbus::Telemetry& tick) {
    trace.time_s.push_back(harness.now_s());
    trace.position_m.push_back(tick.position_m[axis]);
    trace.force_n.push_back(tick.force_n[axis]);
    const auto& wanted = tick.rendered_force_n;
    trace.wanted_peak_n = std::max(trace.wanted_peak_n, std::hypot(wanted[0], wanted[1], wanted[2]));
    trace.absorbed_j = tick.energy_absorbed_j;
  });
  const HarnessCost& cost = harness.cost();
  trace.cycle_ns = static_cast<double>(cost.cycle_ns.percentile(0.5));
  trace.cycle_p99_ns = static_cast<double>(cost.cycle_ns.percentile(0.99));
  trace.step_ms = cost.steps > 0 ? 1e3 * cost.steps_s / static_cast<double>(cost.steps) : 0.0;
  trace.cpu_s_per_s =
      (cost.steps_s + 1e-9 * trace.cycle_ns * static_cast<double>(cost.cycle_ns.count())) / scene.until_s;
  return trace;
}

PrecisionError error_of(const PrecisionTrace& trace, const PrecisionScene& scene, const Reference& reference) {
  PrecisionError out;
  double force2 = 0.0, way2 = 0.0;
  std::size_t count = 0;
  ReferencePoint before;
  for (std::size_t i = 0; i < trace.time_s.size(); ++i) {
    const double t = trace.time_s[i];
    if (t < scene.from_s || t > scene.until_s) continue;
    const ReferencePoint at = reference(t);
    const double force_n = trace.force_n[i] - at.force_n;
    const double way_m = trace.position_m[i] - at.position_m;
    force2 += force_n * force_n;
    way2 += way_m * way_m;
    out.force_peak_n = std::max(out.force_peak_n, std::abs(force_n));
    out.position_peak_m = std::max(out.position_peak_m, std::abs(way_m));
    if (count > 0) {
      // The held force over the way that the tip went; the reference's by the trapezoidal rule.
      const double given_j = trace.force_n[i - 1] * (trace.position_m[i] - trace.position_m[i - 1]);
      const double due_j = 0.5 * (before.force_n + at.force_n) * (at.position_m - before.position_m);
      out.spurious_j += given_j - due_j;
    }
    before = at;
    ++count;
  }
  if (count > 0) {
    out.force_rms_n = std::sqrt(force2 / static_cast<double>(count));
    out.position_rms_m = std::sqrt(way2 / static_cast<double>(count));
  }
  return out;
}

Reference reference_of(const PrecisionTrace& trace) {
  return [&trace](double time_s) {
    const auto next = std::lower_bound(trace.time_s.begin(), trace.time_s.end(), time_s);
    if (next == trace.time_s.end()) return ReferencePoint{trace.position_m.back(), trace.force_n.back()};
    const auto i = static_cast<std::size_t>(next - trace.time_s.begin());
    if (i == 0) return ReferencePoint{trace.position_m.front(), trace.force_n.front()};
    const double u = (time_s - trace.time_s[i - 1]) / (trace.time_s[i] - trace.time_s[i - 1]);
    return ReferencePoint{trace.position_m[i - 1] + u * (trace.position_m[i] - trace.position_m[i - 1]),
                          trace.force_n[i - 1] + u * (trace.force_n[i] - trace.force_n[i - 1])};
  };
}

}  // namespace tools
