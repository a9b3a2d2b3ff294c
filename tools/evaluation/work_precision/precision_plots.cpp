#include <algorithm>
#include <cstdio>
#include <fstream>
#include <limits>

#include "tools/cli/common/gnuplot.hpp"
#include "tools/evaluation/shared/panels.hpp"
#include "tools/evaluation/work_precision/work_precision.hpp"

namespace tools {

namespace {

std::vector<std::string> methods_of(const std::vector<PrecisionRow>& rows) {
  std::vector<std::string> out;
  for (const PrecisionRow& row : rows) {
    if (std::find(out.begin(), out.end(), row.cell.method) == out.end()) out.push_back(row.cell.method);
  }
  return out;
}

bool is_plain(const PrecisionCell& cell) {
  return cell.haptic_hz == 1000.0 && cell.engine_hz == 1000.0 && cell.solver_iterations == 0;
}

std::string number(double value) {
  char text[32];
  std::snprintf(text, sizeof text, "%g", value);
  return text;
}

/// The costs fill the axis: often they are within a factor of ten.
std::string cost_axis(const std::vector<PrecisionRow>& rows) {
  double low = std::numeric_limits<double>::infinity(), high = 0.0;
  for (const PrecisionRow& row : rows) {
    if (row.trace.diverged() || row.trace.cpu_s_per_s <= 0.0) continue;
    low = std::min(low, 1e3 * row.trace.cpu_s_per_s);
    high = std::max(high, 1e3 * row.trace.cpu_s_per_s);
  }
  if (high <= 0.0) return {};
  std::string tics = "set xrange [" + number(low / 1.5) + ":" + number(high * 1.5) + "]\nset xtics (";
  for (double decade = 1e-3; decade < 1e6; decade *= 10.0) {
    for (const double each : {1.0, 1.5, 2.0, 3.0, 4.0, 5.0, 7.0}) {
      const bool always = each == 1.0 || each == 2.0 || each == 5.0;
      if (!always && high > 4.0 * low) continue;
      tics += (tics.back() == '(' ? "" : ", ") + number(each * decade);
    }
  }
  return tics + ")\n";
}

/// Columns: CPU [ms/s], force RMS [N], physics [Hz]. One file per method; diverged ones are left out, the table has
/// them.
void write_points(const std::filesystem::path& file, const std::vector<PrecisionRow>& rows, const std::string& method,
                  bool plain) {
  std::ofstream out(file);
  out << "# CPU [ms/s]\tforce RMS [N]\tphysics [Hz]\thaptics [Hz]\n";
  for (const PrecisionRow& row : rows) {
    if (row.cell.method != method || row.trace.diverged() || (plain && !is_plain(row.cell))) continue;
    out << 1e3 * row.trace.cpu_s_per_s << '\t' << row.error.force_rms_n << '\t' << row.cell.physics_hz << '\t'
        << row.cell.haptic_hz << '\n';
  }
}

}  // namespace

void draw_precision(Experiment& experiment, const std::string& scene, const std::string& what,
                    const std::vector<PrecisionRow>& rows) {
  const auto gnuplot = Gnuplot::find();
  if (!gnuplot) {
    experiment.note("gnuplot is not there: no figures");
    return;
  }
  const std::string stem = "work_precision_" + scene;
  {
    std::ofstream front(experiment.folder() / (stem + "_front.tsv"));
    front << "# CPU [ms/s]\tforce RMS [N]\n";
    for (const std::size_t i : pareto_front(rows))
      front << 1e3 * rows[i].trace.cpu_s_per_s << '\t' << rows[i].error.force_rms_n << '\n';
  }
  Figure figure;
  figure.stem = stem;
  figure.height_px = 900;
  figure.body = "set multiplot layout 2,1 title " +
                gnuplot_quoted("Force error of each method, scene " + scene + "; " + what) +
                "\nset grid lc rgb 'gray80'\nset lmargin 11\nset rmargin 34\nset key outside right top Left reverse\n"
                "set logscale xy\nset format y '%g'\nset ylabel 'force error, RMS [N]'\n"
                "set xlabel 'CPU time of haptics and physics [ms per simulated second]'\n" +
                cost_axis(rows) + "plot " + gnuplot_quoted(stem + "_front.tsv") +
                " using 1:2 with steps lw 1.5 dt 2 lc rgb 'gray40' title 'Pareto front', " +
                gnuplot_quoted(stem + "_front.tsv") + " using 1:2 with points pt 6 ps 2.4 lc rgb 'gray40' notitle";
  const std::vector<std::string> methods = methods_of(rows);
  for (const std::string& method : methods) {
    const std::string file = stem + "_" + method + ".tsv";
    write_points(experiment.folder() / file, rows, method, false);
    figure.body += ", \\\n     " + gnuplot_quoted(file) + " using 1:2 with points ps 1.3 " + method_style(method) +
                   " title " + gnuplot_quoted(method);
  }
  figure.body +=
      "\nset xlabel 'results of physics [Hz]; haptic loop at 1 kHz'\nset format x '%g'\n"
      "set xrange [4:1250]\nset xtics (5, 18, 43, 100, 250, 500, 1000)\nplot ";
  bool first = true;
  for (const std::string& method : methods) {
    const std::string file = stem + "_" + method + "_rates.tsv";
    write_points(experiment.folder() / file, rows, method, true);
    figure.body += (first ? "" : ", \\\n     ") + gnuplot_quoted(file) + " using 3:2 with linespoints ps 1.3 " +
                   method_style(method) + " notitle";
    first = false;
  }
  figure.body += "\nunset multiplot\n";
  const auto drawn = gnuplot->draw(experiment.folder(), figure);
  if (!drawn) {
    experiment.note("no figure " + stem + ": " + drawn.error());
    return;
  }
  for (const auto& file : *drawn) experiment.add_figure(file);
}

}  // namespace tools
