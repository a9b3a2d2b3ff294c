#pragma once
/// @file run_plots.hpp
/// The figures of a run: motion and force, wake-up latency, age of the proxy, time of the physics steps.
#include <filesystem>
#include <string>
#include <vector>

#include "tools/cli/host/bare_loop.hpp"
#include "tools/cli/run/run_observer.hpp"

namespace tools {

struct RunPlots {
  std::filesystem::path folder;  ///< Made when missing.
  std::string session;
  std::vector<const HapticObserver*> haptic;
  const BareLoop* bare = nullptr;  ///< Ran beside the first of `haptic`; null: not at all.
};

struct RunPlotsOutcome {
  std::vector<std::string> files;  ///< PNG and SVG, in order of their importance.
  std::string problem;             ///< Why some are missing; empty when none is. The data are written in any case.
};

/// Writes the data and draws what there is data for.
[[nodiscard]] RunPlotsOutcome draw_run_plots(const RunPlots& plots);

}  // namespace tools
