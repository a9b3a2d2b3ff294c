#pragma once
/// @file faults.hpp
/// `rtbus evaluate faults`: what the hand feels when physics dies, stops or hangs, when the haptic node dies, when
/// somebody deletes the topics, and when a maker's device fails.
#include <string>

#include "tools/evaluation/shared/experiment.hpp"

namespace tools {

struct FaultsOptions {
  std::string session_file;  ///< config/wall_own_plant.yaml
  std::string stand_ins;     ///< Folder of the sessions on stand-ins for makers' devices.
  std::string program;       ///< The `rtbus` program.
  int runs = 3;              ///< Of each cell, not counting those in which the machine paused.
  bool quick = false;        ///< One row of each maker's device.
};

/// Runs every cell of fault_cells.hpp and holds the worst of the counted runs against the promises of docs/safety.md.
void evaluate_faults(const FaultsOptions& options, Experiment& experiment);

}  // namespace tools
