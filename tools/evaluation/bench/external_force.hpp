#pragma once
/// @file external_force.hpp
/// What of the force is lost on the way through the interface of external engines: nothing, up to a bar.
#include <string>
#include <vector>

#include "tools/evaluation/shared/experiment.hpp"

namespace tools {

/// Force error of the free block against the nearly continuous loop.
struct ExternalForce {
  std::string method;
  double rate_hz = 0.0;    ///< Answers per second.
  double inside_n = 0.0;   ///< RMS with Bullet in the node [N].
  double outside_n = 0.0;  ///< RMS with Bullet behind the interface [N].

  /// The bar: 1.05 times the error in the node, or 5 mN more than it.
  [[nodiscard]] double most_n() const noexcept;
};

/// Both ways, with local_contact and remote_virtual_coupling, at 18, 43 and 100 Hz, under the simulated clock: the same
/// figures on every machine. @param block_file free_block.yaml. Needs Bullet. Throws rtbus::config::Error.
[[nodiscard]] std::vector<ExternalForce> external_forces(const std::string& block_file);

/// A table of them, and a check for each.
void check_external_forces(const std::vector<ExternalForce>& forces, Experiment& experiment);

}  // namespace tools
