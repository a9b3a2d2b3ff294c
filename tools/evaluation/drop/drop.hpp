#pragma once
/// @file drop.hpp
/// `rtbus evaluate drop`: the free-fall benchmark of He & Choi (2013), section IV, Figs 8 to 11. The tip is let go 20
/// mm above a wall; six published outcomes, each in the harness over phases, latencies and encoders, and in real
/// processes.
#include <span>
#include <string>
#include <vector>

#include "tools/evaluation/drop/fall.hpp"
#include "tools/evaluation/shared/experiment.hpp"

namespace tools {

struct DropOptions {
  std::string session_file;              ///< config/drop_paper.yaml
  std::vector<std::string> assignments;  ///< `--set`; stronger than what the experiment sets.
  int real_runs = 5;                     ///< Per outcome, in real processes.
};

/// A published outcome.
struct DropCase {
  const char* id;      ///< "fig9_interpolation"
  const char* figure;  ///< "Fig. 9"
  const char* method;  ///< As in YAML.
  double stiffness_n_per_m;
  double damping_n_s_per_m;
  const char* published;  ///< In the paper's words, shortened.
  Outcome outcome;        ///< What we take them for.
  double settling_low_s;  ///< Bars of our settling time; 0: none.
  double settling_high_s;
  double fall_s;  ///< How long to watch after the release.
};
[[nodiscard]] std::span<const DropCase> drop_cases() noexcept;

/// The session for one case: its method and gains, end stops off (a tip that runs away must be seen to), then `--set`.
[[nodiscard]] FallSetup drop_setup(const DropOptions& options, const DropCase& each, double release_s);

/// Of the drop: heights for Fig. 8, forces for the others, as the paper draws them.
[[nodiscard]] FallLimits drop_limits(const DropCase& each) noexcept;

/// Runs all of it, draws it, and checks it against the published outcomes.
void evaluate_drop(const DropOptions& options, Experiment& experiment);

/// A curve of a figure: its data are in `<stem>.tsv` (time since release [s], height [mm], force [N]).
struct DropCurve {
  std::string stem;
  std::string title;
  std::string style;  ///< gnuplot: "lw 2 lc rgb 'black'"
};
/// Height above force over time.
struct DropFigure {
  std::string stem;
  std::string title;
  std::vector<DropCurve> curves = {};
  double end_s = 1.0;
  double height_low_mm = 0.0, height_high_mm = 0.0;  ///< Equal: as the data ask.
  double force_low_n = 0.0, force_high_n = 0.0;      ///< Likewise.
  double marked_s = 0.0;                             ///< A published time; 0: none.
  std::string mark = {};
};
void write_fall(const std::filesystem::path& file, const FallTrace& trace);
void draw_drop(Experiment& experiment, const std::vector<DropFigure>& figures);

}  // namespace tools
