/// Seeded cases of `rtbus evaluate network --sweep N`.
#include <unistd.h>

#include <algorithm>
#include <fstream>
#include <map>
#include <stdexcept>

#include "tools/cli/common/formatted.hpp"
#include "tools/cli/common/run_progress.hpp"
#include "tools/evaluation/network/network.hpp"
#include "tools/evaluation/stability/parallel_cases.hpp"

namespace tools {

namespace {

constexpr std::size_t kWorstRows = 40;

/// Cases of one method.
struct Tally {
  std::map<StabilityOutcome, std::size_t> outcomes;
  std::size_t cases = 0, growing = 0, below_bar = 0;
  double longest_deficit_s = 0.0, lowest_j = 0.0;

  void add(const StabilityResult& r) {
    ++cases;
    ++outcomes[r.outcome];
    growing += r.growing ? 1U : 0U;
    below_bar += r.lowest_observed_j < r.deficit_bar_j() ? 1U : 0U;
    longest_deficit_s = std::max(longest_deficit_s, r.deficit_s);
    lowest_j = std::min(lowest_j, r.lowest_observed_j);
  }
  [[nodiscard]] double count(StabilityOutcome outcome) const {
    const auto found = outcomes.find(outcome);
    return found == outcomes.end() ? 0.0 : static_cast<double>(found->second);
  }
};

void write_rows(const std::filesystem::path& file, const std::vector<StabilityCase>& cases,
                const std::vector<StabilityResult>& results) {
  std::ofstream tsv(file);
  tsv << "# seed\toutcome\tmethod\ttask\tround trip [s]\tout share\tjitter\tlost\tburst [s]\tin order\tK [N/m]\t"
         "physics [Hz]\tswing [N p-p]\tswing [m p-p]\tdirect at 10 kHz [N p-p]\tpeak [N]\tlowest observed energy [J]\t"
         "in deficit [s]\twithout answer [s]\tcpu [s]\terror\n";
  for (std::size_t i = 0; i < cases.size(); ++i) {
    const StabilityCase& c = cases[i];
    const StabilityResult& r = results[i];
    const NetworkOptions& n = c.network;
    tsv << c.seed << '\t' << to_string(r.outcome) << '\t' << c.method << '\t' << to_string(c.task) << '\t'
        << n.round_trip_s << '\t' << n.out_share << '\t' << n.jitter_share << '\t' << n.lost_share << '\t' << n.burst_s
        << '\t' << !n.reorder << '\t' << c.stiffness_n_per_m << '\t' << c.physics_hz << '\t' << r.swing_n << '\t'
        << r.swing_m << '\t' << r.reference_n << '\t' << r.peak_n << '\t' << r.lowest_observed_j << '\t' << r.deficit_s
        << '\t' << r.stale_s << '\t' << r.cpu_s << '\t' << r.error << '\n';
  }
}

}  // namespace

void sweep_networks(const NetworkExperiment& options, Experiment& experiment) {
  const bool terminal = ::isatty(STDERR_FILENO) == 1;
  RunProgress progress(terminal, !terminal);
  std::vector<StabilityCase> cases;
  for (std::size_t i = 0; i < options.sweep; ++i) cases.push_back(draw_network_case(options.first_seed + i));
  std::vector<StabilityResult> results(cases.size());
  const std::size_t tell_every = std::max<std::size_t>(cases.size() / 20, 1);  // where no bar is drawn
  std::size_t done = 0;
  const bool whole = run_cases(
      cases.size(), jobs_of(options),
      [&](std::size_t i) { return run_case(cases[i], options.session_file, options.assignments); },
      [&](const StabilityResult& result) {
        results[result.index] = result;
        ++done;
        const std::string told = std::to_string(done) + " of " + std::to_string(cases.size()) + " cases";
        progress.show_share(static_cast<double>(done) / static_cast<double>(cases.size()), told);
        if (done % tell_every == 0) progress.log(told);
      });
  progress.clear();
  if (!whole) throw std::runtime_error("interrupted after " + std::to_string(done) + " cases");
  write_rows(experiment.folder() / "network_sweep.tsv", cases, results);

  std::map<std::string, Tally> tallies{{StabilityEnvelope::kRemote, {}}, {StabilityEnvelope::kLocal, {}}};
  Table worst{"network_sweep_worst", {"case", "outcome", "swing [N]", "lowest observed [mJ]", "what"}, {}};
  for (std::size_t i = 0; i < cases.size(); ++i) {
    const StabilityResult& r = results[i];
    tallies[cases[i].method].add(r);
    const bool bad = r.outcome == StabilityOutcome::kDiverged || r.outcome == StabilityOutcome::kFailed ||
                     r.lowest_observed_j < r.deficit_bar_j();
    if (bad && worst.rows.size() < kWorstRows) {
      worst.rows.push_back({static_cast<double>(cases[i].seed), std::string(to_string(r.outcome)), r.swing_n,
                            1e3 * r.lowest_observed_j, describe(cases[i]) + (r.error[0] != 0 ? " " : "") + r.error});
    }
  }
  Table table{"network_sweep_outcomes",
              {"method", "cases", "settled", "moving", "limit cycle", "diverged", "failed", "energy below its bar",
               "lowest observed [mJ]", "longest deficit [ms]"},
              {}};
  for (const auto& [method, tally] : tallies) {
    using O = StabilityOutcome;
    table.rows.push_back({method, static_cast<double>(tally.cases), tally.count(O::kSettled), tally.count(O::kMoving),
                          tally.count(O::kLimitCycle), tally.count(O::kDiverged), tally.count(O::kFailed),
                          static_cast<double>(tally.below_bar), 1e3 * tally.lowest_j, 1e3 * tally.longest_deficit_s});
    const std::string id = "network.sweep." + method;
    experiment.check_at_least(id + ".cases", method + ": cases", static_cast<double>(tally.cases), "", 1.0);
    experiment.check_at_most(id + ".diverged", method + ": diverged", tally.count(O::kDiverged), "cases", 0.0);
    experiment.check_at_most(id + ".failed", method + ": failed", tally.count(O::kFailed), "cases", 0.0);
    experiment.check_at_most(id + ".energy", method + ": observed energy below -(0.5 mJ + |F||dx|)",
                             static_cast<double>(tally.below_bar), "cases", 0.0);
  }
  experiment.add_table(std::move(table));
  if (!worst.rows.empty()) experiment.add_table(std::move(worst));
  experiment.note(formatted("cases %llu to %llu; each with its network in network_sweep.tsv",
                            static_cast<unsigned long long>(options.first_seed),
                            static_cast<unsigned long long>(options.first_seed + options.sweep - 1)));
}

}  // namespace tools
