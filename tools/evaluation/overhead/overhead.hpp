#pragma once
/// @file overhead.hpp
/// `rtbus evaluate overhead`: what each optional part costs, measured by leaving it out and forcing it on in turn.
#include <string>

#include "tools/evaluation/shared/experiment.hpp"

namespace tools {

struct OverheadOptions {
  std::string wall_file;   ///< Session with the analytic engine.
  std::string stack_file;  ///< Session with bodies that move.
  std::string soft_file;   ///< Session with soft bodies.
  int rounds = 5;          ///< Pairs per part; every second one in reverse order.
  double seconds = 3.0;    ///< Of each run.
  bool usb = true;         ///< This build has the USB drivers …
  bool recorder = true;    ///< … and `rtbus record`.
};

/// Runs pairs of real processes, and the harness for the bits; tables, checks and a figure go into `experiment`.
void evaluate_overhead(const OverheadOptions& options, Experiment& experiment);

}  // namespace tools
