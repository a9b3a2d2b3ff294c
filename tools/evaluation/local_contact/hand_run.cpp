#include "tools/evaluation/local_contact/hand_run.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "tools/harness/harness.hpp"

namespace tools {

HandRun run_hand(const LocalContactOptions& options, const std::string& session_file,
                 const std::vector<std::string>& settings, double duration_s, std::optional<std::size_t> body,
                 bool knows_shapes) {
  std::vector<rtbus::config::Override> overrides;
  for (const std::string& text : settings) overrides.push_back(rtbus::config::parse_override(text));
  for (const std::string& text : options.assignments) overrides.push_back(rtbus::config::parse_override(text));
  auto session = rtbus::config::load_session(session_file, overrides);
  Harness harness(session, {.knows_shapes = knows_shapes, .measure_cost = true});
  const auto every = static_cast<std::uint64_t>(std::llround(harness.config().rate_hz / 1000.0));
  HandRun out;
  harness.run(duration_s, [&](const rtbus::Telemetry& tick) {
    if (tick.tick % every != 0) return;
    out.time_s.push_back(harness.now_s());
    out.force_n.emplace_back(tick.force_n[0], tick.force_n[1], tick.force_n[2]);
  });
  if (body) out.last = harness.stepper()->world().body_pose(*body);
  out.cycle_us = 1e-3 * static_cast<double>(harness.cost().cycle_ns.percentile(0.5));
  out.cycle_p99_us = 1e-3 * static_cast<double>(harness.cost().cycle_ns.percentile(0.99));
  return out;
}

HandError hand_error(const HandRun& felt, const HandRun& truth, double from_s) {
  HandError out;
  double sum = 0.0, count = 0.0;
  const std::size_t from = std::max<std::size_t>(1, static_cast<std::size_t>(1000.0 * from_s));
  for (std::size_t i = from; i < std::min(felt.force_n.size(), truth.force_n.size()); ++i) {
    out.change_n = std::max(out.change_n, (felt.force_n[i] - felt.force_n[i - 1]).norm());
    if (felt.force_n[i].isZero(0.0) && truth.force_n[i].isZero(0.0)) continue;
    const double error_n = (felt.force_n[i] - truth.force_n[i]).norm();
    sum += error_n * error_n;
    count += 1.0;
    out.peak_n = std::max(out.peak_n, error_n);
  }
  out.rms_n = std::sqrt(sum / std::max(count, 1.0));
  return out;
}

double largest_force_n(const HandRun& run) {
  double out = 0.0;
  for (const Eigen::Vector3d& force_n : run.force_n) out = std::max(out, force_n.norm());
  return out;
}

PanelLine hand_line(const HandRun& run, PanelLine line, double from_s) {
  for (std::size_t i = 0; i < run.time_s.size(); ++i) {
    if (run.time_s[i] < from_s) continue;
    line.x.push_back(run.time_s[i]);
    line.y.push_back(run.force_n[i].norm());
  }
  return line;
}

}  // namespace tools
