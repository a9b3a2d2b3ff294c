#pragma once
/// @file engine_checks.hpp
/// The conformance suite of worlds (tests/conformance/worlds), for an engine that is a program of somebody's own: from
/// outside, with the tolerances that it declares.
#include "tools/evaluation/conformance/engine_file.hpp"
#include "tools/evaluation/shared/experiment.hpp"

namespace tools {

/// Runs every case that the engine can be asked for; the others are noted. About 20 s, and what the engine takes to
/// start, five times. Throws rtbus::config::Error.
void check_engine(const EngineFile& engine, Experiment& experiment);

}  // namespace tools
