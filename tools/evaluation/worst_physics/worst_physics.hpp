#pragma once
/// @file worst_physics.hpp
/// `rtbus evaluate worst-physics`: the search for the hostile physics that hurts most, held against docs/safety.md.
#include "tools/evaluation/shared/experiment.hpp"
#include "tools/evaluation/worst_physics/worst_search.hpp"

namespace tools {

void evaluate_worst_physics(const WorstPhysicsOptions& options, Experiment& experiment);

}  // namespace tools
