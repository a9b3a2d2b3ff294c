#pragma once
/// @file precision_pile.hpp
/// How calm a pile feels that is pushed through: each method on slow physics beside what is really there, the pile at
/// full rate without latency, at equal mean force.
#include <string>
#include <vector>

#include "tools/cli/common/run_progress.hpp"
#include "tools/evaluation/shared/experiment.hpp"

namespace tools {

struct PrecisionPileOptions {
  std::vector<std::string> session_files;  ///< stack_125.yaml and its like.
  std::vector<std::string> assignments;    ///< After the experiment's own.
  bool quick = false;                      ///< The first session alone, one stiffness, three starts of the others.
};

/// One table, from slightly different starts, with 95 % confidence intervals; the device without quanta, whose encoder
/// is rougher than any of it. The hand of remote coupling is made softer until its mean force and that at full rate
/// agree within 10 % or their intervals, where that can be. Checks, over ten starts, that local_contact at 18 Hz is no
/// rougher than the truth and has its mean force. Throws rtbus::config::Error.
void evaluate_precision_pile(const PrecisionPileOptions& options, Experiment& experiment, RunProgress& progress);

}  // namespace tools
