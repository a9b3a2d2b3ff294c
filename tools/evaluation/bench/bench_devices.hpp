#pragma once
/// @file bench_devices.hpp
/// What each driver adds between a measurement and its force: the wall on every stand-in that runs without hardware,
/// each beside the simulated device with the same mechanics and hand, one after the other.
#include "tools/evaluation/shared/experiment.hpp"

namespace tools {

struct BenchDevicesOptions {
  double duration_s = 4.0;  ///< Of each run; the hand touches the wall after 1.3 s.
};

/// Runs real sessions, with their nodes. Sample to force: from the measurement to the end of the cycle that wrote the
/// force it led to. Checks: each driver takes forces, and its contact force (the largest, and the mean of the last half
/// second) is within 2 % of the simulated device's. Throws rtbus::config::Error.
void bench_devices(const BenchDevicesOptions& options, Experiment& experiment);

}  // namespace tools
