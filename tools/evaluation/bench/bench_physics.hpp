#pragma once
/// @file bench_physics.hpp
/// What a physics step costs on this machine: the shipped scenes awake, pushed and asleep.
#include <string>
#include <vector>

#include "tools/evaluation/shared/experiment.hpp"

namespace tools {

struct BenchPhysicsOptions {
  std::vector<std::string> session_files;  ///< With an engine whose bodies can move.
  std::vector<std::string> assignments;    ///< As of --set, for each session.
  int steps = 1000;                        ///< Measured in each state.
};

/// Steps each session's world with the settings of its physics node in one thread and takes that thread's CPU time of
/// each step. Awake: resting, but not allowed to sleep. Pushed: by the session's proxy, that a hand drives 60 mm along
/// −z within the measured steps, from 30 mm in front of where its mapping puts the device's centre. Asleep: all bodies.
/// Checks: asleep a step costs at most a fifth of an awake one; awake and pushed, 99 of 100 keep the session's period.
/// Throws rtbus::config::Error for a session that cannot be read.
void bench_physics(const BenchPhysicsOptions& options, Experiment& experiment);

}  // namespace tools
