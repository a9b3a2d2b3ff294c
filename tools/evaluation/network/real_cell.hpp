#pragma once
/// @file real_cell.hpp
/// Cells of the grid of `rtbus evaluate network` in real processes over real DDS: a session on two machines, which are
/// namespaces joined by net_relay (tools/network/two_machines).
#include <cstdint>
#include <optional>
#include <stdexcept>
#include <string>
#include <vector>

#include "tools/evaluation/network/network.hpp"

namespace tools {

struct RealCell {
  const char* name;  ///< For --only, and in tables.
  StabilityTask task;
  const char* method;
  NetworkOptions network;
};
[[nodiscard]] const std::vector<RealCell>& real_cells();
/// Throws rtbus::config::Error.
[[nodiscard]] const RealCell& real_cell(const std::string& name);

/// The cell of the grid, with a hand that waits until two machines have found each other over such a network.
[[nodiscard]] StabilityCase case_of(const RealCell& cell);

/// What of a run is compared. A tip that swings on and on is no less wrong than one that runs away.
enum class NetworkVerdict : std::uint8_t { kStable, kSwings, kDiverged };
[[nodiscard]] NetworkVerdict verdict_of(const StabilityResult& result) noexcept;
[[nodiscard]] const char* to_string(NetworkVerdict verdict) noexcept;

/// One run.
struct RealRun {
  StabilityResult result;
  std::vector<StabilityTick> trace;  ///< Times count from the first tick.
};

/// Set by `evaluate_real_network` for the process that it starts on the machine of the hand: the file for its RealRun.
inline constexpr const char* kRealRunVariable = "RTBUS_NETWORK_CELL_FILE";

/// Pure. When the tip of a push has left its start by 0.2 mm; negative: never. @param starts_s Not before then.
[[nodiscard]] double leaves_start_s(const std::vector<StabilityTick>& trace, double starts_s);
/// Pure. The run at the times of `like`, with `later_s` taken off its own; where the shorter one ends, both end.
[[nodiscard]] std::vector<StabilityTick> at_times_of(const std::vector<StabilityTick>& like,
                                                     const std::vector<StabilityTick>& run, double later_s);

/// On the machine of the hand, inside of two_machines: runs the session on both machines and writes what the hand felt.
/// @param program The `rtbus` program. @returns the exit status; why it is not 0 stands on stderr.
[[nodiscard]] int run_real_cell(const RealCell& cell, const std::string& session_file,
                                const std::vector<std::string>& assignments, const std::string& program,
                                const std::string& file);
/// Nothing: `file` holds no whole run.
[[nodiscard]] std::optional<RealRun> read_real_run(const std::string& file);

/// What this machine has no means for. Not a failure, and no result either.
struct NotPossibleHere : std::runtime_error {
  using std::runtime_error::runtime_error;
};

/// All of them, or those of `options.only`, beside the same under the simulated clock. Throws NotPossibleHere.
void evaluate_real_network(const NetworkExperiment& options, Experiment& experiment);

}  // namespace tools
