#pragma once
/// @file network.hpp
/// `rtbus evaluate network`: what delay, jitter and loss between the haptic node and physics do to force, position and
/// energy, method beside method, against the same hand without a network. Under the simulated clock.
#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "tools/evaluation/shared/experiment.hpp"
#include "tools/evaluation/stability/stability_run.hpp"

namespace tools {

struct NetworkExperiment {
  std::string session_file;              ///< config/wall.yaml
  std::vector<std::string> assignments;  ///< `--set`; stronger than the cells.
  bool quick = false;                    ///< A part of the grid.
  std::size_t sweep = 0;                 ///< So many seeded cases instead of the grid; 0: the grid.
  std::uint64_t first_seed = 1;          ///< Of the sweep.
  int jobs = 0;                          ///< 0: one per core.
  std::vector<std::string> only = {};    ///< Of the cells in real processes: these; empty: all.
  std::string programs = {};             ///< Likewise: the folder of `rtbus` and of what lies beside it.
};

/// Throws rtbus::config::Error.
void evaluate_network(const NetworkExperiment& options, Experiment& experiment);

/// What a cell of the grid is rendered by.
struct NetworkMethod {
  const char* name;    ///< In tables.
  const char* method;  ///< Of the session.
  bool bounds, damps;  ///< Parts of the energy's control (StabilityCase).
  bool lags;           ///< The set-point, against the echo.
  bool both() const noexcept { return bounds && damps; }
};
/// The law of remote coupling alone, with each part of what keeps it passive, and both methods as a session gets them.
[[nodiscard]] const std::vector<NetworkMethod>& network_methods();

/// A cell of the grid: the case, and the same without a network.
[[nodiscard]] StabilityCase network_cell(const NetworkMethod& method, StabilityTask task,
                                         const NetworkOptions& network);

/// A move in free air that is long against every round trip.
[[nodiscard]] StabilityCase network_move(const NetworkMethod& method, const NetworkOptions& network);

/// The case of that number: within the envelope of `evaluate stability`, and behind a network of up to 500 ms there and
/// back, 30 % of jitter and 30 % of loss, in bursts of up to 100 ms.
struct NetworkEnvelope {
  static constexpr double kMaxRoundTripS = 0.5;
  static constexpr double kMaxJitterShare = 0.3;
  static constexpr double kMaxLostShare = 0.3;
  static constexpr double kMaxBurstS = 0.1;
  static constexpr double kMinPhysicsHz = 20.0;
  /// Of bullet: with the 30 of StabilityEnvelope a stack of boxes of a gram that is pressed rattles by itself.
  static constexpr int kIterations = 60;
};
[[nodiscard]] StabilityCase draw_network_case(std::uint64_t seed);

/// Pure. Both runs at the same times; until the shorter one ends. @param from_s Errors count from here on.
[[nodiscard]] TruthError compare_runs(const std::vector<StabilityTick>& run, const std::vector<StabilityTick>& truth,
                                      double from_s);

/// The seeded cases, their tables and checks.
void sweep_networks(const NetworkExperiment& options, Experiment& experiment);

[[nodiscard]] int jobs_of(const NetworkExperiment& options);

}  // namespace tools
