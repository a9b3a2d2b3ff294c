#include "tools/evaluation/worst_physics/worst_physics.hpp"

#include <cstdio>

#include "tools/cli/common/interrupt.hpp"

namespace tools {

namespace {

constexpr const char* kMethods[] = {"remote_virtual_coupling", "local_contact"};

std::string text_of(const std::vector<std::uint64_t>& lineage) {
  std::string out;
  for (const std::uint64_t number : lineage) out += (out.empty() ? "" : " ") + std::to_string(number);
  return out;
}

}  // namespace

void evaluate_worst_physics(const WorstPhysicsOptions& options, Experiment& experiment) {
  Table table{"worst_physics",
              {"method", "hardest in", "power [W]", "bound [W]", "peak [N]", "growth [N/ms]", "recovery error [N]",
               "overspeed cuts", "lineage", "plan"},
              {}};
  for (const char* method : kMethods) {
    std::fprintf(stderr, "worst-physics: %s, %llu answers\n", method, static_cast<unsigned long long>(options.answers));
    const WorstSearch search = search_worst_physics(method, options, [](const WorstSearch&) { return !interrupted(); });
    const auto add = [&](const char* kind, const WorstFound& found) {
      if (found.lineage.empty()) return;
      const WorstOutcome& out = found.outcome;
      table.rows.push_back({std::string(method), std::string(kind), out.power_w, out.bound_w, out.peak_n, out.growth_n,
                            out.recovery_error_n, static_cast<double>(out.overspeeds), text_of(found.lineage),
                            describe(hostile_plan(method, found.lineage))});
    };
    add("power", search.power);
    add("growth", search.growth);
    add("recovery", search.recovery);
    for (const WorstFound& found : search.broken) add("BROKEN", found);
    const std::string id = std::string("worst_physics.") + method;
    const WorstOutcome& worst = search.power.outcome;
    experiment.check_between(id + ".broken", "cases in which a promise of the ladder did not hold",
                             static_cast<double>(search.broken.size()), "", 0.0, 0.0);
    experiment.check_between(id + ".power", "worst mean power to the hand over a minute", worst.power_w, "W",
                             worst.bound_w / 3.0, worst.bound_w);
    experiment.check_at_most(id + ".growth", "worst growth of a force that is not against the motion",
                             search.growth.outcome.growth_n, "N/ms", search.growth.outcome.growth_bound_n);
    experiment.check_at_most(id + ".recovery", "difference from the honest force a second after, share of the bar",
                             recovery_share(search.recovery.outcome), "", 1.0);
    experiment.note(std::string(method) + ": " + std::to_string(search.answers) + " hostile answers in " +
                    std::to_string(search.cases) + " cases");
  }
  experiment.add_table(std::move(table));
}

}  // namespace tools
