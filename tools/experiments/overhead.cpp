#include "tools/experiments/overhead.hpp"

#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <fstream>
#include <functional>
#include <limits>
#include <optional>
#include <vector>

#include "physics_node/engine_registry.hpp"
#include "physics_node/pose_publisher.hpp"
#include "tools/ask_kernel.hpp"
#include "tools/experiments/live_pair.hpp"
#include "tools/gnuplot.hpp"
#include "tools/harness/harness.hpp"
#include "tools/interrupt.hpp"

namespace tools {

namespace {

/// Something a session can do without.
struct Part {
  std::string session;
  std::string name;
  LiveVariant left_out, forced_on;
  std::vector<LiveFigures> without{}, with{};  ///< Pair by pair.
};

std::vector<Part> parts_of(const OverheadOptions& options) {
  const auto with = [](LiveVariant variant, const std::function<void(LiveVariant&)>& change) {
    change(variant);
    return variant;
  };
  const LiveVariant wall{options.wall_file, {}}, stack{options.stack_file, {}};
  const LiveVariant direct =
      with(wall, [](LiveVariant& v) { v.assignments = {"haptic.0.method=direct"}, v.physics = false; });
  const LiveVariant bullet = with(wall, [](LiveVariant& v) { v.assignments = {"physics.engine=bullet"}; });
  const LiveVariant plant = with(wall, [](LiveVariant& v) { v.assignments = {"haptic.0.device.process=own"}; });
  // No hand near the stack: it rests.
  const LiveVariant asleep =
      with(stack, [](LiveVariant& v) { v.assignments = {"haptic.0.mapping.offset_m=[0, 0.3, 0.3]"}; });
  const LiveVariant awake =
      with(asleep, [](LiveVariant& v) { v.assignments.emplace_back("scene.deactivation.enabled=false"); });
  const auto contacts = [](LiveVariant& v) { v.assignments.emplace_back("physics.contacts=on"); };
  const auto telemetry = [](LiveVariant& v) { v.observe_telemetry = true; };
  const auto poses = [](LiveVariant& v) { v.observe_poses = true; };
  return {{"wall", "Bullet", wall, bullet},
          {"wall", "physics process", direct, wall},
          {"wall", "plant process", wall, plant},
          {"wall", "telemetry", wall, with(wall, telemetry)},
          {"stack_125", "telemetry", stack, with(stack, telemetry)},
          {"stack_125", "body poses", stack, with(stack, poses)},
          {"stack_125", "contact constraints", stack, with(stack, contacts)},
          {"stack_125", "bodies at rest", asleep, awake}};
}

using Figure1 = std::function<double(const LiveFigures&)>;

struct Spread {
  double median = std::numeric_limits<double>::quiet_NaN(), low = median, high = median;
};

Spread spread_of(std::vector<double> values) {
  if (values.empty()) return {};
  std::sort(values.begin(), values.end());
  const std::size_t n = values.size();
  const double median = n % 2 == 1 ? values[n / 2] : 0.5 * (values[n / 2 - 1] + values[n / 2]);
  return {median, values.front(), values.back()};
}

Spread left_out(const Part& part, const Figure1& figure) {
  std::vector<double> values;
  for (const LiveFigures& each : part.without) values.push_back(figure(each));
  return spread_of(std::move(values));
}

/// Forced on minus left out, within each pair.
Spread saving(const Part& part, const Figure1& figure) {
  std::vector<double> values;
  for (std::size_t i = 0; i < part.with.size(); ++i) values.push_back(figure(part.with[i]) - figure(part.without[i]));
  return spread_of(std::move(values));
}

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
double threads(const LiveFigures& f) { return f.threads; }
double topics(const LiveFigures& f) { return static_cast<double>(f.topics); }
double shm_kib(const LiveFigures& f) { return static_cast<double>(f.shm_bytes) / 1024.0; }
double rss_mib(const LiveFigures& f) { return f.rss_mib; }
double tick_ns(const LiveFigures& f) { return f.tick_ns; }
double step_us(const LiveFigures& f) { return f.step_us; }
double cpu_percent(const LiveFigures& f) { return 100.0 * f.cpu_s_per_s; }

void measure(std::vector<Part>& parts, const OverheadOptions& options) {
  for (int round = 0; round < options.rounds; ++round) {
    for (Part& part : parts) {
      if (interrupted()) return;
      std::fprintf(stderr, "overhead: round %d of %d, %s, %s\n", round + 1, options.rounds, part.session.c_str(),
                   part.name.c_str());
      // Every second pair the other way round: a machine that slows down or warms up favours neither.
      std::optional<LiveFigures> without, with;
      if (round % 2 == 0) without = run_live(part.left_out, options.seconds);
      with = run_live(part.forced_on, options.seconds);
      if (round % 2 == 1) without = run_live(part.left_out, options.seconds);
      if (!without || !with) continue;
      part.without.push_back(*without);
      part.with.push_back(*with);
    }
  }
}

void add_tables(const std::vector<Part>& parts, int rounds, Experiment& experiment) {
  Table things{"overhead_things",
               {"session", "part", "libraries", "processes", "threads", "topics", "shm [KiB]", "resident [MiB]"},
               {}};
  Table time{"overhead_time",
             {"session", "part left out", "tick [ns]", "saves [ns]", "step [us]", "saves [us]", "saves [% of a core]"},
             {}};
  for (const Part& part : parts) {
    std::vector<Cell> row{part.session, part.name};
    for (const auto& [figure, pattern] : {std::pair<Figure1, const char*>{libraries, "%.0f"},
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
    const bool has_steps = left_out(part, step_us).median > 0.0;
    time.rows.push_back({part.session, part.name, text_of(left_out(part, tick_ns), "%.0f"),
                         text_of(saving(part, tick_ns), "%+.0f"),
                         has_steps ? text_of(left_out(part, step_us), "%.1f") : std::string("no physics"),
                         text_of(saving(part, step_us), "%+.1f"), text_of(saving(part, cpu_percent), "%+.1f")});
  }
  experiment.add_table(std::move(things));
  experiment.add_table(std::move(time));
  for (const Part& part : parts) {
    if (part.with.size() == static_cast<std::size_t>(rounds)) continue;
    experiment.note(part.session + ", " + part.name + ": only " + std::to_string(part.with.size()) + " of " +
                    std::to_string(rounds) + " pairs ran through");
  }
  experiment.note(
      "things: left out + what the part adds (median of the pairs); time: median [least…most] of the pairs");
}

void draw(const std::vector<Part>& parts, Experiment& experiment) {
  const auto gnuplot = Gnuplot::find();
  if (!gnuplot) {
    experiment.note("no figure: gnuplot is not installed");
    return;
  }
  std::ofstream tsv(experiment.folder() / "overhead.tsv");
  tsv << "# row\tpart\ttick_ns\tlow\thigh\tstep_us\tlow\thigh\trss_mib\tlow\thigh\n";
  for (std::size_t i = 0; i < parts.size(); ++i) {
    const Part& part = parts[i];
    tsv << parts.size() - i << "\t\"" << part.session << ": " << part.name << '"';
    for (const auto& figure : {Figure1(tick_ns), Figure1(step_us), Figure1(rss_mib)}) {
      const Spread s = saving(part, figure);
      tsv << '\t' << s.median << '\t' << s.low << '\t' << s.high;
    }
    tsv << '\n';
  }
  tsv.close();
  const std::string rows = std::to_string(parts.size());
  const auto panel = [&](int column, const Figure1& value, const char* label, const char* colour, const char* pattern,
                         bool names) {
    double low = 0.0, high = 0.0;
    for (const Part& part : parts) {
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
      panel(6, step_us, "physics step [us]", "#762a83", "%+.1f us", false) +
      "set lmargin at screen 0.74\nset rmargin at screen 0.98\n" +
      panel(9, rss_mib, "resident memory [MiB]", "#1b7837", "%+.1f MiB", false) + "unset multiplot\n";
  auto drawn = gnuplot->draw(experiment.folder(), figure);
  if (!drawn) {
    experiment.note("no figure: " + drawn.error());
    return;
  }
  for (const auto& file : *drawn) experiment.add_figure(file);
}

/// The hand has met the stack by then.
constexpr double kPushed_s = 6.0;

/// Fingerprint of the first seconds of a session under the simulated clock.
std::uint64_t fingerprint(const std::string& file, double seconds, const std::function<void(const Harness&)>& look = {},
                          const std::vector<std::string>& assignments = {}) {
  std::vector<rtbus::config::Override> overrides;
  for (const std::string& text : assignments) overrides.push_back(rtbus::config::parse_override(text));
  auto session = rtbus::config::load_session(file, overrides);
  Harness harness(session, {});
  for (double t = 0.0; t < seconds; t += 0.02) {
    harness.run(0.02, {});
    if (look) look(harness);
  }
  return harness.hash();
}

void check_bits(const OverheadOptions& options, Experiment& experiment) {
  const double same = 1.0;
  // The wall before and after Bullet has been mapped into this process.
  LiveFigures self;
  self.libraries = mapped_libraries(getpid());
  experiment.check_at_most("overhead.bits.bullet_before", "Bullet's libraries in this process so far",
                           static_cast<double>(self.libraries_named("bullet")), "1", 0.0);
  const std::uint64_t wall = fingerprint(options.wall_file, 3.0);
  const std::uint64_t stack = fingerprint(options.stack_file, kPushed_s);  // maps it
  experiment.check_between("overhead.bits.bullet", "wall: force bit-identical with Bullet mapped",
                           fingerprint(options.wall_file, 3.0) == wall ? 1.0 : 0.0, "1", same, same);
  experiment.check_between("overhead.bits.contacts", "stack_125: force bit-identical with contact constraints",
                           fingerprint(options.stack_file, kPushed_s, {}, {"physics.contacts=on"}) == stack ? 1.0 : 0.0,
                           "1", same, same);
  // Body poses on a real topic with a reader, against none.
  rtbus::Session bus;
  bus.name = "overhead-" + std::to_string(getpid());
  std::unique_ptr<physics::PosePublisher> poses;
  std::optional<rtbus::Reader<rtbus::BodyPoses>> reader;
  const std::uint64_t observed = fingerprint(options.stack_file, kPushed_s, [&](const Harness& harness) {
    if (!poses) {
      auto created = physics::PosePublisher::create(bus, harness.stepper()->world().bodies());
      if (!created) return;
      poses = std::move(*created);
      auto opened = rtbus::Reader<rtbus::BodyPoses>::open(bus, "physics.body_poses", {.presence = true});
      if (opened) reader.emplace(std::move(*opened));
    }
    poses->maintain();
    poses->publish_if_due(*harness.stepper(), rtbus::kNsPerS + static_cast<std::uint64_t>(harness.now_s() * 1e9));
  });
  rtbus::Stamped<rtbus::BodyPoses> sample;
  const bool seen = reader && reader->read_latest(sample) == rtbus::ReadStatus::kFresh;
  experiment.check_between("overhead.bits.poses_seen", "stack_125: frames of body poses seen in the harness",
                           seen ? static_cast<double>(sample.value.frame) : 0.0, "1", 100.0, 200.0);
  experiment.check_between("overhead.bits.poses", "stack_125: force bit-identical with body poses observed",
                           observed == stack ? 1.0 : 0.0, "1", same, same);
}

void check_parts(const std::vector<Part>& parts, Experiment& experiment) {
  for (const Part& part : parts) {
    const std::string id = "overhead." + part.session + "." + part.name.substr(0, part.name.find(' '));
    const auto most = [&](const std::vector<LiveFigures>& runs, const Figure1& figure) {
      double value = runs.empty() ? std::numeric_limits<double>::quiet_NaN() : 0.0;
      for (const LiveFigures& run : runs) value = std::max(value, figure(run));
      return value;
    };
    const std::string what = part.session + ", " + part.name;
    if (part.name == "Bullet") {
      const Figure1 maps = [](const LiveFigures& f) { return static_cast<double>(f.libraries_named("bullet")); };
      experiment.check_at_most(id + ".left_out", what + " left out: its libraries mapped", most(part.without, maps),
                               "1", 0.0);
      experiment.check_between(id + ".forced_on", what + " forced on: its libraries mapped", most(part.with, maps), "1",
                               1.0, 20.0);
    } else if (part.name == "telemetry") {
      const Figure1 rate = [](const LiveFigures& f) { return f.telemetry_hz; };
      experiment.check_at_most(id + ".left_out", what + ": samples while nobody looks", most(part.without, rate), "Hz",
                               0.0);
      experiment.check_between(id + ".forced_on", what + ": samples for an observer", most(part.with, rate), "Hz",
                               900.0, 1010.0);
    } else if (part.name == "body poses") {
      const Figure1 rate = [](const LiveFigures& f) { return f.body_poses_hz; };
      experiment.check_at_most(id + ".left_out", what + ": samples while nobody looks", most(part.without, rate), "Hz",
                               0.0);
      // Two samples of 64 bodies make a frame.
      experiment.check_between(id + ".forced_on", what + ": samples for an observer, 2 a frame", most(part.with, rate),
                               "Hz", 40.0, 62.0);
    } else if (part.name == "contact constraints") {
      experiment.check_between(id + ".topics", what + " left out: topics fewer", saving(part, topics).median, "1", 1.0,
                               1.0);
    } else if (part.name == "bodies at rest") {
      const Spread awake = left_out(part, step_us), more = saving(part, step_us);
      experiment.check_between(id + ".ratio", what + ": step with all awake over step with all asleep",
                               (awake.median + more.median) / awake.median, "1", 5.0, 1000.0);
    } else {
      experiment.check_between(id + ".threads", what + " left out: threads fewer", saving(part, threads).median, "1",
                               1.0, 10.0);
      experiment.check_between(id + ".processes", what + " left out: processes fewer", saving(part, processes).median,
                               "1", 1.0, 1.0);
    }
  }
}

}  // namespace

void evaluate_overhead(const OverheadOptions& options, Experiment& experiment) {
  check_bits(options, experiment);
  std::vector<Part> parts = parts_of(options);
  measure(parts, options);
  check_parts(parts, experiment);
  add_tables(parts, options.rounds, experiment);
  draw(parts, experiment);
}

}  // namespace tools
