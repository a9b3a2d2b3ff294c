#pragma once
/// @file fault_checks.hpp
/// What the runs of a row are held against: the promises of docs/safety.md.
#include <vector>

#include "tools/evaluation/faults/fault_outcome.hpp"
#include "tools/evaluation/faults/fault_row.hpp"
#include "tools/evaluation/shared/experiment.hpp"

namespace tools {

/// Adds the checks of a row. Each takes the worst of the runs that were counted. A run that was counted is judged,
/// however busy the machine was: one that was not counted, of another method, excuses nothing.
/// @param runs Those that were counted. @param paused_ms Longest pause of the machine in one that was not. Where `runs`
/// is empty it is why nothing can be judged.
void check_row(const FaultRow& row, const std::vector<FaultOutcome>& runs, double paused_ms, Experiment& experiment);

}  // namespace tools
