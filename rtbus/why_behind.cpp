#include "rtbus/why_behind.hpp"

#include <cstdio>

namespace rtbus {

namespace {

constexpr double kFits = 0.5;  // of the period, at the median

}  // namespace

bool steps_fit(const StepStats& stats) noexcept {
  return stats.steps > 0 && stats.rate_hz > 0.0 && stats.step_p50_ms < kFits * 1e3 / stats.rate_hz;
}

std::string why_behind(const StepStats& stats, std::string_view engine) {
  char text[200];
  const double period_ms = stats.rate_hz > 0.0 ? 1e3 / stats.rate_hz : 0.0;
  if (steps_fit(stats)) {
    if (stats.step_p99_ms <= period_ms) {
      std::snprintf(text, sizeof text,
                    "steps take %.3g ms at the median and fit into %.3g ms: the machine was busy with something else",
                    stats.step_p50_ms, period_ms);
    } else {
      std::snprintf(text, sizeof text,
                    "steps take %.3g ms at the median and fit into %.3g ms, but 1 %% of them take %.3g ms or more: the "
                    "machine was busy with something else, or the scene is heavy at times",
                    stats.step_p50_ms, period_ms, stats.step_p99_ms);
    }
    return text;
  }
  std::snprintf(
      text, sizeof text, "steps take %.3g ms at the median, of %.3g ms; lower physics.rate_hz%s", stats.step_p50_ms,
      period_ms,
      engine == "bullet" ? " or physics.solver_iterations, or make the scene smaller" : ", or make the scene smaller");
  return text;
}

}  // namespace rtbus
