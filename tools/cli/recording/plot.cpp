// `rtbus plot FILE.h5` and `rtbus plot --live`: figures of any signal, as PNG or SVG.
#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "rtbus/recording/reader.hpp"
#include "rtbus/topic_directory.hpp"
#include "tools/cli/common/choose.hpp"
#include "tools/cli/common/command.hpp"
#include "tools/cli/common/gnuplot.hpp"
#include "tools/cli/recording/signals.hpp"

namespace tools {
namespace {

namespace fs = std::filesystem;

struct PlotOptions {
  std::vector<std::string> files;
  std::optional<std::string> mark;  ///< Time 0 of several files.
  std::optional<double> live_s;
  std::optional<std::string> session;
  std::vector<std::string> signals;
  std::string output = "plot.png";
  double from_s = 0.0;
  double to_s = std::numeric_limits<double>::infinity();
  std::string title;
};

constexpr std::size_t kPoints = 6000;
const std::vector<std::string> kDefaultSignals{"telemetry.force_n", "telemetry.position_m",
                                               "telemetry.proxy_position_m", "telemetry.wakeup_us",
                                               "telemetry.compute_us"};

int refuse(const Refusal& refusal) {
  std::cerr << "rtbus plot: " << refusal.message << '\n';
  return refusal.exit_status;
}

struct MarkLine {
  double time_s;
  std::string text;
};

/// Axis of one unit: several signals share a panel when they can be compared.
struct Panel {
  std::string unit;
  std::vector<const Signal*> signals;
};

std::vector<Panel> panels_of(const std::vector<Signal>& signals) {
  std::vector<Panel> panels;
  for (const Signal& signal : signals) {
    auto panel = std::find_if(panels.begin(), panels.end(), [&](const Panel& p) { return p.unit == signal.unit; });
    if (panel == panels.end()) panel = panels.insert(panels.end(), Panel{signal.unit, {}});
    panel->signals.push_back(&signal);
  }
  return panels;
}

/// Words for an axis: the field's name without unit when all agree, else the unit alone.
std::string axis_label(const Panel& panel) {
  std::string name = panel.signals.front()->field;
  for (const Signal* const signal : panel.signals) {
    if (signal->field != name) return panel.unit == "1" ? "value" : "[" + panel.unit + "]";
  }
  return name + (panel.unit.empty() || panel.unit == "1" ? "" : " [" + panel.unit + "]");
}

/// Colours that stay apart in print and for the colour-blind (after P. Green-Armytage's and Okabe-Ito's sets).
constexpr const char* kColours[] = {"#0072b2", "#d55e00", "#009e73", "#cc79a7",
                                    "#e69f00", "#56b4e9", "#202020", "#999933"};

/// Dashes of the first recording, the second, …
constexpr int kDashes[] = {1, 2, 4, 3, 5};

/// @param recordings Names for the key, when there are several.
Figure figure_of(const std::vector<Signal>& signals, const std::vector<std::string>& recordings,
                 const std::vector<MarkLine>& marks, const std::string& title) {
  const std::vector<Panel> panels = panels_of(signals);
  const bool one_topic =
      std::all_of(signals.begin(), signals.end(), [&](const Signal& s) { return s.topic == signals[0].topic; });
  double begin_s = std::numeric_limits<double>::max(), end_s = std::numeric_limits<double>::lowest();
  for (const Signal& signal : signals) {
    if (signal.time_s.empty()) continue;
    begin_s = std::min(begin_s, signal.time_s.front());
    end_s = std::max(end_s, signal.time_s.back());
  }
  Figure figure{"plot", "", 1200, 150 + 260 * static_cast<int>(panels.size())};
  figure.body =
      "set grid lt 1 lw 0.5 lc rgb '#d0d0d0'\nset border lc rgb '#606060'\nset tics nomirror\n"
      "set key outside right top samplen 2\nset lmargin 12\nset rmargin 28\n";
  char range[96];
  std::snprintf(range, sizeof range, "set xrange [%.9g:%.9g]\n", begin_s, end_s > begin_s ? end_s : begin_s + 1e-3);
  figure.body += range;
  for (const MarkLine& mark : marks) {
    char place[64];
    std::snprintf(place, sizeof place, "%.9g", mark.time_s);
    figure.body += std::string("set arrow from ") + place + ",graph 0 to " + place +
                   ",graph 1 nohead dt 2 lw 1 lc rgb '#808080'\n" + "set label " + gnuplot_quoted(mark.text) + " at " +
                   place + ",graph 0.97 rotate by 90 right offset -0.6,0 font ',9' tc rgb '#606060'\n";
  }
  figure.body +=
      "set multiplot layout " + std::to_string(panels.size()) + ",1 title " + gnuplot_quoted(title) + " noenhanced\n";
  for (std::size_t p = 0; p < panels.size(); ++p) {
    const bool last = p + 1 == panels.size();
    figure.body += last ? "set format x\nset xlabel 'time [s]'\nset bmargin 4\n" : "set format x ''\nset bmargin 1\n";
    figure.body += "set ylabel " + gnuplot_quoted(axis_label(panels[p])) + "\nplot ";
    for (std::size_t i = 0; i < panels[p].signals.size(); ++i) {
      const Signal& signal = *panels[p].signals[i];
      figure.body +=
          (i > 0 ? ", " : "") + gnuplot_quoted("signal" + std::to_string(&signal - signals.data()) + ".tsv") +
          " using 1:2 with lines lw 1.4 dt " + std::to_string(kDashes[signal.recording % std::size(kDashes)]) +
          " lc rgb '" + kColours[i % std::size(kColours)] + "' title " +
          gnuplot_quoted((recordings.size() > 1 ? recordings[signal.recording] + ": " : "") + signal.label(!one_topic));
    }
    figure.body += "\n";
  }
  figure.body += "unset multiplot\n";
  return figure;
}

/// Draws beside the data in a folder of its own and takes out the one picture that was asked for.
int draw(std::vector<Signal>& signals, const std::vector<std::string>& recordings, const std::vector<MarkLine>& marks,
         const std::string& title, const std::string& output) {
  const auto gnuplot = Gnuplot::find();
  if (!gnuplot) return refuse({"gnuplot is not there; install gnuplot-nox", 1});
  char name[] = "/tmp/rtbus_plot_XXXXXX";
  const char* const made = ::mkdtemp(name);
  if (made == nullptr) return refuse({"cannot make a folder in /tmp", 1});
  const fs::path folder = made;
  for (std::size_t i = 0; i < signals.size(); ++i) {
    thin(signals[i], kPoints);
    std::ofstream out(folder / ("signal" + std::to_string(i) + ".tsv"));
    for (std::size_t row = 0; row < signals[i].value.size(); ++row) {
      char line[64];
      std::snprintf(line, sizeof line, "%.9g\t%.9g\n", signals[i].time_s[row], signals[i].value[row]);
      out << line;
    }
  }
  const auto drawn = gnuplot->draw(folder, figure_of(signals, recordings, marks, title));
  std::error_code failed;
  if (drawn) {
    const fs::path target(output);
    if (target.has_parent_path()) fs::create_directories(target.parent_path(), failed);
    fs::copy_file(folder / (output.ends_with(".svg") ? "plot.svg" : "plot.png"), target,
                  fs::copy_options::overwrite_existing, failed);
  }
  std::error_code ignored;
  fs::remove_all(folder, ignored);
  if (!drawn) return refuse({drawn.error(), 1});
  if (failed) return refuse({"cannot write " + output + ": " + failed.message(), 1});
  std::printf("%s\n", output.c_str());
  return kExitFine;
}

/// One recording on its own time, several on a common one.
int plot_files(const PlotOptions& options) {
  const bool several = options.files.size() > 1;
  std::vector<Signal> signals;
  std::vector<std::string> names;
  std::vector<MarkLine> marks;
  std::string title = options.title;
  for (const std::string& file : options.files) {
    const auto recording = rtbus::recording::Recording::open(file);
    if (!recording) return refuse({recording.error().message, 1});
    std::uint64_t origin_ns = recording->started_monotonic_ns();
    if (several || options.mark) {
      const auto common = common_origin_ns(*recording, options.mark);
      if (!common) return refuse(common.error());
      origin_ns = *common;
    }
    auto own = choose_signals(sources_of(*recording), options.signals.empty() ? kDefaultSignals : options.signals);
    if (!own) return refuse({file + ": " + own.error().message, own.error().exit_status});
    load_signals(*recording, options.from_s, options.to_s, *own, origin_ns);
    for (Signal& signal : *own) {
      signal.recording = names.size();
      if (!signal.value.empty()) signals.push_back(std::move(signal));
    }
    if (names.empty()) {  // the marks of the first are enough: those of a replay come at the same times
      for (const auto& mark : recording->marks()) {
        const double at_s = 1e-9 * static_cast<double>(static_cast<std::int64_t>(mark.stamp_ns - origin_ns));
        if (at_s >= options.from_s && at_s <= options.to_s) marks.push_back({at_s, mark.text});
      }
    }
    names.push_back(fs::path(file).stem());
    if (options.title.empty()) {
      title += several ? (title.empty() ? "" : ", ") + names.back()
                       : "session " + recording->session() + ", " + recording->started_utc();
    }
  }
  if (signals.empty()) return refuse({"there is nothing recorded in that time", 1});
  // Who names signals gets them.
  if (several && options.signals.empty()) leave_out_silent_elements(signals);
  return draw(signals, names, marks, title, options.output);
}

int plot_live(const PlotOptions& options) {
  const auto topics = rtbus::list_topics();
  const auto session = choose_session(topics, options.session);
  if (!session) return refuse(session.error());
  std::vector<SignalSource> sources;
  for (const rtbus::TopicInfo& info : topics) {
    if (info.session == *session && info.problem.empty() && info.writer_alive)
      sources.push_back({info.topic, info.fields});
  }
  auto signals = choose_signals(sources, options.signals.empty() ? kDefaultSignals : options.signals);
  if (!signals) return refuse(signals.error());
  rtbus::Session where;
  where.name = *session;
  if (auto watched = watch_signals(where, *options.live_s, *signals); !watched) return refuse(watched.error());
  std::erase_if(*signals, [](const Signal& signal) { return signal.value.empty(); });
  if (signals->empty()) return refuse({"nothing was published in that time", 1});
  return draw(*signals, {}, {}, options.title.empty() ? "session " + *session + ", live" : options.title,
              options.output);
}

}  // namespace

Action add_plot(rtbus::Command command) {
  auto options = std::make_shared<PlotOptions>();
  const rtbus::Option file =
      command.option("FILE", options->files, "Recordings made by `rtbus record`; several lie over each other");
  command.option("--live", options->live_s, "Instead of a file: watch the running session for so many seconds")
      .positive()
      .excludes(file);
  command.option("-s,--session", options->session, "Session for --live; not needed while only one is live")
      .type_name("SESSION");
  command.option("--signals", options->signals,
                 "What to draw: force_n, force_n[1], telemetry.position_m, physics.proxy_state.haptic0.contacts, …\n"
                 "(default: force, position, proxy, wake-up and compute time)");
  command.option("--mark", options->mark, "Time 0 is this mark; without it, of several recordings the first tick")
      .type_name("TEXT");
  command.option("--from", options->from_s, "First second of the recording to draw").show_default();
  command.option("--to", options->to_s, "Last second of it (default: the end)");
  command.option("--title", options->title, "Above the figure (default: session and time)");
  command.option("-o,--output", options->output, "Picture to write, .png or .svg")
      .show_default()
      .check([](const std::string& name) {
        return name.ends_with(".png") || name.ends_with(".svg") ? "" : "must end in .png or .svg";
      });
  return [options]() -> int {
    if (options->files.empty() == !options->live_s.has_value()) {
      return refuse({"name a recording, or watch a running session with --live SECONDS"});
    }
    return options->live_s ? plot_live(*options) : plot_files(*options);
  };
}

}  // namespace tools
