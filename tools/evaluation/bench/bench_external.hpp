#pragma once
/// @file bench_external.hpp
/// What the helper of external engines costs (rtbus_engine.h, rtbus.Engine): an empty world in C, C++ and Python,
/// beside the engine in the physics node. And what of the force is lost on the way (external_force.hpp).
#include <string>

#include "tools/evaluation/shared/experiment.hpp"

namespace tools {

struct BenchExternalOptions {
  std::string session_file;  ///< With the analytic engine and remote_virtual_coupling; wall.yaml.
  std::string block_file;    ///< free_block.yaml.
  double seconds = 10.0;     ///< Measured in each state.
};

/// Runs the session as processes with each engine, 500 steps per second and then as many as it can (`pace: free`).
/// Checks: C and C++ add at most 0.1 ms to an answer and Python 0.5 ms (p50); C and C++ make 2000 steps per second and
/// Python 1000; the force error of the free block is within ExternalForce::most_n().
/// Throws rtbus::config::Error.
void bench_external(const BenchExternalOptions& options, Experiment& experiment);

}  // namespace tools
