#pragma once
/// @file stability.hpp
/// `rtbus evaluate stability`: seeded cases from easy to absurd, each settled, limit cycle or diverged; the declared
/// envelope held against its promise; maps with the boundaries that theory draws.
#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "tools/evaluation/shared/experiment.hpp"
#include "tools/evaluation/stability/stability_run.hpp"

namespace tools {

struct StabilityOptions {
  std::string session_file;                          ///< config/wall.yaml
  std::vector<std::string> assignments;              ///< `--set`; stronger than the cases.
  std::uint64_t first_seed = kSecondGeneration + 1;  ///< Cases are the seeds from here on.
  std::size_t cases = 100'000;
  std::vector<std::uint64_t> seeds;  ///< Not empty: these instead.
  int jobs = 0;                      ///< 0: one per core.
  bool maps = true;
  bool fine_maps = true;  ///< False: a quarter of the cells.
};

void evaluate_stability(const StabilityOptions& options, Experiment& experiment);

/// One seed alone: prints what it is, runs it, draws force and position. @returns the exit status.
int show_stability_case(const StabilityOptions& options, std::uint64_t seed, const std::filesystem::path& folder);

/// Tables, rows (stability_cases.tsv), stability_table.md and the checks of a sweep. @param results Their seeds say
/// what they are.
void report_cases(const std::vector<StabilityResult>& results, Experiment& experiment);

/// A cell of a map and what became of it.
struct MapCell {
  double x = 0.0, y = 0.0;
  StabilityOutcome worst = StabilityOutcome::kSettled;
  double swing_n = 0.0;
  double rendered_n_per_m = 0.0;
};
struct StabilityMap {
  std::string stem;  ///< "map_rate_remote_virtual_coupling"
  std::string title;
  std::string x_label, y_label;
  std::vector<MapCell> cells;
  /// Boundaries: gnuplot's functions of x, with their titles.
  std::vector<std::pair<std::string, std::string>> lines;
};
/// Runs the maps' cells: each under three hands, the worst counts. Empty when somebody interrupted.
[[nodiscard]] std::vector<StabilityMap> run_maps(const StabilityOptions& options, int jobs,
                                                 const std::function<void(std::size_t, std::size_t)>& progress,
                                                 std::vector<StabilityResult>& results);
void draw_maps(Experiment& experiment, const std::vector<StabilityMap>& maps);

}  // namespace tools
