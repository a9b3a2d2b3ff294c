#include "tools/evaluation/shared/panels.hpp"

#include <algorithm>
#include <fstream>

#include "tools/cli/common/gnuplot.hpp"
#include "tools/evaluation/shared/method_settings.hpp"

namespace tools {

namespace {

constexpr std::size_t kMostPoints = 3000;
constexpr int kPanel_px = 440, kKeyRow_px = 18;
constexpr std::size_t kKeyRows = 3;  ///< Fit into kPanel_px.
/// More panels stand side by side: one below the other they would be metres of paper.
constexpr std::size_t kInOneColumn = 6, kColumns = 3;

struct Look {
  const char* method;
  const char* style;
};
constexpr Look kLooks[] = {
    {"direct", "pt 5 lc rgb 'black'"},
    {"virtual_coupling", "pt 4 lc rgb 'gray40'"},
    {"remote_virtual_coupling", "pt 7 lc rgb '#1f5fa8'"},
    {kLeadingCoupling, "pt 6 lc rgb '#7fb0e6'"},
    {"interpolation", "pt 9 lc rgb '#c45a00'"},
    {"interpolation_predicted", "pt 8 lc rgb '#a0308a'"},
    {"local_contact", "pt 13 lc rgb '#1b7a35'"},
    {kPlanesAlone, "pt 12 lc rgb '#8fbf6f'"},
};

void write_line(const std::filesystem::path& file, const PanelLine& line) {
  std::ofstream out(file);
  const std::size_t count = std::min(line.x.size(), line.y.size());
  const std::size_t stride = std::max<std::size_t>(1, 2 * count / kMostPoints);
  for (std::size_t begin = 0; begin < count; begin += stride) {
    const std::size_t end = std::min(count, begin + stride);
    const auto [low, high] = std::minmax_element(line.y.begin() + static_cast<std::ptrdiff_t>(begin),
                                                 line.y.begin() + static_cast<std::ptrdiff_t>(end));
    for (const auto& each : {std::min(low, high), std::max(low, high)}) {
      out << line.x[static_cast<std::size_t>(each - line.y.begin())] << '\t' << *each << '\n';
      if (low == high) break;
    }
  }
}

/// Rows of the key below a panel. Two names share a row unless one is long.
std::size_t key_rows(const Panel& panel) {
  constexpr std::size_t kLong = 50;
  std::size_t named = 0;
  bool long_name = false;
  for (const PanelLine& line : panel.lines) {
    named += line.name.empty() ? 0 : 1;
    long_name = long_name || line.name.size() > kLong;
  }
  return long_name ? named : (named + 1) / 2;
}

}  // namespace

const char* method_style(std::string_view method) {
  for (const Look& look : kLooks) {
    if (method == look.method) return look.style;
  }
  return "pt 2 lc rgb 'gray50'";
}

void draw_panels(Experiment& experiment, const std::string& stem, const std::string& title,
                 const std::vector<Panel>& panels) {
  const auto gnuplot = Gnuplot::find();
  if (!gnuplot) return experiment.note("gnuplot is not there: no figure " + stem);
  Figure figure;
  figure.stem = stem;
  std::size_t rows = kKeyRows;
  for (const Panel& panel : panels) rows = std::max(rows, key_rows(panel));
  const int more_px = kKeyRow_px * static_cast<int>(rows - kKeyRows);
  const std::size_t columns = panels.size() > kInOneColumn ? kColumns : 1;
  const std::size_t lines = (panels.size() + columns - 1) / columns;
  figure.width_px *= static_cast<int>(columns);
  figure.height_px = 60 + (kPanel_px + more_px) * static_cast<int>(lines);
  figure.body = "set multiplot layout " + std::to_string(lines) + "," + std::to_string(columns) + " title " +
                gnuplot_quoted(title) + "\nset grid lc rgb 'gray80'\nset lmargin 11\nset rmargin 4\n";
  for (std::size_t p = 0; p < panels.size(); ++p) {
    const Panel& panel = panels[p];
    figure.body += "unset logscale\nunset arrow\nset autoscale\nset format '%g'\nset xtics autofreq\nset bmargin " +
                   std::to_string(rows + 4) + "\nset key below center horizontal Left reverse width 2\nset title " +
                   gnuplot_quoted(panel.title) + "\nset xlabel " + gnuplot_quoted(panel.x_label) + "\nset ylabel " +
                   gnuplot_quoted(panel.y_label) + "\n" + panel.setup + "\nplot ";
    for (std::size_t l = 0; l < panel.lines.size(); ++l) {
      const PanelLine& line = panel.lines[l];
      const std::string file = stem + "_" + std::to_string(p + 1) + "_" + std::to_string(l + 1) + ".tsv";
      write_line(experiment.folder() / file, line);
      figure.body += (l == 0 ? "" : ", \\\n     ") + gnuplot_quoted(file) + " using 1:2 with " +
                     (line.points ? "linespoints ps 1.3 lw 1.5 " : "lines lw 1.5 ") +
                     (line.points ? line.style : line.style.substr(line.style.find("lc"))) +
                     (line.name.empty() ? " notitle" : " title " + gnuplot_quoted(line.name));
    }
    figure.body += "\n";
  }
  figure.body += "unset multiplot\n";
  const auto drawn = gnuplot->draw(experiment.folder(), figure);
  if (!drawn) return experiment.note("no figure " + stem + ": " + drawn.error());
  for (const auto& file : *drawn) experiment.add_figure(file);
}

}  // namespace tools
