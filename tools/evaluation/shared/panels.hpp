#pragma once
/// @file panels.hpp
/// Figures of several panels with lines, one data file per line.
#include <string>
#include <string_view>
#include <vector>

#include "tools/evaluation/shared/experiment.hpp"

namespace tools {

struct PanelLine {
  std::string name;   ///< In the legend; empty: not there.
  std::string style;  ///< gnuplot's: method_style(), or "lw 2 lc rgb 'gray40'".
  std::vector<double> x, y;
  bool points = false;  ///< Marks at the values, as in a sweep.
};

struct Panel {
  std::string title, x_label, y_label;
  std::vector<PanelLine> lines;
  std::string setup;  ///< More of gnuplot's commands: ranges, logarithmic axes, a bar. Holds for this panel alone.
};

/// One below the other; every panel has its legend under it. Long lines are thinned to what a figure can show, keeping
/// their extremes. Files are STEM_PANEL_LINE.tsv.
void draw_panels(Experiment& experiment, const std::string& stem, const std::string& title,
                 const std::vector<Panel>& panels);

/// Mark and colour of a method, the same in every figure; dark enough for print.
[[nodiscard]] const char* method_style(std::string_view method);

}  // namespace tools
