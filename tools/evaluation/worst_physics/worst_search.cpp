#include "tools/evaluation/worst_physics/worst_search.hpp"

#include <algorithm>

namespace tools {

namespace {

/// So many cases are drawn before the worst is changed, and this share of all after that.
constexpr std::uint64_t kDrawnFirst = 8;
constexpr double kDrawnShare = 0.3;
/// A lineage that is longer begins to cost more to explain than it is worth.
constexpr std::size_t kLongestLineage = 24;
/// A case whose trial does not give so much more than the hardest whole case's is left, but for this share: recovery is
/// no matter of power.
constexpr double kWorthAMinute = 1.03;
constexpr double kWholeShare = 0.02;
/// Less power is not worth a minute.
constexpr double kLeastTrial_w = 1.0;

void keep_worst(const WorstFound& found, WorstSearch& search) {
  const WorstOutcome& outcome = found.outcome;
  if (outcome.trial_w > search.trial.outcome.trial_w) search.trial = found;
  if (outcome.power_w > search.power.outcome.power_w) search.power = found;
  if (outcome.growth_n > search.growth.outcome.growth_n) search.growth = found;
  if (recovery_share(outcome) > recovery_share(search.recovery.outcome)) search.recovery = found;
  if (!outcome.holds()) search.broken.push_back(found);
}

}  // namespace

double recovery_share(const WorstOutcome& outcome) noexcept {
  return outcome.recovery_bound_n > 0.0 ? outcome.recovery_error_n / outcome.recovery_bound_n : 0.0;
}

WorstSearch search_worst_physics(const std::string& method, const WorstPhysicsOptions& options,
                                 const std::function<bool(const WorstSearch&)>& after) {
  WorstSearch out;
  Random random(options.seed);
  while (out.answers < options.answers) {
    std::vector<std::uint64_t> lineage;
    const std::vector<std::uint64_t>& worst = out.trial.lineage;
    if (out.cases >= kDrawnFirst && !worst.empty() && !random.chance(kDrawnShare)) lineage = worst;
    if (lineage.size() >= kLongestLineage) lineage.clear();
    if (out.cases == 0) {
      lineage.push_back(kCircling);
    } else {
      lineage.push_back(1 + random.next() % 1'000'000'000);
    }
    WorstSetup setup;
    setup.session_file = options.session_file;
    setup.give_up_below_w =
        random.chance(kWholeShare) ? 0.0 : std::max(kLeastTrial_w, kWorthAMinute * out.power.outcome.trial_w);
    const WorstFound found{lineage, run_worst_case(method, lineage, setup)};
    out.answers += found.outcome.answers;
    ++out.cases;
    keep_worst(found, out);
    if (!after(out)) break;
  }
  return out;
}

}  // namespace tools
