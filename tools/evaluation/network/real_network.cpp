/// `rtbus evaluate network --real`.
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>

#include "rtbus/clock.hpp"
#include "tools/cli/common/formatted.hpp"
#include "tools/cli/common/interrupt.hpp"
#include "tools/cli/common/run_progress.hpp"
#include "tools/cli/run/supervisor.hpp"
#include "tools/evaluation/network/real_cell.hpp"
#include "tools/evaluation/shared/machine_load.hpp"
#include "tools/evaluation/shared/median.hpp"
#include "tools/evaluation/stability/parallel_cases.hpp"

namespace tools {

namespace {

constexpr int kSkipped = 77;           // of two_machines
constexpr double kPatience_s = 120.0;  // of one cell

/// A node opens its device at most so long before its first tick.
constexpr double kEarliest_s = 0.5;

/// Whether a cell swings may depend on which packets are lost: so many seeds of the simulated network.
constexpr std::size_t kSeeds = 9;

/// One cell, both ways.
struct Compared {
  const RealCell* cell = nullptr;
  std::vector<StabilityResult> simulated;  ///< By seed.
  StabilityResult real;

  [[nodiscard]] std::size_t count(NetworkVerdict verdict) const {
    return static_cast<std::size_t>(std::count_if(
        simulated.begin(), simulated.end(), [verdict](const auto& result) { return verdict_of(result) == verdict; }));
  }
  /// The real run is one that the simulated network has too.
  [[nodiscard]] bool agrees() const { return count(verdict_of(real)) > 0; }
  /// "stable", or "stable 3, swings 6" of the seeds.
  [[nodiscard]] std::string simulated_verdicts() const {
    std::string out;
    for (const auto verdict : {NetworkVerdict::kStable, NetworkVerdict::kSwings, NetworkVerdict::kDiverged}) {
      const std::size_t seeds = count(verdict);
      if (seeds == simulated.size()) return to_string(verdict);
      if (seeds > 0) out += formatted("%s%s %zu", out.empty() ? "" : ", ", to_string(verdict), seeds);
    }
    return out;
  }
  template <class Figure>
  [[nodiscard]] double median_of(Figure figure) const {
    std::vector<double> values;
    for (const StabilityResult& result : simulated) values.push_back(figure(result));
    return median(std::move(values));
  }
};

/// Runs the cell's session on two machines. Throws NotPossibleHere; std::runtime_error where it could not be run.
RealRun run_apart(const RealCell& cell, std::uint64_t seed, const NetworkExperiment& options,
                  const std::filesystem::path& folder) {
  const std::string file = (folder / (std::string(cell.name) + ".run")).string();
  std::filesystem::remove(file);
  ChildSpec spec{cell.name,
                 Stage::kHaptic,
                 options.programs + "/two_machines",
                 {"--round-trip-ms", formatted("%.9g", 1e3 * cell.network.round_trip_s), "--jitter",
                  formatted("%.9g", cell.network.jitter_share), "--loss", formatted("%.9g", cell.network.lost_share),
                  "--seed", std::to_string(seed), "--", options.programs + "/rtbus", "evaluate", "network", "--real",
                  "--config", std::filesystem::absolute(options.session_file).string(), "--only", cell.name}};
  for (const std::string& set : options.assignments) spec.arguments.insert(spec.arguments.end(), {"--set", set});
  spec.environment = {{kRealRunVariable, file}};
  std::string skipped;
  Supervisor supervisor([&](const std::string&, std::string_view line) {
    constexpr std::string_view kSays = "SKIPPED: ";
    if (line.starts_with(kSays)) skipped = line.substr(kSays.size());
  });
  if (auto started = supervisor.start(spec); !started) throw std::runtime_error(started.error());
  const std::uint64_t began_ns = rtbus::monotonic_ns();
  std::optional<ChildEnd> end;
  while (!(end = supervisor.poll())) {
    if (!sleep_unless_interrupted(20 * rtbus::kNsPerMs)) throw std::runtime_error("interrupted");
    if (rtbus::seconds_between(began_ns, rtbus::monotonic_ns()) > kPatience_s) {
      throw std::runtime_error(formatted("%s has not ended after %g s", cell.name, kPatience_s));
    }
  }
  if (WIFEXITED(end->wait_status) && WEXITSTATUS(end->wait_status) == kSkipped) throw NotPossibleHere(skipped);
  std::optional<RealRun> run = end->wait_status == 0 ? read_real_run(file) : std::nullopt;
  std::filesystem::remove(file);
  if (run) return *run;
  std::string why = std::string(cell.name) + " " + end->how();
  for (const std::string& line : end->last_words) why += "\n  " + line;
  throw std::runtime_error(why);
}

Compared compare(const RealCell& cell, std::uint64_t seed, const NetworkExperiment& options,
                 const std::filesystem::path& folder) {
  const StabilityCase each = case_of(cell);
  StabilityCase undelayed = each;
  undelayed.network = {};
  std::vector<StabilityTick> trace, truth;
  for (const auto& [run, into] : {std::pair{each, &trace}, std::pair{undelayed, &truth}}) {
    const StabilityResult result = run_case(run, options.session_file, options.assignments, false, into);
    if (result.error[0] != 0) throw std::runtime_error(result.error);
  }
  Compared out{&cell, std::vector<StabilityResult>(kSeeds), {}};
  const auto simulate = [&](std::size_t i) {
    StabilityCase seeded = each;
    seeded.seed = i + 1;
    std::vector<StabilityTick> ticks;
    StabilityResult result = run_case(seeded, options.session_file, options.assignments, false, &ticks);
    result.truth = compare_runs(ticks, truth, each.start_s());
    return result;
  };
  if (!run_cases(kSeeds, jobs_of(options), simulate,
                 [&](const StabilityResult& result) { out.simulated[result.index] = result; })) {
    throw std::runtime_error("interrupted");
  }
  const RealRun real = run_apart(cell, seed, options, folder);
  // A real hand begins when its node opens the device, some time before the first tick. Until it has moved by 0.2 mm it
  // moves as the simulated one behind the same network.
  const double real_s = leaves_start_s(real.trace, each.start_s() - kEarliest_s);
  const double simulated_s = leaves_start_s(trace, each.start_s() - kEarliest_s);
  if (real_s < 0.0 || simulated_s < 0.0) throw std::runtime_error(std::string(cell.name) + ": the hand never moved");
  out.real = real.result;
  out.real.truth = compare_runs(at_times_of(truth, real.trace, real_s - simulated_s), truth, each.start_s());
  return out;
}

Table table_of(const std::vector<Compared>& all) {
  Table table{"network_real",
              {"cell", "round trip [ms]", "jitter [%]", "loss [%]", "simulated", "real", "age, p50, simulated [ms]",
               "real [ms]", "force RMS, simulated [N]", "real [N]", "force peak, simulated [N]", "real [N]",
               "lowest observed, simulated [mJ]", "real [mJ]", "without answer, real [s]"},
              {}};
  for (const Compared& one : all) {
    const NetworkOptions& network = one.cell->network;
    using R = StabilityResult;
    table.rows.push_back({std::string(one.cell->name), 1e3 * network.round_trip_s, 100.0 * network.jitter_share,
                          100.0 * network.lost_share, one.simulated_verdicts(),
                          std::string(to_string(verdict_of(one.real))),
                          1e3 * one.median_of([](const R& r) { return r.age_p50_s; }), 1e3 * one.real.age_p50_s,
                          one.median_of([](const R& r) { return r.truth.force_rms_n; }), one.real.truth.force_rms_n,
                          one.median_of([](const R& r) { return r.truth.force_peak_n; }), one.real.truth.force_peak_n,
                          1e3 * one.median_of([](const R& r) { return r.lowest_observed_j; }),
                          1e3 * one.real.lowest_observed_j, one.real.stale_s});
  }
  return table;
}

}  // namespace

void evaluate_real_network(const NetworkExperiment& options, Experiment& experiment) {
  for (const char* program : {"two_machines", "net_relay", "rtbus_link"}) {
    if (std::filesystem::exists(options.programs + "/" + program)) continue;
    throw NotPossibleHere("no program " + options.programs + "/" + program +
                          "; build the source tree with RTBUS_WITH_DDS, and run the rtbus of its build folder");
  }
  std::vector<const RealCell*> cells;
  for (const RealCell& cell : real_cells()) {
    if (options.only.empty()) cells.push_back(&cell);
  }
  for (const std::string& name : options.only) cells.push_back(&real_cell(name));
  const bool terminal = ::isatty(STDERR_FILENO) == 1;
  RunProgress progress(terminal, true);
  std::vector<Compared> all;
  for (std::size_t i = 0; i < cells.size(); ++i) {
    const RealCell& cell = *cells[i];
    progress.show_share(static_cast<double>(i) / static_cast<double>(cells.size()), cell.name);
    const LoadMeter meter;
    const Compared one = compare(cell, i + 1, options, experiment.folder());
    const std::string verdicts =
        formatted("%s, simulated %s", to_string(verdict_of(one.real)), one.simulated_verdicts().c_str());
    progress.log(formatted("%zu of %zu: %s: %s", i + 1, cells.size(), cell.name, verdicts.c_str()));
    const std::string id = std::string("network.real.") + cell.name;
    const MachineLoad load = meter.read();
    experiment.check_at_most(id + ".verdict",
                             formatted("%s: verdict that no simulated run has (%s)", cell.name, verdicts.c_str()),
                             one.agrees() ? 0.0 : 1.0, "", 0.0, load);
    experiment.check_at_least(id + ".energy", formatted("%s: lowest observed energy", cell.name),
                              1e3 * one.real.lowest_observed_j, "mJ", 1e3 * one.real.deficit_bar_j(), load);
    all.push_back(one);
  }
  progress.clear();
  experiment.add_table(table_of(all));
  experiment.note(formatted(
      "real: two namespaces, real DDS, net_relay between them; simulated: the same cells, medians of %zu seeds",
      kSeeds));
}

}  // namespace tools
