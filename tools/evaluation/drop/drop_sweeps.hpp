#pragma once
/// @file drop_sweeps.hpp
/// Many falls under the simulated clock: over the phase of the server, the latency of the link and the encoder, and
/// over the parameters that the paper does not print.
#include <vector>

#include "tools/evaluation/drop/drop.hpp"

namespace tools {

/// How often which outcome.
struct CellShares {
  int runs = 0;
  int settled = 0, oscillating = 0, diverged = 0, no_fall = 0;
  std::vector<double> settling_s;  ///< Of the settled ones.
  std::vector<double> rest_mm;     ///< Likewise.

  void add(const FallFigures& figures);
  [[nodiscard]] int count(Outcome outcome) const noexcept;
  /// "settled 0.34 s", "settled 5/8, diverged 3/8".
  [[nodiscard]] std::string text() const;
};

/// 40 server phases × {0, 1, 2} ms latency × encoder quantum off and on; a row of `cells` for each cell.
/// @param worst_share Lowest share of the published outcome in a cell. @returns all runs together.
[[nodiscard]] CellShares sweep_cells(const DropOptions& options, const DropCase& each, Table& cells,
                                     double& worst_share);

/// The run that is drawn: no latency, a phase between two ticks.
[[nodiscard]] FallTrace representative_fall(const DropOptions& options, const DropCase& each);

/// What the outcomes depend on: link rate (the literal 50 Hz), horizon (the literal 1), friction, the server's explicit
/// spring, and the improved form.
[[nodiscard]] std::vector<Table> drop_sensitivity(const DropOptions& options);

}  // namespace tools
