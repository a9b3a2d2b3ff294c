#include "tools/evaluation/stability/stability_run.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <ctime>
#include <stdexcept>

#include "drivers/simulated/simulated_device.hpp"
#include "tools/evaluation/stability/stability_watch.hpp"

namespace tools {

namespace {

double cpu_now_s() {
  timespec now{};
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

void simulate(const StabilityCase& each, const std::string& session_file, const std::vector<std::string>& extra,
              std::vector<StabilityTick>* trace, StabilityResult& out) {
  std::vector<rtbus::config::Override> overrides;
  for (const std::string& text : assignments_of(each)) overrides.push_back(rtbus::config::parse_override(text));
  for (const std::string& text : extra) overrides.push_back(rtbus::config::parse_override(text));
  auto session = rtbus::config::load_session(session_file, overrides);
  Harness harness(session, link_of(each));
  out.rendered_n_per_m = harness.config().stiffness_n_per_m;
  out.rendered_n_s_per_m = harness.config().damping_n_s_per_m;
  Watch watch(each, harness.config().safety.max_force_n, 1.0 / harness.config().rate_hz, out);
  const auto& plant = dynamic_cast<const drivers::simulated::SimulatedDevice&>(harness.device()).mechanics();
  const auto observe = [&](const rtbus::Telemetry& telemetry) {
    const double now_s = rtbus::seconds_between(rtbus::kNsPerS, telemetry.due_ns);
    watch.tick(telemetry, plant.position_m(), -plant.actuator_work_j(), now_s);
    if (trace != nullptr) trace->push_back(StabilityTick::of(telemetry, each, now_s));
  };
  const WatchTimes times(each);
  const double window_s = times.window_s, watched_s = times.watched_s;
  harness.run(each.end_s(), observe);
  watch.begin_windows();
  bool rested = false;
  const auto watch_until = [&](double until_s) {
    while (!rested && harness.now_s() + 0.5 * window_s < until_s) {
      harness.run(window_s, observe);
      rested = watch.end_window();
    }
    watch.judge(rested);
  };
  watch_until(each.end_s() + watched_s);
  // What grows goes on growing, and what is steady is still there; what only builds up to what it is, was larger by
  // chance, or came of a loss of physics just now, is not.
  if (out.growing || out.outcome == StabilityOutcome::kDiverged)
    watch_until(each.end_s() + WatchTimes::kLongerLook * watched_s);
  if (out.growing) watch_until(each.end_s() + WatchTimes::kLongerLook * WatchTimes::kLongerLook * watched_s);
  out.settled_s = rested ? std::max(0.0, harness.now_s() - 2.0 * window_s - each.end_s()) : -1.0;
  out.simulated_s = harness.now_s();
}

}  // namespace

StabilityTick StabilityTick::of(const rtbus::Telemetry& telemetry, const StabilityCase& each, double time_s) noexcept {
  const std::size_t axis = each.along_z() ? 2 : 1;
  return {time_s,
          telemetry.position_m[axis],
          telemetry.force_n[axis],
          telemetry.proxy_position_m[axis],
          telemetry.energy_observed_j,
          telemetry.rendered_force_n[axis],
          -telemetry.energy_absorbed_j};
}

const char* to_string(StabilityOutcome outcome) noexcept {
  constexpr std::array names{"settled", "moving", "limit_cycle", "diverged", "failed"};
  return names[static_cast<std::size_t>(outcome)];
}

StabilityResult run_case(const StabilityCase& each, const std::string& session_file,
                         const std::vector<std::string>& extra, bool reference,
                         std::vector<StabilityTick>* trace) noexcept {
  StabilityResult out;
  out.seed = each.seed;
  out.reference_n = out.reference_m = -1.0;
  const double began_s = cpu_now_s();
  try {
    simulate(each, session_file, extra, trace, out);
    const bool oscillates =
        out.outcome == StabilityOutcome::kDiverged && out.clamped_s <= kClampBarS && out.law_nonfinite == 0;
    if (reference && oscillates && !each.needs_bullet() && each.method != "direct") {
      StabilityResult direct;
      simulate(direct_reference(each, out.rendered_n_per_m, out.rendered_n_s_per_m), session_file, {}, nullptr, direct);
      out.reference_n = direct.swing_n;
      out.reference_m = direct.swing_m;
      // It has the same oscillation when it swings at least as far: then the device makes it, not the method.
      if (direct.outcome == StabilityOutcome::kDiverged && direct.swing_n >= out.swing_n &&
          direct.swing_m >= out.swing_m) {
        out.outcome = StabilityOutcome::kLimitCycle;
      }
    }
  } catch (const std::exception& error) {
    out.outcome = StabilityOutcome::kFailed;
    std::snprintf(out.error, sizeof out.error, "%s", error.what());
  }
  out.cpu_s = cpu_now_s() - began_s;
  return out;
}

}  // namespace tools
