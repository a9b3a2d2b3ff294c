#pragma once
/// @file soak.hpp
/// `rtbus evaluate soak`: real sessions that live through kills, observers, E-stops and faults of devices, for minutes
/// or hours, and what they hold and owe at the end.
#include <cstdint>
#include <string>

#include "tools/evaluation/shared/experiment.hpp"

namespace tools {

struct SoakOptions {
  std::string program;       ///< The `rtbus` program.
  std::string session_file;  ///< config/wall_own_plant.yaml; sessions of virtual devices are found beside it.
  double minutes = 1.0;      ///< Shared out among the sessions.
  std::uint64_t seed = 1;    ///< Of the events and their times.
};

void evaluate_soak(const SoakOptions& options, Experiment& experiment);

}  // namespace tools
