#pragma once
/// @file faults.hpp
/// `rtbus evaluate faults`: what the hand feels when something goes wrong; the rows are those of fault_row.hpp.
#include <string>
#include <vector>

#include "tools/evaluation/shared/experiment.hpp"

namespace tools {

struct FaultsOptions {
  std::string session_file;       ///< config/wall_own_plant.yaml
  std::string stand_ins;          ///< Folder of the sessions on stand-ins for makers' devices.
  std::string program;            ///< The `rtbus` program.
  int runs = 3;                   ///< Of each cell, not counting those in which the machine paused.
  bool quick = false;             ///< One method per row, in turn, and one row of each maker's device.
  std::vector<std::string> only;  ///< Names of rows; empty: all.
};

/// Runs the cells and holds the worst of the counted runs against the promises of docs/safety.md.
/// Throws rtbus::config::Error when `only` names a row that there is not.
void evaluate_faults(const FaultsOptions& options, Experiment& experiment);

/// Prints the rows, one per line, with why some cannot be run here.
void list_faults();

}  // namespace tools
