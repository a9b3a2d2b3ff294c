// The report of a run for people. The figures and their names are those of report.cpp.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <string>
#include <utility>
#include <vector>

#include "rtbus/why_behind.hpp"
#include "tools/cli/common/text_table.hpp"
#include "tools/cli/run/report.hpp"

namespace tools {

namespace {

/// Three figures: 0.0123, 1.23, 12.3, 123, 12345.
std::string figure(double value) {
  if (value == 0.0) return "0";
  char text[32];
  std::snprintf(text, sizeof text, std::abs(value) >= 100.0 ? "%.0f" : "%.3g", value);
  return text;
}

std::string share(std::uint64_t part, std::uint64_t whole) {
  if (whole == 0) return "-";
  const double percent = 100.0 * static_cast<double>(part) / static_cast<double>(whole);
  return (part == 0 ? "0" : fixed(percent, percent < 0.1 ? 4 : 2)) + " %";
}

/// "  name          value": one line of a block.
void line(std::string& out, const std::string& name, const std::string& value) {
  out += "  " + name + std::string(name.size() < 14 ? 14 - name.size() : 1, ' ') + value + '\n';
}

std::string percentiles(double p50, double p99, double max, const char* unit) {
  return "p50 " + figure(p50) + ", p99 " + figure(p99) + ", max " + figure(max) + " " + unit;
}

std::string cost_text(const ProcessCost& cost, double duration_s) {
  std::string text = fixed(cost.rss_mib, 1) + " MiB resident, " + std::to_string(cost.threads) + " threads";
  if (duration_s > 0.0) text += ", " + figure(100.0 * cost.cpu_s / duration_s) + " % of a core";
  return text;
}

std::string safety_text(const rtbus::LoopStats& s) {
  const std::array<std::pair<const char*, std::uint64_t>, 8> ticks{{{"clamped", s.clamped},
                                                                    {"slew limited", s.slew_limited},
                                                                    {"stale", s.stale_ticks},
                                                                    {"not finite", s.nonfinite},
                                                                    {"overspeed", s.overspeed},
                                                                    {"thermally limited", s.thermal_limited},
                                                                    {"damped for passivity", s.passivity_ticks},
                                                                    {"device lost", s.device_lost}}};
  const std::array<std::pair<const char*, std::uint64_t>, 2> times{
      {{"losses of physics", s.losses}, {"pauses of the loop", s.pauses}}};
  std::string text;
  const auto add = [&](const char* name, std::uint64_t count, const char* unit) {
    if (count > 0) text += (text.empty() ? "" : ", ") + std::string(name) + " " + std::to_string(count) + unit;
  };
  for (const auto& [name, count] : ticks) add(name, count, " ticks");
  for (const auto& [name, count] : times) add(name, count, "");
  return text.empty() ? "nothing was cut" : text;
}

std::string link_text(const rtbus::LinkStats& link) {
  const auto us = [](double value) { return fixed(value, 0); };
  return std::to_string(link.exchanges) + " exchanges, " + std::to_string(link.silences) + " without answer, " +
         std::to_string(link.late_forces) + " late forces, " + std::to_string(link.bad_frames) + " bad, " +
         std::to_string(link.line_errors) + " line errors, " + std::to_string(link.losses) +
         " losses; sample to wire p50 " + us(link.sample_to_wire_p50_us) + ", p99 " + us(link.sample_to_wire_p99_us) +
         " us";
}

/// The haptic loop and the bare loop, one above the other, so that the eye compares.
void add_loops(std::string& out, const HapticFigures& haptic, const BareLoopFigures* bare) {
  using enum TextTable::Align;
  TextTable table({{"", kLeft},
                   {"served", kRight},
                   {"due", kRight},
                   {"overruns", kRight},
                   {"", kRight},
                   {"wake-up us: p50", kRight},
                   {"p99", kRight},
                   {"p99.9", kRight},
                   {"max", kRight}});
  const rtbus::LoopStats& s = haptic.stats;
  const auto us = [](double value) { return fixed(value, value < 100.0 ? 1 : 0); };
  table.add({"haptic loop", std::to_string(s.ticks), std::to_string(s.ticks_due), std::to_string(s.overruns),
             share(s.overruns, s.ticks_due), us(s.wakeup_p50_us), us(s.wakeup_p99_us), us(s.wakeup_p999_us),
             us(s.wakeup_max_us)});
  if (bare != nullptr) {
    table.add({"bare loop", std::to_string(bare->ticks), std::to_string(bare->due), std::to_string(bare->overruns),
               share(bare->overruns, bare->due), us(bare->wakeup_p50_us), us(bare->wakeup_p99_us),
               us(bare->wakeup_p999_us), us(bare->wakeup_max_us)});
  }
  for (const std::string& row : table.lines()) out += "  " + row + '\n';
  if (bare != nullptr && bare->scheduling != rtbus::text_of(haptic.info.scheduling)) {
    line(out, "note",
         "the bare loop ran with " + bare->scheduling + ", the haptic loop with " +
             rtbus::text_of(haptic.info.scheduling) + ": they do not compare");
  }
}

void add_haptic(std::string& out, const RunReport& report, const HapticFigures& haptic) {
  const rtbus::LoopStats& s = haptic.stats;
  out += '\n' + haptic.name + ": " + rtbus::text_of(haptic.info.kind) + ", " + rtbus::text_of(haptic.info.method) +
         " at " + figure(haptic.info.rate_hz) + " Hz, clock " + rtbus::text_of(haptic.info.clock) + ", " +
         rtbus::text_of(haptic.info.realtime) + '\n';
  const bool has_bare = report.bare_loop && report.bare_loop->beside == haptic.name;
  add_loops(out, haptic, has_bare ? &*report.bare_loop : nullptr);
  line(out, "compute", percentiles(s.compute_p50_us, s.compute_p99_us, s.compute_max_us, "us"));
  line(out, "device", percentiles(s.device_p50_us, s.device_p99_us, s.device_max_us, "us"));
  if (haptic.needs_physics) {
    line(out, "proxy age", percentiles(s.proxy_age_p50_ms, s.proxy_age_p99_ms, s.proxy_age_max_ms, "ms"));
  }
  if (s.corrections > 0) {
    line(out, "correction",
         "mean " + figure(s.correction_mean_mm) + ", max " + figure(s.correction_max_mm) + " mm in " +
             std::to_string(s.corrections) + " answers while touching");
  }
  line(out, "force",
       "rms " + figure(s.force_rms_n) + ", peak " + figure(s.force_peak_n) + " N of " +
           figure(haptic.info.force_limit_n) + " N");
  if (haptic.error) {
    line(out, "staleness",
         "force error rms " + figure(haptic.error->force_n.rms()) + ", peak " + figure(haptic.error->force_n.peak) +
             " N; proxy error rms " + figure(1e3 * haptic.error->position_m.rms()) + ", peak " +
             figure(1e3 * haptic.error->position_m.peak) + " mm");
  }
  line(out, "energy",
       figure(1e3 * s.energy_absorbed_j) + " mJ absorbed from the hand, at worst " +
           figure(1e3 * haptic.generated_peak_j) + " mJ given; " + figure(1e3 * s.energy_removed_j) +
           " mJ removed by the passivity damper");
  line(out, "safety", safety_text(s));
  if (haptic.link) line(out, "link", link_text(*haptic.link));
  line(out, "process", cost_text(haptic.cost, report.duration_s));
  line(out, "left out", rtbus::text_of(haptic.info.left_out));
  if (haptic.missed_by_observer > 0) {
    line(out, "observer",
         "missed " + std::to_string(haptic.missed_by_observer) + " of " +
             std::to_string(haptic.missed_by_observer + haptic.observed_ticks) +
             " ticks: staleness and figures are without them");
  }
}

constexpr double kKeepsUp = 0.99;  // of real time

/// The two sums of Newton's third law. A single second may differ for reasons that are no error: they are told only
/// where it matters.
std::string momentum_text(const ImpulseBalance::Figures& impulse) {
  constexpr double kWorthTelling = 0.1;
  std::string text = figure(impulse.hand_n_s) + " N s on the hand, " + figure(impulse.world_n_s) +
                     " N s on the world, over " + std::to_string(impulse.windows) + " s of contact";
  if (impulse.worst > kWorthTelling) {
    text += "; in one of these seconds they differ by " + figure(100.0 * impulse.worst) +
            " %: normal where contact begins or ends in it, or where a late proxy drags";
  }
  return text;
}

std::string share_of_real_time(const rtbus::StepStats& s) { return fixed(100.0 * s.simulated_s / s.wall_s, 1) + " %"; }

void add_physics(std::string& out, const PhysicsFigures& physics, double duration_s) {
  const rtbus::StepStats& s = physics.stats;
  out += "\nphysics: engine " + rtbus::text_of(physics.info.kind) + ", " + rtbus::text_of(physics.info.clock) + " at " +
         figure(s.rate_hz) + " Hz, " + std::to_string(s.bodies) + (s.bodies == 1 ? " body" : " bodies") + '\n';
  line(out, "steps",
       std::to_string(s.steps) + " of " + std::to_string(s.due) + " due, " + std::to_string(s.late) +
           " late, at last " + figure(s.achieved_hz) + " Hz");
  if (s.wall_s > 0.0 && s.simulated_s < kKeepsUp * s.wall_s) {
    line(out, rtbus::steps_fit(s) ? "BEHIND" : "TOO SLOW",
         "simulated time ran at " + share_of_real_time(s) +
             " of real time: " + rtbus::why_behind(s, rtbus::text_of(physics.info.kind)));
  }
  line(out, "step", percentiles(s.step_p50_ms, s.step_p99_ms, s.step_max_ms, "ms"));
  for (const ProxyFigures& proxy : physics.proxies) {
    line(out, "proxy",
         proxy.device + ": in contact " + share(proxy.in_contact, proxy.published) + ", contact force rms " +
             figure(proxy.contact_n.rms()) + ", peak " + figure(proxy.contact_n.peak) + " N");
    if (proxy.impulse.windows > 0) line(out, "momentum", momentum_text(proxy.impulse));
  }
  line(out, "process", cost_text(physics.cost, duration_s));
  line(out, "left out", rtbus::text_of(physics.info.left_out));
}

}  // namespace

std::string to_text(const RunReport& report) {
  const MachineFacts& machine = report.machine;
  std::string out = report.session + ": " + report.config + ", scene " + report.scene + ", " +
                    fixed(report.duration_s, 1) + " s (" + fixed(report.wall_s, 1) + " s with start and end)\n";
  out += machine.cpu + ", " + std::to_string(machine.cores) + " cores" +
         (machine.virtualization.empty() ? "" : " (" + machine.virtualization + ")") + ", " + machine.kernel + ", " +
         machine.preemption + '\n';
  for (const HapticFigures& haptic : report.haptic) add_haptic(out, report, haptic);
  if (report.physics) add_physics(out, *report.physics, report.duration_s);
  out += "\nbus: " + std::to_string(report.topics.size()) + " topics, " + human_bytes(report.shm_bytes) +
         " of shared memory\n";
  for (const RestartFigures& restart : report.restarts) {
    out += "restarted: " + restart.node + " " + restart.how + " at " + fixed(restart.at_s, 2) + " s, started again " +
           fixed(restart.delay_s, 2) + " s later; its counters are those since then\n";
  }
  for (const std::string& warning : report.warnings) out += "WARNING: " + warning + '\n';
  for (const std::string& fault : report.faults) out += "FAULT: " + fault + '\n';
  return out;
}

}  // namespace tools
