#include "tools/cli/top/top_haptic_lines.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numeric>
#include <utility>

#include "haptic_node/safety.hpp"
#include "tools/cli/common/formatted.hpp"
#include "tools/cli/top/top_marks.hpp"

namespace tools {

namespace {

constexpr int kMargin = 12;

std::string margin() { return std::string(kMargin, ' '); }

/// Share of the limit in use, in a tone. What is no number is bad.
Tone force_tone(double now_n, double limit_n) {
  if (!(limit_n > 0.0)) return Tone::kPlain;
  if (!(now_n <= 0.95 * limit_n)) return Tone::kBad;
  return now_n > 0.8 * limit_n ? Tone::kWarn : Tone::kGood;
}

std::string edge_text(std::size_t bin) {
  if (bin == kJitterEdges_us.size()) return ">" + formatted("%.0fms", kJitterEdges_us.back() * 1e-3);
  const double edge_us = kJitterEdges_us[bin];
  return edge_us < 1000.0 ? formatted("<%.0f", edge_us) : formatted("<%.0fms", edge_us * 1e-3);
}

/// The tail from half a millisecond on is what a hand could feel at 1 kHz.
Tone jitter_tone(std::size_t bin, std::uint64_t ticks) { return ticks > 0 && bin >= 7 ? Tone::kWarn : Tone::kPlain; }

}  // namespace

std::string granted_text(const rtbus::NodeInfo& info) {
  const std::string name = rtbus::text_of(info.scheduling);
  const std::string core = info.core == 0xffffffffu ? std::string("any core") : "core " + std::to_string(info.core);
  return (name.starts_with("SCHED_") ? name.substr(6) : name) + " " + core;
}

std::size_t HapticLines::columns(int beside) const {
  const int width = style_.width > 0 ? style_.width : 80;
  return static_cast<std::size_t>(std::max(4, width - kMargin - beside));
}

void HapticLines::add_granted(Lines& lines) const {
  if (!view_.info) return;
  const rtbus::NodeInfo& info = *view_.info;
  ViewLine line("  granted   " + rtbus::text_of(info.realtime));
  const bool lowered = info.stiffness_rendered_n_per_m < info.stiffness_requested_n_per_m;
  line.add(lowered ? formatted("   stiffness %.0f N/m, lowered from %.0f", info.stiffness_rendered_n_per_m,
                               info.stiffness_requested_n_per_m)
                   : formatted("   stiffness %.0f N/m", info.stiffness_rendered_n_per_m),
           lowered ? Tone::kWarn : Tone::kPlain);
  line.add(formatted("   pid %u", view_.life.pid));
  lines.push_back(std::move(line));
}

void HapticLines::add_rate(Lines& lines) const {
  if (!view_.stats) return;
  const rtbus::LoopStats& stats = *view_.stats;
  const double share =
      stats.ticks_due > 0 ? 100.0 * static_cast<double>(stats.overruns) / static_cast<double>(stats.ticks_due) : 0.0;
  const bool measured = stats.achieved_hz > 0.0;
  const bool slow = measured && stats.achieved_hz < 0.99 * stats.rate_hz;
  ViewLine line(std::string("  rate      "));
  line.add(formatted("%s of %.0f Hz", measured ? formatted("%.1f", stats.achieved_hz).c_str() : "-", stats.rate_hz),
           !measured ? Tone::kDim
           : slow    ? Tone::kWarn
                     : Tone::kGood);
  line.add(formatted("   overruns %llu (%.3f %%)", count(stats.overruns), share));
  line.add(formatted("   ticks %llu", count(stats.ticks)));
  lines.push_back(std::move(line));
}

void HapticLines::add_wakeup(Lines& lines) const {
  if (!view_.stats) return;
  const rtbus::LoopStats& stats = *view_.stats;
  const Units& units = style_.units;
  ViewLine line("  wake-up   p50 " + units.latency(stats.wakeup_p50_us * 1e-6));
  line.add("  p99 " + units.latency(stats.wakeup_p99_us * 1e-6));
  line.add("  p99.9 " + units.latency(stats.wakeup_p999_us * 1e-6));
  line.add("  max " + units.latency(stats.wakeup_max_us * 1e-6) + " " + units.latency_unit());
  if (view_.recent) {
    line.add("   last 10 s max " + units.latency(view_.recent->wakeup_max_us * 1e-6));
    if (view_.recent->missed > 0)
      line.add(formatted("   %llu ticks not seen", count(view_.recent->missed)), Tone::kWarn);
  }
  lines.push_back(std::move(line));
}

void HapticLines::add_jitter(Lines& lines) const {
  if (!view_.recent) return;
  const JitterBins& bins = view_.recent->jitter;
  const std::uint64_t most = *std::max_element(bins.begin(), bins.end());
  const auto ticks = static_cast<double>(std::max<std::uint64_t>(1, view_.recent->ticks));
  if (detail_ == Detail::kRoomy) {
    const std::size_t width = std::min<std::size_t>(columns(38), 60);
    for (std::size_t bin = 0; bin < bins.size(); ++bin) {
      const double share = static_cast<double>(bins[bin]) / ticks;
      ViewLine line((bin == 0 ? "  jitter " : "         ") + formatted("%6s", edge_text(bin).c_str()) +
                    (bin < 7 ? " us " : "    "));
      line.add(share_bar(share, width, style_.utf8), jitter_tone(bin, bins[bin]));
      line.add(formatted(" %7.3f %%", 100.0 * share)).add(formatted(" %6llu", count(bins[bin])), Tone::kDim);
      if (bin == 0) line.add(" last 10 s", Tone::kDim);
      lines.push_back(std::move(line));
    }
    return;
  }
  // One line: heights are logarithmic, so that a single late tick among ten thousand is seen.
  const bool narrow = style_.width > 0 && style_.width < 76;
  ViewLine line(std::string(narrow ? "  jitter us " : "  jitter    "));
  for (std::size_t bin = 0; bin < bins.size(); ++bin) {
    std::string label = edge_text(bin);
    if (narrow) label = bin == 7 ? "1m" : bin == 8 ? "2m" : bin == 9 ? ">" : label.substr(1);
    const double share =
        bins[bin] == 0 ? 0.0
                       : std::log2(1.0 + static_cast<double>(bins[bin])) / std::log2(1.0 + static_cast<double>(most));
    line.add(label, Tone::kDim);
    line.add(share_mark(share, style_.utf8) + (narrow ? "" : " "), jitter_tone(bin, bins[bin]));
  }
  line.add(narrow ? " log" : "us log", Tone::kDim);
  lines.push_back(std::move(line));
}

void HapticLines::add_compute(Lines& lines) const {
  if (!view_.stats) return;
  const rtbus::LoopStats& stats = *view_.stats;
  const Units& units = style_.units;
  ViewLine line("  compute   p50 " + units.latency(stats.compute_p50_us * 1e-6));
  line.add("  p99 " + units.latency(stats.compute_p99_us * 1e-6));
  line.add("  max " + units.latency(stats.compute_max_us * 1e-6) + " " + units.latency_unit());
  line.add("   device p50 " + units.latency(stats.device_p50_us * 1e-6));
  line.add("  p99 " + units.latency(stats.device_p99_us * 1e-6) + " " + units.latency_unit());
  lines.push_back(std::move(line));
  ViewLine age("  proxy age p50 " + units.age(stats.proxy_age_p50_ms * 1e-3));
  age.add("  p99 " + units.age(stats.proxy_age_p99_ms * 1e-3));
  age.add("  max " + units.age(stats.proxy_age_max_ms * 1e-3) + " " + units.age_unit());
  lines.push_back(std::move(age));
}

void HapticLines::add_force(Lines& lines) const {
  if (!view_.stats) return;
  const rtbus::LoopStats& stats = *view_.stats;
  const double limit_n = view_.info ? view_.info->force_limit_n : 0.0;
  // "now" is the RMS of the last fraction of a second; without two statistics it is the one since start.
  const double now_n = view_.force_n.value_or(stats.force_rms_n);
  ViewLine line(std::string("  force     "));
  line.add(limit_bar(now_n, stats.force_peak_n, limit_n, std::clamp<std::size_t>(columns(48), 10, 40), style_.utf8),
           force_tone(now_n, limit_n));
  line.add(formatted(" %s %s of %.1f N", view_.force_n ? "now" : "mean", newtons(now_n).c_str(), limit_n),
           force_tone(now_n, limit_n));
  line.add("  peak " + newtons(stats.force_peak_n)).add("  rms " + newtons(stats.force_rms_n) + " N");
  lines.push_back(std::move(line));
}

void HapticLines::add_force_curve(Lines& lines) const {
  if (!view_.recent || view_.recent->force_n.empty()) return;
  const std::vector<double>& all = view_.recent->force_n;
  const std::size_t width = columns(20), shown = std::min(width, all.size());
  double top_n = 0.0;
  for (const double force_n : std::span(all).last(shown)) {
    if (!std::isnan(force_n)) top_n = std::max(top_n, force_n);
  }
  // Noise of a free hand is not blown up to the full height.
  const double high_n = std::isfinite(top_n) ? std::max(top_n, 0.05) : 1.0;
  const std::size_t rows = detail_ == Detail::kRoomy ? 3 : 1;
  const auto curve = sparkline(all, 0.0, high_n, width, rows, style_.utf8);
  for (std::size_t row = 0; row < rows; ++row) {
    ViewLine line(margin());
    line.add(curve[row], Tone::kGood);
    if (row == 0) {
      line.add(formatted(" to %s N", newtons(top_n).c_str()), Tone::kDim);
      line.add(formatted(", %.0f s", static_cast<double>(width) * RecentSignals::kSlot_s), Tone::kDim);
    }
    lines.push_back(std::move(line));
  }
}

void HapticLines::add_position(Lines& lines) const {
  if (!view_.device) return;
  const rtbus::Vec3& p = view_.device->position_m;
  const rtbus::Vec3& v = view_.device->velocity_m_s;
  std::string pressed;
  for (unsigned i = 0; i < 32; ++i) {
    if ((view_.device->buttons >> i & 1u) != 0) pressed += " " + std::to_string(i);
  }
  const Units& units = style_.units;
  ViewLine line("  position  x " + units.length(p[0]) + "  y " + units.length(p[1]) + "  z " + units.length(p[2]) +
                " " + units.length_unit());
  const bool on = view_.device->enabled != 0;
  line.add(on            ? "   forces on"
           : view_.estop ? "   forces OFF: E-STOP"
                         : "   forces OFF",
           on ? Tone::kPlain : Tone::kWarn);
  line.add(formatted("   speed %.3f m/s", norm_of(v)));
  line.add("   buttons" + (pressed.empty() ? std::string(" -") : pressed));
  lines.push_back(std::move(line));
}

void HapticLines::add_position_curves(Lines& lines) const {
  if (!view_.recent || view_.recent->position_m.empty()) return;
  const std::vector<rtbus::Vec3>& all = view_.recent->position_m;
  const bool tall = detail_ == Detail::kRoomy;
  const std::size_t width = tall ? columns(20) : std::max<std::size_t>(4, columns(27) / 3);
  ViewLine line(margin());
  for (std::size_t axis = 0; axis < 3; ++axis) {
    std::vector<double> values(all.size());
    std::transform(all.begin(), all.end(), values.begin(), [&](const rtbus::Vec3& p) { return p[axis]; });
    double low_m = std::numeric_limits<double>::infinity(), high_m = -low_m;
    for (const double value_m : std::span(values).last(std::min(width, values.size()))) {
      if (!std::isfinite(value_m)) continue;
      low_m = std::min(low_m, value_m);
      high_m = std::max(high_m, value_m);
    }
    const double span_m = high_m >= low_m ? high_m - low_m : 0.0;
    // Less than a tenth of a millimetre is rest: drawn as a line, not as mountains.
    const double shown_m = std::max(span_m, 1e-4);
    const std::string curve = sparkline(values, low_m, low_m + shown_m, width, 1, style_.utf8).front();
    const std::string span_text = style_.units.si ? formatted("%.4f", span_m) : formatted("%.1f", span_m * 1e3);
    if (tall) line = ViewLine(margin());
    line.add(formatted("%c", "xyz"[axis]), Tone::kDim).add(curve);
    if (tall) {
      line.add(" moved " + span_text + " " + style_.units.length_unit(), Tone::kDim);
      lines.push_back(line);
    } else {
      line.add(formatted(" %-6s ", span_text.c_str()), Tone::kDim);
    }
  }
  if (!tall) {
    line.add(style_.units.length_unit(), Tone::kDim);
    lines.push_back(std::move(line));
  }
}

void HapticLines::add_energy(Lines& lines) const {
  if (!view_.stats) return;
  const rtbus::LoopStats& stats = *view_.stats;
  // Made energy is what passivity must prevent: say it in words, the sign alone is easily overlooked.
  const bool made = stats.energy_absorbed_j < 0.0;
  ViewLine line(std::string("  energy    "));
  line.add(formatted("%s %.2g J %s the hand", made ? "MADE" : "absorbed", std::abs(stats.energy_absorbed_j),
                     made ? "against" : "from"),
           made ? Tone::kWarn : Tone::kPlain);
  line.add(formatted("   %.2g J removed by passivity", stats.energy_removed_j));
  lines.push_back(std::move(line));
}

void HapticLines::add_safety(Lines& lines) const {
  if (!view_.stats) return;
  const rtbus::LoopStats& stats = *view_.stats;
  struct Stage {
    const char* name;
    std::uint64_t ticks;
    bool serious;
  };
  // The serious ones first: what a narrow window leaves out stands last.
  const Stage stages[] = {{"nonfinite", stats.nonfinite, true},      {"device_lost", stats.device_lost, true},
                          {"overspeed", stats.overspeed, true},      {"stale", stats.stale_ticks, false},
                          {"thermal", stats.thermal_limited, false}, {"clamped", stats.clamped, false},
                          {"slew", stats.slew_limited, false},       {"passivity", stats.passivity_ticks, false}};
  ViewLine line(std::string("  safety    "));
  bool any = false;
  for (const Stage& stage : stages) {
    if (stage.ticks == 0) continue;
    line.add(formatted("%s%s %llu", any ? "  " : "", stage.name, count(stage.ticks)),
             stage.serious ? Tone::kWarn : Tone::kPlain);
    any = true;
  }
  line.add(any ? " ticks" : "nothing acted");
  if (stats.losses > 0) line.add(formatted("   physics lost %llu x", count(stats.losses)), Tone::kWarn);
  if (stats.pauses > 0) line.add(formatted("   loop stood %llu x", count(stats.pauses)), Tone::kWarn);
  lines.push_back(std::move(line));
}

void HapticLines::add_link(Lines& lines) const {
  if (!view_.link) return;
  const rtbus::LinkStats& link = *view_.link;
  const auto state = static_cast<rtbus::LinkState>(link.state);
  const bool bad = state == rtbus::LinkState::kLost || state == rtbus::LinkState::kOpening;
  ViewLine line(std::string("  link  "));
  line.add(rtbus::to_string(state), state == rtbus::LinkState::kRunning ? Tone::kGood : bad ? Tone::kBad : Tone::kWarn);
  line.add(formatted("  exchanges %llu", count(link.exchanges)));
  line.add(formatted("  unanswered %llu", count(link.silences)), link.silences > 0 ? Tone::kWarn : Tone::kPlain);
  line.add(formatted("  late %llu", count(link.late_forces)));
  line.add(formatted("  bad %llu", count(link.bad_frames + link.line_errors)));
  if (link.withheld > 0) line.add(formatted("  withheld %llu", count(link.withheld)), Tone::kWarn);
  if (link.losses > 0) line.add(formatted("  lost %llu x", count(link.losses)), Tone::kWarn);
  const Units& units = style_.units;
  line.add("  to wire p50 " + units.latency(link.sample_to_wire_p50_us * 1e-6));
  line.add(" p99 " + units.latency(link.sample_to_wire_p99_us * 1e-6) + " " + units.latency_unit());
  lines.push_back(std::move(line));
}

void HapticLines::add_cut(Lines& lines) const {
  ViewLine line(std::string("  last cut  "));
  if (view_.estop) {
    line.add("E-STOP", Tone::kBad);
    line.add((view_.estop->empty() ? "" : " (" + *view_.estop + ")") + ", zero force until re-armed");
    lines.push_back(std::move(line));
    return;
  }
  if (view_.recent && view_.recent->cut) {
    const CutView& cut = *view_.recent->cut;
    line.add(cut_text(cut.bits), cut.ongoing ? Tone::kBad : Tone::kWarn);
    line.add(cut.ongoing ? formatted("  NOW, for %.1f s", cut.began_ago_s)
                         : formatted("  %.1f s ago, for %.3f s", cut.began_ago_s, cut.lasted_s),
             cut.ongoing ? Tone::kBad : Tone::kPlain);
  } else if (view_.loss_age_s) {
    line.add("physics lost", Tone::kWarn).add(formatted("  %.0f s ago", *view_.loss_age_s));
  } else {
    line.add(view_.recent ? "none since this monitor looks" : "not followed", Tone::kDim);
  }
  lines.push_back(std::move(line));
}

std::string cut_text(std::uint32_t bits) {
  const std::pair<std::uint32_t, const char*> reasons[] = {
      {haptic::kEstop, "E-STOP, until re-armed"}, {haptic::kNonfinite, "a force that is no number"},
      {haptic::kDeviceLost, "device lost"},       {haptic::kOverspeed, "overspeed"},
      {haptic::kStale, "physics lost or silent"}, {haptic::kDisabled, "forces not enabled"}};
  std::string text;
  for (const auto& [bit, reason] : reasons) {
    if ((bits & bit) != 0) text += (text.empty() ? "" : ", ") + std::string(reason);
  }
  return text;
}

}  // namespace tools
