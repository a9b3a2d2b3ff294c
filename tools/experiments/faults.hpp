#pragma once
/// @file faults.hpp
/// `rtbus evaluate faults`: what the hand feels when physics dies, stops or hangs, when the haptic node dies, and when
/// somebody deletes the topics.
#include <string>

#include "tools/experiment.hpp"

namespace tools {

struct FaultsOptions {
  std::string session_file;  ///< config/wall_own_plant.yaml
  std::string program;       ///< The `rtbus` program.
  int runs = 3;              ///< Of each cell, not counting those in which the machine paused.
};

/// Runs every cell of fault_cells.hpp and holds the worst of the counted runs against the promises of docs/safety.md.
void evaluate_faults(const FaultsOptions& options, Experiment& experiment);

}  // namespace tools
