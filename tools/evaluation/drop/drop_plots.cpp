#include <algorithm>
#include <cstdio>
#include <fstream>

#include "tools/cli/common/gnuplot.hpp"
#include "tools/evaluation/drop/drop.hpp"

namespace tools {

namespace {

std::string range(const char* axis, double low, double high) {
  if (low == high) return std::string("set autoscale ") + axis + "\n";
  char text[80];
  std::snprintf(text, sizeof text, "set %srange [%g:%g]\n", axis, low, high);
  return text;
}

std::string plot(const DropFigure& figure, int column, bool titles) {
  std::string text = "plot ";
  for (const DropCurve& curve : figure.curves) {
    if (&curve != &figure.curves.front()) text += ", \\\n     ";
    text += gnuplot_quoted(curve.stem + ".tsv") + " using 1:" + std::to_string(column) + " with lines " + curve.style +
            (titles ? " title " + gnuplot_quoted(curve.title) : std::string(" notitle"));
  }
  return text + "\n";
}

Figure described(const DropFigure& figure) {
  char text[400];
  Figure out;
  out.stem = figure.stem;
  out.height_px = 800;
  out.body = "set multiplot layout 2,1 title " + gnuplot_quoted(figure.title) + "\nset grid lc rgb 'gray80'\n";
  // Both panels share their time axis: the same margins, whatever the width of the numbers.
  out.body += "set lmargin 9\nset rmargin 3\n" + range("x", -0.1, figure.end_s) +
              range("y", figure.height_low_mm, figure.height_high_mm);
  out.body += "set ylabel 'height of the tip [mm]'\nset key top right opaque\n";
  out.body += plot(figure, 2, true);
  if (figure.marked_s > 0.0) {
    std::snprintf(text, sizeof text,
                  "set arrow 1 from %g, graph 0 to %g, graph 1 nohead dt 2 lc rgb 'gray40'\n"
                  "set label 1 %s at %g, graph 0.92 textcolor rgb 'gray30'\n",
                  figure.marked_s, figure.marked_s, gnuplot_quoted(figure.mark).c_str(),
                  figure.marked_s + 0.008 * figure.end_s);
    out.body += text;
  }
  out.body += range("y", figure.force_low_n, figure.force_high_n);
  out.body += "set xlabel 'time since release [s]'\nset ylabel 'force on the hand, upwards [N]'\n";
  out.body += plot(figure, 3, false);
  out.body += "unset multiplot\n";
  return out;
}

}  // namespace

void write_fall(const std::filesystem::path& file, const FallTrace& trace) {
  const double release_s = trace.time_s.empty() ? 0.0 : trace.time_s[release_index(trace)];
  std::ofstream out(file);
  out << "# time since release [s]\theight [mm]\tforce sent [N]\tforce of the method [N]\n";
  for (std::size_t i = 0; i < trace.time_s.size(); ++i) {
    if (trace.time_s[i] < release_s - 0.2) continue;
    out << trace.time_s[i] - release_s << '\t' << trace.height_m[i] * 1e3 << '\t' << trace.force_n[i] << '\t'
        << trace.rendered_n[i] << '\n';
  }
}

void draw_drop(Experiment& experiment, const std::vector<DropFigure>& figures) {
  const auto gnuplot = Gnuplot::find();
  if (!gnuplot) {
    experiment.note("gnuplot is not there: no figures");
    return;
  }
  for (const DropFigure& figure : figures) {
    const auto drawn = gnuplot->draw(experiment.folder(), described(figure));
    if (!drawn) {
      experiment.note("no figure " + figure.stem + ": " + drawn.error());
      continue;
    }
    for (const auto& file : *drawn) experiment.add_figure(file);
  }
}

}  // namespace tools
