#pragma once
/// @file bench_bridge.hpp
/// What the bridge to ROS 2 costs, and how long a message takes over DDS beside plain UDP. Needs the program
/// rtbus_bridge, and network namespaces.
#include "tools/evaluation/shared/experiment.hpp"

namespace tools {

struct BenchBridgeOptions {
  std::string session_file;  ///< Whose bodies are published.
  double seconds = 10.0;     ///< Of each half.
};

/// First half: a hand at 1 kHz and all bodies of the session at 100 Hz, written by this process; the bridge publishes
/// both at these rates to one reader. Second half: half a round trip over two network namespaces joined by veth, DDS
/// and UDP by turns. All of it in namespaces of its own. Throws rtbus::config::Error.
void bench_bridge(const BenchBridgeOptions& options, Experiment& experiment);

}  // namespace tools
