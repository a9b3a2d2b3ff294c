#pragma once
/// @file precision_shown.hpp
/// Piles are chaotic, so that two loops that push into one soon push into different ones. Here each method meets the
/// same pile: one world at full rate without latency is recorded, and every method sees its answers decimated and one
/// period late, while the hand moves as it did.
#include <functional>
#include <vector>

#include "tools/cli/common/run_progress.hpp"
#include "tools/evaluation/shared/experiment.hpp"
#include "tools/evaluation/work_precision/precision_run.hpp"

namespace tools {

/// A pile and its slightly different starts: `scene(start)`.
struct ShownPile {
  std::string name;
  std::function<PrecisionScene(int start)> scene;
};

/// A table and a figure of the first pile's first start at every rate: error against the force that the full rate gave;
/// a second table of every pile at 18 Hz, medians over `starts` starts, beside the roughness of what was there. Checks
/// that the error falls with the rate. Throws rtbus::config::Error.
///
/// local_contact gets less from it than from its own loop: its proxy is a state of the loop, not of the world, and
/// where that has slid to on the cubes is not told. At full rate and without latency its error is exactly zero; one
/// tick later, with the same hand and world, the proxy sticks elsewhere.
/// @returns the first table. Its columns: method, physics [Hz], force RMS [N], …
Table show_piles(const std::vector<ShownPile>& piles, int starts, Experiment& experiment, RunProgress& progress);

}  // namespace tools
