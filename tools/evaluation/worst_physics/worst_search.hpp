#pragma once
/// @file worst_search.hpp
/// The search for the hostile physics that hurts most.
#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "tools/evaluation/worst_physics/worst_case.hpp"

namespace tools {

struct WorstPhysicsOptions {
  std::string session_file;           ///< config/wall.yaml
  std::uint64_t answers = 1'000'000;  ///< Hostile ones, per method.
  std::uint64_t seed = 1;
};

/// What the search found. A lineage makes its case again: hostile_plan().
struct WorstFound {
  std::vector<std::uint64_t> lineage;
  WorstOutcome outcome;
};
struct WorstSearch {
  std::uint64_t answers = 0;
  std::uint64_t cases = 0;
  WorstFound power, growth, recovery;  ///< The hardest of each kind.
  WorstFound trial;                    ///< The one with the most power in its trial: what is changed next.
  std::vector<WorstFound> broken;      ///< Cases in which a promise did not hold.
};

/// Draws plans, and changes the worst ones, until so many hostile answers have been given. The same seed gives the same
/// search. @param after Called after each case; false ends the search.
[[nodiscard]] WorstSearch search_worst_physics(const std::string& method, const WorstPhysicsOptions& options,
                                               const std::function<bool(const WorstSearch&)>& after);

/// Of the error of the recovery to what is allowed.
[[nodiscard]] double recovery_share(const WorstOutcome& outcome) noexcept;

}  // namespace tools
