#include "tools/cli/run/run_plots.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <fstream>
#include <limits>

#include "tools/cli/common/formatted.hpp"
#include "tools/cli/common/gnuplot.hpp"

namespace tools {

namespace {

namespace fs = std::filesystem;

constexpr const char* kStyle =
    "set grid lt 1 lw 0.5 lc rgb '#d0d0d0'\n"
    "set border lc rgb '#606060'\n"
    "set tics nomirror\n"
    "set key top right opaque box lc rgb '#d8d8d8' samplen 2\n"
    "set lmargin 12\n";

/// What stands above each figure of a node.
std::string title(const RunPlots& plots, const HapticObserver& haptic) {
  const haptic::HapticConfig& config = haptic.config();
  return "session " + plots.session + ", " + config.name + ": " + config.method + ", K " +
         formatted("%g", config.stiffness_n_per_m) + " N/m, B " + formatted("%g", config.damping_n_s_per_m) +
         " N s/m, " + formatted("%g", config.rate_hz) + " Hz, " + config.device->info().model;
}

/// The axis along which the tip went farthest: the one worth a picture.
int main_axis(std::span<const MotionRow> rows) {
  int best = 0;
  double widest_m = -1.0;
  for (int axis = 0; axis < 3; ++axis) {
    const auto [low, high] = std::minmax_element(rows.begin(), rows.end(), [axis](const auto& a, const auto& b) {
      return a.position_m[axis] < b.position_m[axis];
    });
    const double width_m = high->position_m[axis] - low->position_m[axis];
    if (width_m > widest_m) widest_m = width_m, best = axis;
  }
  return best;
}

void write_motion(const RunPlots& plots, const HapticObserver& haptic) {
  std::ofstream tsv(plots.folder / ("motion_" + haptic.config().name + ".tsv"));
  tsv << "# time_s\tx_m\ty_m\tz_m\tproxy_x_m\tproxy_y_m\tproxy_z_m\tforce_x_n\tforce_y_n\tforce_z_n"
         "\trendered_x_n\trendered_y_n\trendered_z_n\tproxy_age_ms\n";
  for (const MotionRow& row : haptic.motion().rows()) {
    tsv << formatted("%.6f", row.time_s);
    for (const rtbus::Vec3* vector : {&row.position_m, &row.proxy_m, &row.force_n, &row.rendered_n}) {
      for (const double value : *vector) tsv << formatted("\t%.7g", value);
    }
    tsv << formatted("\t%.4f", row.proxy_age_ms) << '\n';
  }
}

struct TimeSpan {
  double from_s, to_s;
};

/// Force and position over `span`, from the motion's data.
Figure motion_figure(const RunPlots& plots, const HapticObserver& haptic, const std::string& kind, TimeSpan span) {
  const int axis = main_axis(haptic.motion().rows());
  const std::string name(1, "xyz"[axis]);
  const auto column = [axis](int first) { return std::to_string(first + axis); };
  const std::string data = gnuplot_quoted("motion_" + haptic.config().name + ".tsv");
  Figure figure{kind + "_" + haptic.config().name, kStyle, 1200, 800};
  figure.body += "set multiplot layout 2,1 title " + gnuplot_quoted(title(plots, haptic)) + " noenhanced\n" +
                 "set xrange [" + formatted("%.6g", span.from_s) + ":" + formatted("%.6g", span.to_s) +
                 "]\nset format x ''\nset bmargin 1\n" + "set ylabel " +
                 gnuplot_quoted("force on the hand, " + name + " [N]") + "\n" + "plot " + data +
                 " using 1:" + column(11) + " with lines lw 2 lc rgb '#c0c0c0' title 'method, before safety', " + data +
                 " using 1:" + column(8) + " with lines lw 1.2 lc rgb '#b2182b' title 'sent to device'\n" +
                 "set format x\nset bmargin 4\nset xlabel 'time [s]'\n" + "set ylabel " +
                 gnuplot_quoted("position in the device frame, " + name + " [mm]") + "\nplot " + data + " using 1:($" +
                 column(5) + "*1e3) with lines lw 2 lc rgb '#4393c3' title 'proxy', " + data + " using 1:($" +
                 column(2) + "*1e3) with lines lw 1.2 lc rgb '#202020' title 'tip'\nunset multiplot\n";
  return figure;
}

/// The hardest contact, from a little before its peak: what a whole run squeezes into a few pixels.
TimeSpan around_the_peak(std::span<const MotionRow> rows) {
  const auto force = [](const MotionRow& row) { return std::hypot(row.force_n[0], row.force_n[1], row.force_n[2]); };
  const auto peak = std::max_element(rows.begin(), rows.end(),
                                     [&](const MotionRow& a, const MotionRow& b) { return force(a) < force(b); });
  return {std::max(0.0, peak->time_s - 0.25), peak->time_s + 0.75};
}

/// Counts in bins of equal width on a logarithmic axis: 20 to the decade, 0.1 us to 10 s.
struct LogBins {
  static constexpr int kPerDecade = 20;
  static constexpr double kLow_us = 0.1;
  std::array<std::uint64_t, 8 * kPerDecade> counts{};
  std::uint64_t total = 0;

  explicit LogBins(const rtbus::Histogram* histogram) {
    if (histogram == nullptr) return;
    histogram->for_each_bin([&](std::uint64_t low_ns, std::uint64_t high_ns, std::uint64_t count) {
      const double middle_us = 0.5e-3 * static_cast<double>(low_ns + high_ns);
      const double place = std::floor(kPerDecade * std::log10(middle_us / kLow_us));
      counts[static_cast<std::size_t>(std::clamp(place, 0.0, static_cast<double>(counts.size() - 1)))] += count;
      total += count;
    });
  }
  [[nodiscard]] static double edge_us(std::size_t i) {
    return kLow_us * std::pow(10.0, static_cast<double>(i) / kPerDecade);
  }
  [[nodiscard]] double percent(std::size_t i) const {
    return total == 0 ? 0.0 : 100.0 * static_cast<double>(counts[i]) / static_cast<double>(total);
  }
};

Figure wakeup_figure(const RunPlots& plots, const HapticObserver& haptic, const BareLoop* bare) {
  const std::string stem = "wakeup_" + haptic.config().name;
  const LogBins loop(&haptic.wakeup_ns());
  const LogBins other(bare == nullptr ? nullptr : &bare->wakeup_ns());
  std::size_t first = loop.counts.size(), last = 0;
  for (std::size_t i = 0; i < loop.counts.size(); ++i) {
    if (loop.counts[i] + other.counts[i] == 0) continue;
    first = std::min(first, i);
    last = i;
  }
  first = first > 0 ? first - 1 : 0;
  std::ofstream tsv(plots.folder / (stem + ".tsv"));
  tsv << "# bin from wakeup_us\thaptic loop percent\tbare loop percent\n";
  for (std::size_t i = first; i <= last + 1; ++i) {
    const bool beyond = i >= loop.counts.size();
    tsv << formatted("%.6g", LogBins::edge_us(i)) << formatted("\t%.6g", beyond ? 0.0 : loop.percent(i))
        << formatted("\t%.6g", beyond ? 0.0 : other.percent(i)) << '\n';
  }
  const std::string data = gnuplot_quoted(stem + ".tsv");
  // An empty bin has no logarithm: it is drawn on the lower edge, just below a bin with a single tick.
  const std::string floor = formatted("%.3g", 50.0 / static_cast<double>(std::max<std::uint64_t>(loop.total, 1)));
  const auto drawn = [&](int column) {
    const std::string c = "$" + std::to_string(column);
    return data + " using 1:(" + c + ">" + floor + "?" + c + ":" + floor + ")";
  };
  const std::string granted(haptic.info().scheduling.data());
  Figure figure{stem, kStyle, 1200, 700};
  figure.body += "set title " + gnuplot_quoted(title(plots, haptic)) + " noenhanced\nset logscale xy\n" +
                 "set xrange [" + formatted("%.6g", LogBins::edge_us(first)) + ":" +
                 formatted("%.6g", LogBins::edge_us(last + 1)) + "]\nset yrange [" + floor + ":100]\n" +
                 "set xlabel 'wake-up after the deadline [us]'\nset ylabel 'share of ticks [%], 20 bins per decade'\n" +
                 "plot " + drawn(2) + " with fillsteps fs transparent solid 0.35 noborder lc rgb '#4393c3' title " +
                 gnuplot_quoted("haptic loop, " + granted + ", " + std::to_string(loop.total) + " ticks");
  if (bare != nullptr) {
    figure.body += ", " + drawn(3) + " with steps lw 2 lc rgb '#b2182b' title " +
                   gnuplot_quoted(std::string("bare loop, ") + bare->grant().scheduling() + ", " +
                                  std::to_string(other.total) + " ticks");
  }
  figure.body += '\n';
  return figure;
}

/// A cloud of points over time; logarithmic when a few tower over the rest.
std::string cloud(const std::string& using_text, double end_s, double mean, double max, const char* colour) {
  const std::string scale =
      max > 20.0 * mean ? "set logscale y\n" : "set yrange [0:" + formatted("%.6g", std::max(1.1 * max, 1e-6)) + "]\n";
  return scale + "set xrange [0:" + formatted("%.6g", std::max(end_s, 1e-3)) +
         "]\nset xlabel 'time [s]'\nunset key\nplot " + using_text + " with points pt 7 ps 0.25 lc rgb '" + colour +
         "'\n";
}

template <class Row>
std::pair<double, double> mean_and_max(std::span<const Row> rows, double Row::*member) {
  double sum = 0.0, max = 0.0;
  for (const Row& row : rows) {
    sum += row.*member;
    max = std::max(max, row.*member);
  }
  return {sum / static_cast<double>(rows.size()), max};
}

Figure age_figure(const RunPlots& plots, const HapticObserver& haptic) {
  const std::span<const MotionRow> rows = haptic.motion().rows();
  const auto [mean, max] = mean_and_max(rows, &MotionRow::proxy_age_ms);
  Figure figure{"proxy_age_" + haptic.config().name, kStyle, 1200, 500};
  // The data are a column of the motion's.
  figure.body += "set title " + gnuplot_quoted(title(plots, haptic)) +
                 " noenhanced\nset ylabel 'age of the proxy at its use [ms]'\n" +
                 cloud(gnuplot_quoted("motion_" + haptic.config().name + ".tsv") + " using 1:14", rows.back().time_s,
                       mean, max, "#1b7837");
  return figure;
}

/// Events in windows of equal width, as a rate. `per_row`: events that a row stands for.
template <class Row>
void write_rate(std::ofstream& tsv, std::span<const Row> rows, std::uint64_t per_row) {
  constexpr double kWindow_s = 0.25;
  std::size_t i = 0;
  for (double begin_s = rows.front().time_s; begin_s + kWindow_s <= rows.back().time_s; begin_s += kWindow_s) {
    std::uint64_t count = 0;
    for (; i < rows.size() && rows[i].time_s < begin_s + kWindow_s; ++i) count += per_row;
    tsv << formatted("%.3f", begin_s + 0.5 * kWindow_s)
        << formatted("\t%.6g\n", static_cast<double>(count) / kWindow_s);
  }
  tsv << "\n\n";  // gnuplot's end of a block
}

/// Achieved rates of all loops above, time of each physics step below.
Figure rates_figure(const RunPlots& plots, const HapticObserver& haptic) {
  const std::span<const StepRow> rows = haptic.steps().rows();
  std::ofstream tsv(plots.folder / "physics_step.tsv");
  tsv << "# time_s\tstep_ms\n";
  for (const StepRow& row : rows) tsv << formatted("%.6f", row.time_s) << formatted("\t%.6g", row.step_ms) << '\n';
  std::ofstream rates(plots.folder / "rates.tsv");
  rates << "# time_s\trate_hz: physics, then each haptic loop, in blocks\n";
  write_rate(rates, rows, haptic.steps().stride());
  std::string curves = "plot 'rates.tsv' index 0 using 1:2 with steps lw 2 lc rgb '#762a83' title 'physics steps'";
  constexpr std::array<const char*, 3> kColours{"#202020", "#b2182b", "#1b7837"};
  for (std::size_t i = 0; i < plots.haptic.size(); ++i) {
    if (plots.haptic[i]->motion().rows().empty()) continue;
    write_rate(rates, plots.haptic[i]->motion().rows(), plots.haptic[i]->motion().stride());
    curves += ", '' index " + std::to_string(i + 1) + " using 1:2 with steps lw 1.5 lc rgb '" +
              kColours[i % kColours.size()] + "' title " + gnuplot_quoted(plots.haptic[i]->config().name + " loop");
  }
  const auto [mean, max] = mean_and_max(rows, &StepRow::step_ms);
  const bool short_steps = mean < 0.1;
  Figure figure{"rates", kStyle, 1200, 800};
  figure.body += "set multiplot layout 2,1 title " + gnuplot_quoted("session " + plots.session + ": rates and steps") +
                 " noenhanced\nset xrange [0:" + formatted("%.6g", std::max(rows.back().time_s, 1e-3)) +
                 "]\nset yrange [0:*]\nset offsets 0,0,graph 0.25,0\n" +
                 "set key top right horizontal\nset format x ''\nset bmargin 1\n" +
                 "set ylabel 'rate in windows of 0.25 s [Hz]'\n" + curves +
                 "\nset offsets 0,0,0,0\nset format x\nset bmargin 4\nset ylabel 'engine time of a step [" +
                 (short_steps ? "us" : "ms") + "]'\n" +
                 cloud(std::string("'physics_step.tsv' using 1:") + (short_steps ? "($2*1e3)" : "2"),
                       rows.back().time_s, short_steps ? 1e3 * mean : mean, short_steps ? 1e3 * max : max, "#762a83") +
                 "unset multiplot\n";
  return figure;
}

}  // namespace

RunPlotsOutcome draw_run_plots(const RunPlots& plots) {
  RunPlotsOutcome outcome;
  std::error_code error;
  fs::create_directories(plots.folder, error);
  if (error) {
    outcome.problem = plots.folder.string() + ": " + error.message();
    return outcome;
  }
  std::vector<Figure> figures;
  for (const HapticObserver* haptic : plots.haptic) {
    const std::span<const MotionRow> rows = haptic->motion().rows();
    if (rows.empty()) continue;
    write_motion(plots, *haptic);
    figures.push_back(motion_figure(plots, *haptic, "motion", {0.0, std::max(rows.back().time_s, 1e-3)}));
    figures.push_back(motion_figure(plots, *haptic, "contact", around_the_peak(rows)));
    figures.push_back(wakeup_figure(plots, *haptic, haptic == plots.haptic.front() ? plots.bare : nullptr));
    if (haptic->needs_physics()) figures.push_back(age_figure(plots, *haptic));
  }
  // Every proxy carries the time of its step, which is the same for all devices: one is enough.
  const auto stepped = std::find_if(plots.haptic.begin(), plots.haptic.end(),
                                    [](const HapticObserver* haptic) { return !haptic->steps().rows().empty(); });
  if (stepped != plots.haptic.end()) figures.push_back(rates_figure(plots, **stepped));

  const std::optional<Gnuplot> gnuplot = Gnuplot::find();
  if (!gnuplot) {
    outcome.problem =
        "no figures: gnuplot is not installed (apt install gnuplot-nox); their data are in " + plots.folder.string();
    return outcome;
  }
  for (const Figure& figure : figures) {
    if (auto drawn = gnuplot->draw(plots.folder, figure)) {
      for (const fs::path& file : *drawn) outcome.files.push_back(file.string());
    } else if (outcome.problem.empty()) {
      outcome.problem = drawn.error();
    }
  }
  return outcome;
}

}  // namespace tools
