#include "tools/evaluation/overhead/overhead.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <fstream>
#include <limits>
#include <vector>

#include "tools/cli/common/gnuplot.hpp"
#include "tools/evaluation/overhead/overhead_parts.hpp"

namespace tools {

namespace {

std::string text_of(const Spread& spread, const char* pattern) {
  if (!std::isfinite(spread.median)) return "-";
  char text[3][32];
  int i = 0;
  for (const double value : {spread.median, spread.low, spread.high}) {
    std::snprintf(text[i++], sizeof text[0], pattern, value);
  }
  return std::string(text[0]) + " [" + text[1] + "…" + text[2] + "]";
}

double libraries(const LiveFigures& f) { return static_cast<double>(f.libraries.size()); }
double processes(const LiveFigures& f) { return f.processes; }
double threads(const LiveFigures& f) { return static_cast<double>(f.threads.size()); }
double topics(const LiveFigures& f) { return static_cast<double>(f.topics_hz.size()); }
double shm_kib(const LiveFigures& f) { return static_cast<double>(f.shm_bytes) / 1024.0; }
double rss_mib(const LiveFigures& f) { return f.rss_mib; }
double tick_ns(const LiveFigures& f) { return f.tick_ns; }
double step_ms(const LiveFigures& f) { return 1e-3 * f.step_us; }
double cpu_percent(const LiveFigures& f) { return 100.0 * f.cpu_s_per_s; }

void add_tables(const std::vector<OverheadPart>& parts, int rounds, Experiment& experiment) {
  Table things{"overhead_things",
               {"session", "part", "libraries", "processes", "threads", "topics", "shm [KiB]", "resident [MiB]"},
               {}};
  Table time{"overhead_time",
             {"session", "part left out", "tick [ns]", "saves [ns]", "step [ms]", "saves [ms]", "saves [% of a core]"},
             {}};
  for (const OverheadPart& part : parts) {
    if (!part.absent.empty()) {
      things.rows.push_back({part.session, part.name, part.absent, "", "", "", "", ""});
      time.rows.push_back({part.session, part.name, part.absent, "", "", "", ""});
      continue;
    }
    std::vector<Cell> row{part.session, part.name};
    for (const auto& [figure, pattern] : {std::pair<LiveFigure, const char*>{libraries, "%.0f"},
                                          {processes, "%.0f"},
                                          {threads, "%.0f"},
                                          {topics, "%.0f"},
                                          {shm_kib, "%.0f"},
                                          {rss_mib, "%.1f"}}) {
      char text[64];
      const double base = left_out(part, figure).median, more = saving(part, figure).median;
      std::snprintf(text, sizeof text, (std::string(pattern) + " + " + pattern).c_str(), base, more);
      row.emplace_back(std::string(text));
    }
    things.rows.push_back(std::move(row));
    const bool has_steps = left_out(part, step_ms).median > 0.0;
    time.rows.push_back({part.session, part.name, text_of(left_out(part, tick_ns), "%.0f"),
                         text_of(saving(part, tick_ns), "%+.0f"),
                         has_steps ? text_of(left_out(part, step_ms), "%.3f") : std::string("no physics"),
                         text_of(saving(part, step_ms), "%+.3f"), text_of(saving(part, cpu_percent), "%+.1f")});
  }
  experiment.add_table(std::move(things));
  experiment.add_table(std::move(time));
  for (const OverheadPart& part : parts) {
    if (!part.absent.empty() || part.with.size() == static_cast<std::size_t>(rounds)) continue;
    experiment.note(part.session + ", " + part.name + ": only " + std::to_string(part.with.size()) + " of " +
                    std::to_string(rounds) + " pairs ran through");
  }
  experiment.note(
      "things: left out + what the part adds (median of the pairs); time: median [least…most] of the pairs; where a "
      "part "
      "has no meaning stands why");
  experiment.note(
      "passivity is in every session and cannot be left out of one: table overhead_passivity prices it on the ticks of "
      "the "
      "harness");
}

void draw(const std::vector<OverheadPart>& all, Experiment& experiment) {
  std::vector<OverheadPart> parts;
  std::copy_if(all.begin(), all.end(), std::back_inserter(parts),
               [](const OverheadPart& part) { return part.absent.empty(); });
  const auto gnuplot = Gnuplot::find();
  if (!gnuplot) {
    experiment.note("no figure: gnuplot is not installed");
    return;
  }
  std::ofstream tsv(experiment.folder() / "overhead.tsv");
  tsv << "# row\tpart\ttick_ns\tlow\thigh\tstep_ms\tlow\thigh\trss_mib\tlow\thigh\n";
  for (std::size_t i = 0; i < parts.size(); ++i) {
    const OverheadPart& part = parts[i];
    tsv << parts.size() - i << "\t\"" << part.session << ": " << part.name << '"';
    for (const auto& figure : {LiveFigure(tick_ns), LiveFigure(step_ms), LiveFigure(rss_mib)}) {
      const Spread s = saving(part, figure);
      tsv << '\t' << s.median << '\t' << s.low << '\t' << s.high;
    }
    tsv << '\n';
  }
  tsv.close();
  const std::string rows = std::to_string(parts.size());
  const auto panel = [&](int column, const LiveFigure& value, const char* label, const char* colour,
                         const char* pattern, bool names) {
    double low = 0.0, high = 0.0;
    for (const OverheadPart& part : parts) {
      const Spread s = saving(part, value);
      if (!std::isfinite(s.median)) continue;
      low = std::min(low, s.low);
      high = std::max(high, s.high);
    }
    const double span = std::max(high - low, 1e-3);
    char range[80];
    std::snprintf(range, sizeof range, "set xrange [%g:%g]\n", low - 0.06 * span,
                  high + 0.45 * span);  // figures fit in
    const std::string c = std::to_string(column), to = std::to_string(column + 2);
    const std::string right = "$" + to;
    std::string text = std::string("set xlabel '") + label + "'\n" + range;
    text += names ? "set ytics nomirror scale 0\n" : "set format y ''\n";
    text += "plot 'overhead.tsv' using (0):1:(0):" + c + ":($1-0.28):($1+0.28)" + (names ? ":ytic(2)" : "") +
            " with boxxyerror fs solid 0.75 " + "noborder lc rgb '" + colour + "' notitle, '' using " + c +
            ":1:" + std::to_string(column + 1) + ":" + to +
            " with xerrorbars pt 0 lw 1.5 lc rgb '#202020' notitle, '' using (" + right + " > 0 ? " + right +
            " : 0):1:(sprintf('" + pattern + "', $" + c + ")) with labels left offset 0.8,0 tc rgb '#202020' notitle\n";
    return text;
  };
  Figure figure{"overhead", "", 1500, 120 + 62 * static_cast<int>(parts.size())};
  figure.body =
      "set multiplot title 'What leaving a part out saves: median of the pairs, whiskers from least to most'\n"
      "set grid x lt 1 lw 0.5 lc rgb '#d0d0d0'\nset border 3 lc rgb '#606060'\nset tics nomirror\nset yrange [0.4:" +
      rows +
      ".6]\nset bmargin 4\nset tmargin 3\nset xtics autofreq\nset xtics rotate by 0\n"
      "set lmargin at screen 0.19\nset rmargin at screen 0.44\n" +
      panel(3, tick_ns, "haptic cycle [ns]", "#4393c3", "%+.0f ns", true) +
      "set lmargin at screen 0.47\nset rmargin at screen 0.71\n" +
      panel(6, step_ms, "physics step [ms]", "#762a83", "%+.2f ms", false) +
      "set lmargin at screen 0.74\nset rmargin at screen 0.98\n" +
      panel(9, rss_mib, "resident memory [MiB]", "#1b7837", "%+.1f MiB", false) + "unset multiplot\n";
  auto drawn = gnuplot->draw(experiment.folder(), figure);
  if (!drawn) {
    experiment.note("no figure: " + drawn.error());
    return;
  }
  for (const auto& file : *drawn) experiment.add_figure(file);
}

/// What a part that is left out may not have, and one that is forced on must.
void check_part(const OverheadPart& part, Experiment& experiment) {
  std::string id = "overhead." + part.session + "." + part.name.substr(0, part.name.find(" ("));
  std::replace(id.begin(), id.end(), ' ', '_');
  const std::string what = part.session + ", " + part.name;
  const auto most = [](const std::vector<LiveFigures>& runs, const LiveFigure& figure) {
    double value = runs.empty() ? std::numeric_limits<double>::quiet_NaN() : 0.0;
    for (const LiveFigures& run : runs) value = std::max(value, figure(run));
    return value;
  };
  const auto least = [](const std::vector<LiveFigures>& runs, const LiveFigure& figure) {
    double value = runs.empty() ? std::numeric_limits<double>::quiet_NaN() : std::numeric_limits<double>::infinity();
    for (const LiveFigures& run : runs) value = std::min(value, figure(run));
    return value;
  };
  const auto gone_and_there = [&](const char* suffix, const std::string& of, const LiveFigure& count) {
    experiment.check_at_most(id + "." + suffix + ".left_out", what + " left out: " + of, most(part.without, count), "1",
                             0.0);
    if (!part.absent.empty()) return;
    experiment.check_at_least(id + "." + suffix + ".forced_on", what + " forced on: " + of, least(part.with, count),
                              "1", 1.0);
  };
  const PartSigns& signs = part.signs;
  if (!signs.library.empty()) {
    gone_and_there("library", "libraries named " + signs.library,
                   [&](const LiveFigures& f) { return static_cast<double>(f.libraries_named(signs.library)); });
  }
  if (!signs.thread.empty()) {
    gone_and_there("thread", "threads named " + signs.thread,
                   [&](const LiveFigures& f) { return static_cast<double>(f.threads_named(signs.thread)); });
  }
  if (!signs.topic.empty()) {
    gone_and_there("topic", "topics " + signs.topic,
                   [&](const LiveFigures& f) { return static_cast<double>(f.topics_hz.count(signs.topic)); });
  }
  if (!signs.silent_topic.empty()) {
    const LiveFigure rate = [&](const LiveFigures& f) {
      const auto found = f.topics_hz.find(signs.silent_topic);
      return found == f.topics_hz.end() ? 0.0 : found->second;
    };
    experiment.check_at_most(id + ".silent", what + " left out: samples of " + signs.silent_topic,
                             most(part.without, rate), "Hz", 0.0);
    experiment.check_between(id + ".heard", what + " forced on: samples of " + signs.silent_topic,
                             most(part.with, rate), "Hz", signs.low_hz, signs.high_hz);
  }
  if (signs.process) {
    const Spread more = saving(part, processes), more_threads = saving(part, threads);
    experiment.check_between(id + ".processes", what + " left out: processes fewer", more.median, "1", 1.0, 1.0);
    experiment.check_between(id + ".threads", what + " left out: threads fewer", more_threads.median, "1", 1.0, 10.0);
  }
  if (signs.step_ratio > 0.0) {
    const Spread without = left_out(part, step_ms), more = saving(part, step_ms);
    experiment.check_at_least(id + ".ratio", what + ": step with it over step without",
                              (without.median + more.median) / without.median, "1", signs.step_ratio);
  }
}

}  // namespace

void evaluate_overhead(const OverheadOptions& options, Experiment& experiment) {
  check_overhead_bits(options, experiment);
  OverheadPlan plan = overhead_plan(options);
  measure_parts(plan, options);
  for (const OverheadPart& part : plan.parts) check_part(part, experiment);
  add_tables(plan.parts, options.rounds, experiment);
  draw(plan.parts, experiment);
}

}  // namespace tools
