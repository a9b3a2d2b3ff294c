#include "tools/experiments/drop.hpp"

#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <fstream>
#include <optional>

#include "rtbus/clock.hpp"
#include "rtbus/messages.hpp"
#include "rtbus/topic.hpp"
#include "tools/gnuplot.hpp"
#include "tools/harness/harness.hpp"
#include "tools/interrupt.hpp"
#include "tools/supervisor.hpp"

namespace tools {

namespace {

/// Published: bounces for about 0.7 s, stays at about −2 mm (K = 200 N/m, B = 0.02 N·s/m).
constexpr double kPublishedSettling_s = 0.70;
constexpr double kTolerance = 0.15;
constexpr double kSettledBand_m = 0.2e-3;
constexpr double kReleaseStep_m = 0.05e-3;
/// A run in which the machine itself paused for longer says nothing about us.
constexpr double kMachinePause_ms = 5.0;
constexpr double kDuration_s = 4.5;

std::vector<rtbus::config::Override> overrides(const std::vector<std::string>& assignments) {
  std::vector<rtbus::config::Override> out;
  for (const std::string& text : assignments) out.push_back(rtbus::config::parse_override(text));
  return out;
}

void append(DropTrace& trace, const rtbus::Telemetry& tick, std::uint64_t& first_ns) {
  if (first_ns == 0) first_ns = tick.device_time_ns;
  trace.time_s.push_back(rtbus::seconds_between(first_ns, tick.device_time_ns));
  trace.height_m.push_back(tick.position_m[1]);
  trace.force_n.push_back(tick.force_n[1]);
  trace.worst_wakeup_ms = std::max(trace.worst_wakeup_ms, tick.wakeup_us * 1e-3);
}

DropTrace fall_in_harness(const DropOptions& options) {
  auto session = rtbus::config::load_session(options.session_file, overrides(options.assignments));
  Harness harness(session, {});
  DropTrace trace;
  std::uint64_t first_ns = 0;
  harness.run(kDuration_s, [&](const rtbus::Telemetry& tick) { append(trace, tick, first_ns); });
  return trace;
}

/// The real haptic_node, observed over the bus. nullopt when it could not be run; the reason is on stderr.
std::optional<DropTrace> fall_for_real(const DropOptions& options, int run) {
  rtbus::Session bus;
  bus.name = "drop-" + std::to_string(getpid()) + "-" + std::to_string(run);
  Supervisor supervisor([](const std::string&, std::string_view) {});
  ChildSpec spec{"haptic0",
                 Stage::kHaptic,
                 folder_of_this_program() + "/haptic_node",
                 {"--config", options.session_file, "--set", "session=" + bus.name}};
  for (const std::string& text : options.assignments) spec.arguments.insert(spec.arguments.end(), {"--set", text});
  if (auto started = supervisor.start(spec); !started) {
    std::fprintf(stderr, "%s\n", started.error().c_str());
    return std::nullopt;
  }
  DropTrace trace;
  std::uint64_t first_ns = 0;
  std::optional<rtbus::Reader<rtbus::Telemetry>> reader;
  const std::uint64_t end_ns = rtbus::monotonic_ns() + static_cast<std::uint64_t>((kDuration_s + 0.5) * 1e9);
  while (rtbus::monotonic_ns() < end_ns) {
    if (!sleep_unless_interrupted(20 * rtbus::kNsPerMs)) return std::nullopt;
    if (const auto end = supervisor.poll()) {
      std::fprintf(stderr, "haptic_node %s\n", end->how().c_str());
      for (const std::string& line : end->last_words) std::fprintf(stderr, "  %s\n", line.c_str());
      return std::nullopt;
    }
    if (!reader) {
      auto opened = rtbus::Reader<rtbus::Telemetry>::open(bus, "haptic0.telemetry", {.presence = true});
      if (opened) reader.emplace(std::move(*opened));
      continue;
    }
    rtbus::Stamped<rtbus::Telemetry> tick;
    while (reader->read_next(tick) == rtbus::ReadStatus::kFresh) append(trace, tick.value, first_ns);
  }
  return trace;
}

void write_trace(const std::filesystem::path& file, const DropTrace& trace) {
  std::ofstream out(file);
  out << "# time [s]\theight [mm]\tforce [N]\n";
  for (std::size_t i = 0; i < trace.time_s.size(); ++i) {
    out << trace.time_s[i] << '\t' << trace.height_m[i] * 1e3 << '\t' << trace.force_n[i] << '\n';
  }
}

/// Index of the last sample at the start height.
std::size_t release_index(const DropTrace& trace) {
  std::size_t i = 0;
  while (i + 1 < trace.height_m.size() && trace.height_m[i + 1] > trace.height_m.front() - kReleaseStep_m) ++i;
  return i;
}

void draw(Experiment& experiment, double harness_release_s, const std::optional<double>& real_release_s) {
  const auto gnuplot = Gnuplot::find();
  if (!gnuplot) {
    experiment.note("gnuplot is not there: no figure");
    return;
  }
  const auto shifted = [](const char* file, double release_s, int column, const char* style) {
    char text[256];
    std::snprintf(text, sizeof text, "'%s' using ($1-%.4f):%d with lines %s", file, release_s, column, style);
    return std::string(text);
  };
  std::string heights = shifted("drop_harness.tsv", harness_release_s, 2, "lw 2 title 'simulated clock'");
  std::string forces = shifted("drop_harness.tsv", harness_release_s, 3, "lw 2 title 'simulated clock'");
  if (real_release_s) {
    heights += ", " + shifted("drop_real.tsv", *real_release_s, 2, "lw 1 title 'real process'");
    forces += ", " + shifted("drop_real.tsv", *real_release_s, 3, "lw 1 title 'real process'");
  }
  Figure figure;
  figure.stem = "drop_direct";
  figure.body =
      "set multiplot layout 2,1 title 'Free fall onto the wall, direct rendering (paper, Fig. 8)'\n"
      "set grid\nset xrange [-0.1:1.6]\nset ylabel 'height [mm]'\nset key top right\n"
      "set arrow 1 from 0.70, graph 0 to 0.70, graph 1 nohead dt 2 lc rgb 'gray40'\n"
      "set label 1 'paper: settled after about 0.7 s' at 0.71, graph 0.85\n"
      "set arrow 2 from graph 0, first -2 to graph 1, first -2 nohead dt 2 lc rgb 'gray40'\n"
      "plot " +
      heights +
      "\n"
      "unset arrow 2\nunset label 1\nset xlabel 'time since release [s]'\nset ylabel 'force on the hand [N]'\n"
      "plot " +
      forces + "\nunset multiplot\n";
  auto drawn = gnuplot->draw(experiment.folder(), figure);
  if (!drawn) {
    experiment.note("no figure: " + drawn.error());
    return;
  }
  for (const auto& file : *drawn) experiment.add_figure(file);
}

}  // namespace

DropOutcome judge_drop(const DropTrace& trace) {
  DropOutcome out;
  if (trace.height_m.size() < 2 || trace.time_s.back() < 1.0) return out;
  const std::size_t release = release_index(trace);
  if (release + 1 >= trace.height_m.size()) return out;
  std::size_t tail = trace.time_s.size() - 1;
  while (tail > 0 && trace.time_s.back() - trace.time_s[tail] < 0.5) --tail;
  double sum = 0.0;
  for (std::size_t i = tail; i < trace.height_m.size(); ++i) sum += trace.height_m[i];
  out.rest_m = sum / static_cast<double>(trace.height_m.size() - tail);
  std::size_t settled = release;
  for (std::size_t i = release; i < trace.height_m.size(); ++i) {
    if (std::abs(trace.height_m[i] - out.rest_m) > kSettledBand_m) settled = i + 1;
    out.peak_force_n = std::max(out.peak_force_n, trace.force_n[i]);
  }
  out.fell = settled < tail;
  if (out.fell) out.settling_s = trace.time_s[settled] - trace.time_s[release];
  return out;
}

void evaluate_drop(const DropOptions& options, Experiment& experiment) {
  Table table{
      "drop_direct", {"run", "settling [s]", "rest [mm]", "peak force [N]", "worst wake-up [ms]", "counted"}, {}};
  table.rows.push_back({std::string("paper, Fig. 8"), 0.7, -2.0, std::string("-"), std::string("-"), std::string("-")});
  const auto add = [&](const std::string& name, const DropTrace& trace, const DropOutcome& outcome, bool counted) {
    table.rows.push_back({name, outcome.fell ? Cell(outcome.settling_s) : Cell(std::string("never")),
                          outcome.rest_m * 1e3, outcome.peak_force_n, trace.worst_wakeup_ms,
                          std::string(counted ? "yes" : "no")});
  };

  const DropTrace simulated = fall_in_harness(options);
  const DropOutcome in_harness = judge_drop(simulated);
  add("simulated clock", simulated, in_harness, true);
  write_trace(experiment.folder() / "drop_harness.tsv", simulated);

  std::vector<DropOutcome> real;
  std::optional<double> real_release_s;
  int paused = 0;
  for (int run = 1; run <= options.real_runs && !interrupted(); ++run) {
    std::fprintf(stderr, "drop: real process, run %d of %d (%.0f s)\n", run, options.real_runs, kDuration_s);
    const auto trace = fall_for_real(options, run);
    if (!trace) continue;
    const DropOutcome outcome = judge_drop(*trace);
    const bool counted = trace->worst_wakeup_ms <= kMachinePause_ms;
    add("real process, run " + std::to_string(run), *trace, outcome, counted);
    if (!counted) {
      ++paused;
      continue;
    }
    if (real.empty()) {
      write_trace(experiment.folder() / "drop_real.tsv", *trace);
      real_release_s = trace->time_s[release_index(*trace)];
    }
    real.push_back(outcome);
  }
  experiment.add_table(std::move(table));
  if (paused > 0)
    experiment.note(std::to_string(paused) + " run(s) not counted: the machine paused for more than 5 ms");

  const double low_s = kPublishedSettling_s * (1.0 - kTolerance);
  const double high_s = kPublishedSettling_s * (1.0 + kTolerance);
  // Weight over stiffness, give or take what friction and one encoder step can hold: (0.402 ± 0.06) N / 200 N/m.
  const double rest_low_mm = -2.01 - 0.30 - 0.023;
  const double rest_high_mm = -2.01 + 0.30 + 0.023;
  const double never = std::numeric_limits<double>::quiet_NaN();
  experiment.check_between("drop.direct.harness.settling", "settling, simulated clock",
                           in_harness.fell ? in_harness.settling_s : never, "s", low_s, high_s);
  experiment.check_between("drop.direct.harness.rest", "rest, simulated clock", in_harness.rest_m * 1e3, "mm",
                           rest_low_mm, rest_high_mm);
  if (options.real_runs > 0) {
    const auto median = [&](auto figure) {
      if (real.empty()) return never;
      std::vector<double> values;
      for (const DropOutcome& outcome : real) values.push_back(figure(outcome));
      std::sort(values.begin(), values.end());
      return values[values.size() / 2];
    };
    experiment.check_between("drop.direct.real.settling", "settling, real process (median)",
                             median([&](const DropOutcome& o) { return o.fell ? o.settling_s : HUGE_VAL; }), "s", low_s,
                             high_s);
    experiment.check_between("drop.direct.real.rest", "rest, real process (median)",
                             median([](const DropOutcome& o) { return o.rest_m * 1e3; }), "mm", rest_low_mm,
                             rest_high_mm);
  }
  draw(experiment, simulated.time_s[release_index(simulated)], real_release_s);
}

}  // namespace tools
