#include <algorithm>
#include <cstdio>
#include <fstream>

#include "tools/cli/common/gnuplot.hpp"
#include "tools/evaluation/stack/stack.hpp"

namespace tools {

namespace {

constexpr const char* kInterpolation = "interpolation";
constexpr const char* kRemote = "remote_virtual_coupling";

std::string stem_of(const StackCell& cell, const char* method) { return std::string(cell.id) + "_" + method; }

void write_profile(const std::filesystem::path& file, const PushTrace& trace) {
  if (trace.time_s.empty()) return;
  std::ofstream out(file);
  out << "# time [s]\tforce on the hand [N]\tway of the device [mm]\n";
  for (std::size_t i = 0; i < trace.time_s.size(); ++i) {
    out << trace.time_s[i] << '\t' << trace.force_n[i] << '\t' << trace.way_mm[i] << '\n';
  }
}

/// Median of 0.1 s each: what a thousand points a second would hide.
void write_steps(const std::filesystem::path& file, const PushTrace& trace) {
  std::ofstream out(file);
  out << "# time [s]\tengine time of a step, median of 0.1 s [ms]\n";
  std::vector<double> slot;
  double begin_s = 0.0;
  const auto flush = [&] {
    if (slot.empty()) return;
    std::nth_element(slot.begin(), slot.begin() + static_cast<std::ptrdiff_t>(slot.size() / 2), slot.end());
    out << begin_s + 0.05 << '\t' << slot[slot.size() / 2] << '\n';
    slot.clear();
  };
  for (std::size_t i = 0; i < trace.step_ms.size(); ++i) {
    if (trace.step_time_s[i] > begin_s + 0.1) {
      flush();
      begin_s = trace.step_time_s[i];
    }
    slot.push_back(trace.step_ms[i]);
  }
  flush();
}

const StackRun* find(const std::vector<StackRun>& runs, const StackCell& cell, const char* method) {
  const StackRun* found = nullptr;
  for (const StackRun& run : runs) {
    if (run.cell == &cell && run.method == std::string(method) && (found == nullptr || run.counted)) found = &run;
  }
  return found;
}

/// One panel per stack, all to one scale: `methods` in each cell that `takes` accepts.
struct Profiles {
  std::string stem, title;
  std::vector<const char*> methods;
  bool pipe;
};

Figure profiles_figure(const Profiles& wanted, const std::vector<StackPair>& pairs, const std::vector<StackRun>& runs) {
  Figure figure;
  figure.stem = wanted.stem;
  figure.height_px = 1000;
  const auto cells = stack_cells();
  double end_s = 0.0, low_n = 0.0, high_n = 0.5;
  std::vector<std::size_t> panels;
  for (std::size_t i = 0; i < cells.size(); ++i) {
    if (!cells[i].compared || cells[i].pipe != wanted.pipe || pairs[i].remote_trace.time_s.empty()) continue;
    panels.push_back(i);
    for (const char* method : wanted.methods) {
      const auto make_room = [&](const PushTrace& trace) {
        if (!trace.time_s.empty()) end_s = std::max(end_s, trace.time_s.back());
        for (const double force : trace.force_n) low_n = std::min(low_n, force), high_n = std::max(high_n, force);
      };
      make_room(method == kRemote ? pairs[i].remote_trace : pairs[i].interpolation_trace);
      if (const StackRun* run = find(runs, cells[i], method)) make_room(run->push.trace);  // may be the longer push
    }
  }
  char text[400];
  std::snprintf(text, sizeof text, "set multiplot layout %zu,1 title %s\n", std::max<std::size_t>(1, panels.size()),
                gnuplot_quoted(wanted.title).c_str());
  figure.body = std::string(text) + "set grid lc rgb 'gray80'\nset lmargin 9\nset rmargin 3\n";
  std::snprintf(text, sizeof text,
                "set xrange [0:%g]\nset yrange [%g:%g]\nset ylabel 'force on the hand [N]'\nset key top right "
                "horizontal opaque\n",
                end_s, low_n < 0.0 ? low_n * 1.1 : -0.1, high_n * 1.4);  // room for the key
  figure.body += text;
  for (const std::size_t i : panels) {
    if (i == panels.back()) figure.body += "set xlabel 'time [s]'\n";
    std::snprintf(text, sizeof text, "set title '%d cubes, %g simulation steps a second, K = %g N/m' offset 0,-0.7\n",
                  cells[i].cubes, wanted.pipe ? 50.0 : cells[i].throttle_hz, cells[i].stiffness_n_per_m);
    figure.body += text;
    std::string plot = "plot ";
    for (const char* method : wanted.methods) {
      const bool remote = method == kRemote;
      const std::string name = remote ? "remote virtual coupling" : "interpolation", stem = stem_of(cells[i], method);
      if (plot.size() > 5) plot += ", \\\n     ";
      plot += gnuplot_quoted(stem + ".tsv") + " using 1:2 with lines lw 2 lc rgb '" + (remote ? "#7fb2e5" : "#f7b27a") +
              "' title " + gnuplot_quoted(name + ", simulated clock");
      if (find(runs, cells[i], method) == nullptr) continue;
      plot += ", \\\n     " + gnuplot_quoted(stem + "_real.tsv") + " using 1:2 with lines lw 1 lc rgb '" +
              (remote ? "#00305a" : "#7a2f00") + "' title " + gnuplot_quoted(name + ", real processes");
    }
    figure.body += plot + "\n";
  }
  figure.body += "unset multiplot\n";
  return figure;
}

/// Fig. 13: engine time of each step over time, with the paper's means.
Figure steps_figure(const std::vector<StackRun>& runs) {
  static constexpr const char* kColours[] = {"#1b7837", "#2166ac", "#b2182b"};
  Figure figure;
  figure.stem = "stack_fig13";
  figure.body =
      "set title 'Time for one simulation step (paper, Fig. 13): throttled to the paper''s rates, real processes'\n"
      "set grid lc rgb 'gray80'\nset logscale y\nset yrange [0.05:1000]\nset ylabel 'engine time of a step [ms]'\n"
      "set xlabel 'time [s]'\nset key top right opaque maxrows 3\nplot ";
  std::string plot;
  for (std::size_t n = 0; n < published_stacks().size(); ++n) {
    const PublishedStack& paper = published_stacks()[n];
    char text[200];
    for (const StackCell& cell : stack_cells()) {
      if (cell.cubes != paper.cubes || cell.throttle_hz == 0.0 || find(runs, cell, kRemote) == nullptr) continue;
      std::snprintf(text, sizeof text, "'%s_steps.tsv' using 1:2 with lines lw 2 lc rgb '%s' title '%d cubes'", cell.id,
                    kColours[n], cell.cubes);
      plot += (plot.empty() ? "" : ", \\\n     ") + std::string(text);
    }
    std::snprintf(text, sizeof text, "%g with lines lw 1.5 dt 2 lc rgb '%s' title '%d cubes, paper: %g ms'",
                  paper.step_ms, kColours[n], paper.cubes, paper.step_ms);
    plot += (plot.empty() ? "" : ", \\\n     ") + std::string(text);
  }
  figure.body += plot + "\n";
  return figure;
}

/// Table I as a picture.
Figure rates_figure(const std::filesystem::path& folder, const std::vector<StackRun>& runs) {
  std::ofstream out(folder / "stack_rates.tsv");
  out << "# cubes\tsimulation, paper [Hz]\thaptic, paper [Hz]\tsimulation, throttled [Hz]\thaptic [Hz]\tbare loop "
         "[Hz]\tsimulation, own speed [Hz]\n";
  for (const PublishedStack& paper : published_stacks()) {
    const StackRun *throttled = nullptr, *own = nullptr;
    for (const StackCell& cell : stack_cells()) {
      if (cell.cubes != paper.cubes || cell.pipe) continue;
      (cell.throttle_hz > 0.0 ? throttled : own) = find(runs, cell, kRemote);
    }
    if (throttled == nullptr || own == nullptr) continue;
    out << paper.cubes << '\t' << paper.simulation_hz << '\t' << paper.haptic_hz << '\t'
        << throttled->push.simulation_hz << '\t' << throttled->push.haptic_hz << '\t' << throttled->push.bare_hz << '\t'
        << own->push.simulation_hz << '\n';
  }
  Figure figure;
  figure.stem = "stack_rates";
  figure.body =
      "set title 'Update rates (paper, Table I)'\nset grid lc rgb 'gray80'\nset logscale y\nset yrange [10:3000]\n"
      "set xrange [50:575]\nset xtics (125, 250, 500)\nset xlabel 'cubes'\nset ylabel 'rate [Hz]'\n"
      "set key outside below maxrows 3 samplen 2 width -3\nset pointsize 1.8\n"
      "plot 'stack_rates.tsv' using 1:3 with linespoints pt 4 lw 1.5 dt 2 lc rgb 'gray50' title 'haptics, paper', \\\n"
      "     '' using 1:5 with linespoints pt 7 lw 2 lc rgb '#2166ac' title 'haptics, ours', \\\n"
      "     '' using 1:6 with points pt 2 lw 2 lc rgb 'black' title 'bare loop beside it', \\\n"
      "     '' using 1:7 with linespoints pt 9 lw 2 lc rgb '#1b7837' title 'simulation, this machine''s own speed', "
      "\\\n"
      "     '' using 1:2 with linespoints pt 4 lw 1.5 dt 2 lc rgb 'gray50' title 'simulation, paper', \\\n"
      "     '' using 1:4 with linespoints pt 7 lw 2 lc rgb '#b2182b' title 'simulation, ours, throttled'\n";
  return figure;
}

}  // namespace

void draw_stack(Experiment& experiment, const std::vector<StackPair>& pairs, const std::vector<StackRun>& runs) {
  const auto cells = stack_cells();
  for (std::size_t i = 0; i < cells.size(); ++i) {
    const std::string stem = (experiment.folder() / cells[i].id).string();
    write_profile(stem + "_" + kInterpolation + ".tsv", pairs[i].interpolation_trace);
    write_profile(stem + "_" + kRemote + ".tsv", pairs[i].remote_trace);
    for (const char* method : {kInterpolation, kRemote}) {
      if (const StackRun* run = find(runs, cells[i], method)) {
        write_profile(stem + "_" + method + "_real.tsv", run->push.trace);
        if (method == kRemote) write_steps(stem + "_steps.tsv", run->push.trace);
      }
    }
  }
  const auto gnuplot = Gnuplot::find();
  if (!gnuplot) {
    experiment.note("gnuplot is not there: no figures");
    return;
  }
  for (const Figure& figure :
       {steps_figure(runs),
        profiles_figure(
            {"stack_fig15", "Pushing into a stack: force interpolation (paper, Fig. 15)", {kInterpolation}, false},
            pairs, runs),
        profiles_figure(
            {"stack_fig16", "Pushing into a stack: remote virtual coupling (paper, Fig. 16)", {kRemote}, false}, pairs,
            runs),
        profiles_figure({"stack_pipe",
                         "The same over a named pipe, 50 packets a second (form: paper)",
                         {kInterpolation, kRemote},
                         true},
                        pairs, runs),
        rates_figure(experiment.folder(), runs)}) {
    const auto drawn = gnuplot->draw(experiment.folder(), figure);
    if (!drawn) {
      experiment.note("no figure " + figure.stem + ": " + drawn.error());
      continue;
    }
    for (const auto& file : *drawn) experiment.add_figure(file);
  }
}

}  // namespace tools
