#pragma once
/// @file soft.hpp
/// `rtbus evaluate soft`: five soft bodies pressed and stroked by a scripted hand (He & Choi 2013, Figs 17 to 19).
/// Force profiles of interpolation and of remote virtual coupling, in the harness and in real processes.
#include <string>
#include <vector>

#include "tools/evaluation/shared/experiment.hpp"

namespace tools {

struct SoftOptions {
  std::string session_file;              ///< config/soft.yaml
  std::vector<std::string> assignments;  ///< `--set`; stronger than what the experiment sets.
  int real_runs = 3;                     ///< Of each method, in real processes; 0: none.
  double duration_s = 7.0;               ///< The first stroke of the script.
};

/// Runs all of it, draws it, and checks it against what the paper says.
void evaluate_soft(const SoftOptions& options, Experiment& experiment);

}  // namespace tools
