#include "tools/cli/top/top_node_lines.hpp"

#include <algorithm>
#include <cmath>

#include "rtbus/why_behind.hpp"
#include "tools/cli/common/formatted.hpp"
#include "tools/cli/top/top_haptic_lines.hpp"

namespace tools {

namespace {

void add_restarts(ViewLine& head, const NodeLife& life) {
  if (life.restarts == 0) return;
  head.add(formatted("  restarts %u, last %s ago", life.restarts, clock_text(life.process_age_s).c_str()), Tone::kWarn);
}

void add_left_out(Lines& lines, const std::optional<rtbus::NodeInfo>& info, const LineStyle& style) {
  if (!info) return;
  const std::string text = rtbus::text_of(info->left_out);
  if (text.empty()) return;
  // Broken at its commas, so that a narrow window leaves out whole names.
  ViewLine line(std::string("  left out  "), Tone::kDim);
  for (std::size_t begin = 0; begin < text.size();) {
    const std::size_t comma = std::min(text.find(", ", begin), text.size());
    line.add(text.substr(begin, comma - begin) + (comma < text.size() ? ", " : ""), Tone::kDim);
    begin = comma + 2;
  }
  line.fit(static_cast<std::size_t>(style.width), style.utf8);
  lines.push_back(std::move(line));
}

}  // namespace

std::string life_text(const NodeLife& life) {
  if (!life.writer_alive) return "GONE";
  if (!life.heartbeat_age_s) return "starting";
  return *life.heartbeat_age_s > kHeartbeatLost_s ? formatted("STALE %.2f s", *life.heartbeat_age_s) : "alive";
}

Tone tone_of(const NodeLife& life) {
  if (!life.writer_alive) return Tone::kBad;
  if (!life.heartbeat_age_s) return Tone::kWarn;
  return *life.heartbeat_age_s > kHeartbeatLost_s ? Tone::kBad : Tone::kGood;
}

Lines haptic_lines(const HapticView& view, Detail detail, bool chosen, const LineStyle& style) {
  Lines lines;
  ViewLine head(view.name, chosen ? Tone::kChosen : Tone::kHeading);
  head.add(" " + life_text(view.life), tone_of(view.life));
  if (view.estop) head.add(std::string("  E-STOP, re-arm with R or rtbus estop --rearm"), Tone::kBad);
  add_restarts(head, view.life);
  if (view.info) {
    // What a narrow window leaves out stands last.
    head.add("  " + rtbus::text_of(view.info->kind)).add(", " + rtbus::text_of(view.info->method));
    head.add(", " + granted_text(*view.info)).add(", " + rtbus::text_of(view.info->clock));
  }
  lines.push_back(std::move(head));
  const HapticLines part(view, detail, style);
  if (detail == Detail::kRoomy) part.add_granted(lines);
  part.add_rate(lines);
  if (detail >= Detail::kFigures) part.add_wakeup(lines);
  if (detail >= Detail::kSketched) part.add_jitter(lines);
  if (detail >= Detail::kFigures) part.add_compute(lines);
  part.add_force(lines);
  if (detail >= Detail::kSketched) part.add_force_curve(lines);
  if (detail >= Detail::kFigures) part.add_position(lines);
  if (detail >= Detail::kSketched) part.add_position_curves(lines);
  if (detail >= Detail::kFigures) part.add_energy(lines);
  part.add_safety(lines);
  part.add_link(lines);
  if (detail >= Detail::kSketched) part.add_cut(lines);
  if (detail >= Detail::kDrawn) add_left_out(lines, view.info, style);
  return lines;
}

Lines physics_lines(const PhysicsView& view, Detail detail, const LineStyle& style) {
  Lines lines;
  ViewLine head(view.name, Tone::kHeading);
  head.add(" " + life_text(view.life), tone_of(view.life));
  add_restarts(head, view.life);
  if (view.info) {
    head.add("  " + rtbus::text_of(view.info->kind)).add(", " + rtbus::text_of(view.info->clock));
    head.add(formatted(", %u bod%s", view.info->bodies, view.info->bodies == 1 ? "y" : "ies"))
        .add(", " + granted_text(*view.info));
  }
  lines.push_back(std::move(head));
  if (view.stats) {
    const rtbus::StepStats& stats = *view.stats;
    const bool measured = stats.achieved_hz > 0.0;
    const bool slow = measured && stats.achieved_hz < 0.98 * stats.rate_hz;
    ViewLine rate(std::string("  rate      "));
    rate.add(!measured                 ? "not measured yet"
             : !slow                   ? "kept"
             : rtbus::steps_fit(stats) ? "BEHIND, the machine is busy:"
                                       : "TOO SLOW",
             !measured ? Tone::kDim
             : slow    ? Tone::kWarn
                       : Tone::kGood);
    rate.add(formatted(" %.1f of %.0f Hz", stats.achieved_hz, stats.rate_hz));
    rate.add(formatted("  late %llu of %llu", count(stats.late), count(stats.steps)));
    rate.add(formatted("  not served %llu", count(stats.due > stats.steps ? stats.due - stats.steps : 0)));
    if (stats.wall_s > 0.0) rate.add(formatted("  %.1f %% of real time", 100.0 * stats.simulated_s / stats.wall_s));
    lines.push_back(std::move(rate));
    const Units& units = style.units;
    ViewLine step("  step      p50 " + units.age(stats.step_p50_ms * 1e-3));
    step.add("  p99 " + units.age(stats.step_p99_ms * 1e-3));
    step.add(std::string("  max ") + units.age(stats.step_max_ms * 1e-3) + " " + units.age_unit());
    // A share above one is a step that took longer than its period.
    if (stats.rate_hz > 0.0) {
      const double share = stats.step_p99_ms * 1e-3 * stats.rate_hz;
      step.add(formatted("  p99 is %s %% of a period", three_figures(100.0 * share).c_str()),
               share > 1.0 ? Tone::kWarn : Tone::kPlain);
    }
    step.add(formatted("  simulated %.1f s", stats.simulated_s));
    lines.push_back(std::move(step));
  }
  if (detail >= Detail::kDrawn) add_left_out(lines, view.info, style);
  return lines;
}

}  // namespace tools
