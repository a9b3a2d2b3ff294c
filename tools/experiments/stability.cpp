#include "tools/experiments/stability.hpp"

#include <unistd.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <fstream>
#include <map>
#include <thread>

#include "tools/command.hpp"
#include "tools/experiments/parallel_cases.hpp"
#include "tools/gnuplot.hpp"
#include "tools/run_progress.hpp"

namespace tools {

namespace {

constexpr std::size_t kOutcomes = 5;

/// Of the cases that are judged together.
struct Group {
  std::array<std::size_t, kOutcomes> outcomes{};
  std::size_t cases = 0, lowered = 0, growing = 0, below_bar = 0, long_debt = 0, growing_debt = 0, not_settled = 0;
  double lowest_ledger_j = 0.0, longest_debt_s = 0.0, ledger_error_j = 0.0, cpu_s = 0.0;

  void add(const StabilityCase& each, const StabilityResult& result) {
    ++outcomes[static_cast<std::size_t>(result.outcome)];
    ++cases;
    if (result.rendered_n_per_m < 0.999 * each.stiffness_n_per_m) ++lowered;
    if (result.growing) ++growing;
    if (result.lowest_ledger_j < result.debt_bar_j()) ++below_bar;
    if (result.debt_s > kDebtBarS) ++long_debt;
    if (result.debt_growth_j > kDebtBarJ) ++growing_debt;
    lowest_ledger_j = std::min(lowest_ledger_j, result.lowest_ledger_j);
    longest_debt_s = std::max(longest_debt_s, result.debt_s);
    ledger_error_j = std::max(ledger_error_j, result.ledger_error_j);
    cpu_s += result.cpu_s;
  }
  [[nodiscard]] double count(StabilityOutcome outcome) const {
    return static_cast<double>(outcomes[static_cast<std::size_t>(outcome)]);
  }
};

std::string group_of(const StabilityCase& each) {
  if (each.envelope) return "in the envelope, default method";
  if (each.paper) return "outside, paper's form, " + each.method;
  return "outside, " + each.method;
}

void write_header(std::ofstream& tsv) {
  tsv << "# seed\toutcome\tenvelope\tmethod\tform\ttask\thand\tK asked [N/m]\tK rendered [N/m]\tB asked [N s/m]\t"
         "B rendered [N s/m]\tphysics [Hz]\tloop [Hz]\tproxy [kg]\tbody/proxy\tfriction\tquantum [m]\tscale\t"
         "speed [m/s]\theight [m]\tdepth [m]\tjitter [s]\tlost\tloop pause [s]\tphysics pause [s]\tswing [N p-p]\t"
         "swing [m p-p]\tdirect at 10 kHz [N p-p]\tdirect [m p-p]\tgrowing\tpeak [N]\tclamped [s]\tsettled after [s]\t"
         "lowest ledger [J]\t|F||dx| of the worst tick [J]\tin debt [s]\tdebt growth [J]\tplant work [J]\t"
         "ledger error [J]\toverspeed ticks\tpassivity ticks\tcpu [s]\terror\n";
}

void write_row(std::ofstream& tsv, const StabilityCase& c, const StabilityResult& r) {
  tsv << c.seed << '\t' << to_string(r.outcome) << '\t' << c.envelope << '\t' << c.method << '\t'
      << (c.paper ? "paper" : "improved") << '\t' << to_string(c.task) << '\t' << to_string(c.hand) << '\t'
      << c.stiffness_n_per_m << '\t' << r.rendered_n_per_m << '\t' << c.damping_n_s_per_m << '\t'
      << r.rendered_n_s_per_m << '\t' << c.physics_hz << '\t' << c.haptic_hz << '\t' << c.proxy_kg << '\t'
      << c.body_ratio << '\t' << c.friction << '\t' << c.quantum_m << '\t' << c.scale << '\t' << c.speed_m_s << '\t'
      << c.height_m << '\t' << c.depth_m << '\t' << c.jitter_s << '\t' << c.lost_share << '\t' << c.loop_pause_s << '\t'
      << c.physics_pause_s << '\t' << r.swing_n << '\t' << r.swing_m << '\t' << r.reference_n << '\t' << r.reference_m
      << '\t' << r.growing << '\t' << r.peak_n << '\t' << r.clamped_s << '\t' << r.settled_s << '\t'
      << r.lowest_ledger_j << '\t' << r.worst_tick_j << '\t' << r.debt_s << '\t' << r.debt_growth_j << '\t'
      << r.plant_work_j << '\t' << r.ledger_error_j << '\t' << r.overspeed << '\t' << r.passivity << '\t' << r.cpu_s
      << '\t' << r.error << '\n';
}

void check(const std::map<std::string, Group>& groups, Experiment& experiment) {
  Group all, outside;
  for (const auto& [name, group] : groups) {
    all.outcomes[4] += group.outcomes[4];
    if (name == "outside, " + std::string(StabilityEnvelope::kMethod)) outside = group;
  }
  const auto found = groups.find("in the envelope, default method");
  const Group envelope = found == groups.end() ? Group{} : found->second;
  experiment.check_at_least("stability.envelope.cases", "cases in the envelope", static_cast<double>(envelope.cases),
                            "", 1.0);
  experiment.check_at_most("stability.envelope.diverged", "diverged in the envelope",
                           envelope.count(StabilityOutcome::kDiverged), "cases", 0.0);
  experiment.check_at_most("stability.failed", "not finite or above the limit, anywhere",
                           all.count(StabilityOutcome::kFailed), "cases", 0.0);
  experiment.check_at_most("stability.envelope.ledger", "ledger below -(0.5 mJ + |F||dx|) in the envelope",
                           static_cast<double>(envelope.below_bar), "cases", 0.0);
  experiment.check_at_most("stability.envelope.debt", "longest debt beyond 0.5 mJ in the envelope",
                           envelope.longest_debt_s * 1e3, "ms", kDebtBarS * 1e3);
  experiment.check_at_most("stability.outside.growing", "oscillations that grow outside, default method",
                           static_cast<double>(outside.growing), "cases", 0.0);
  experiment.check_at_most("stability.outside.debt_growth", "debts that grow outside, default method",
                           static_cast<double>(outside.growing_debt), "cases", 0.0);
}

int jobs_of(const StabilityOptions& options) {
  return options.jobs > 0 ? options.jobs : static_cast<int>(std::max(1U, std::thread::hardware_concurrency()));
}

}  // namespace

void evaluate_stability(const StabilityOptions& options, Experiment& experiment) {
  RunProgress progress(::isatty(STDERR_FILENO) == 1, false);
  std::map<std::string, Group> groups;
  std::vector<StabilityResult> results(options.cases);
  std::size_t done = 0;
  const auto work = [&](std::size_t i) {
    return run_case(draw_case(options.first_seed + i), options.session_file, options.assignments);
  };
  const bool whole = run_cases(options.cases, jobs_of(options), work, [&](const StabilityResult& result) {
    StabilityResult& kept = results[result.index] = result;
    kept.seed = options.first_seed + result.index;
    if (++done % 20 == 0) {
      progress.show_share(static_cast<double>(done) / static_cast<double>(options.cases),
                          std::to_string(done) + " of " + std::to_string(options.cases) + " cases");
    }
  });
  progress.clear();
  if (!whole) throw std::runtime_error("interrupted after " + std::to_string(done) + " cases");

  if (options.maps) {
    std::vector<StabilityResult> cells;
    const auto show = [&](std::size_t ready, std::size_t of) {
      progress.show_share(static_cast<double>(ready) / static_cast<double>(of),
                          std::to_string(ready) + " of " + std::to_string(of) + " cells of the maps");
    };
    draw_maps(experiment, run_maps(options, jobs_of(options), show, cells));
    progress.clear();
    experiment.note(std::to_string(cells.size()) + " more cases are in the maps");
  }

  std::ofstream tsv(experiment.folder() / "stability_cases.tsv");
  write_header(tsv);
  Table worst{"stability_worst", {"seed", "outcome", "swing [N]", "swing [mm]", "what"}, {}};
  for (const StabilityResult& result : results) {
    const StabilityCase each = draw_case(result.seed);
    groups[group_of(each)].add(each, result);
    write_row(tsv, each, result);
    const bool bad =
        result.outcome == StabilityOutcome::kFailed || (each.envelope && result.outcome == StabilityOutcome::kDiverged);
    if (bad && worst.rows.size() < 20) {
      worst.rows.push_back({std::to_string(result.seed), std::string(to_string(result.outcome)), result.swing_n,
                            result.swing_m * 1e3, describe(each) + (result.error[0] != 0 ? ": " : "") + result.error});
    }
  }
  Table table{"stability_outcomes",
              {"cases", "run", "settled", "moving", "limit cycle", "diverged", "failed", "stiffness lowered",
               "ledger below bar", "debt over 50 ms", "growing", "lowest ledger [mJ]", "ledger error [mJ]",
               "cpu per case [ms]"},
              {}};
  for (const auto& [name, group] : groups) {
    std::vector<Cell> row{name, static_cast<double>(group.cases)};
    for (const std::size_t outcome : group.outcomes) row.emplace_back(static_cast<double>(outcome));
    row.insert(row.end(), {static_cast<double>(group.lowered), static_cast<double>(group.below_bar),
                           static_cast<double>(group.long_debt), static_cast<double>(group.growing),
                           group.lowest_ledger_j * 1e3, group.ledger_error_j * 1e3,
                           group.cpu_s / static_cast<double>(std::max<std::size_t>(1, group.cases)) * 1e3});
    table.rows.push_back(std::move(row));
  }
  experiment.add_table(std::move(table));
  if (!worst.rows.empty()) experiment.add_table(std::move(worst));
  check(groups, experiment);
}

int show_stability_case(const StabilityOptions& options, std::uint64_t seed, const std::filesystem::path& folder) {
  const StabilityCase each = draw_case(seed);
  std::printf("case %llu: %s\n", static_cast<unsigned long long>(seed), describe(each).c_str());
  for (const std::string& text : assignments_of(each)) std::printf("  --set '%s'\n", text.c_str());
  std::vector<StabilityTick> ticks;
  const StabilityResult r = run_case(each, options.session_file, options.assignments, true, &ticks);
  std::printf(
      "%s%s; swing %.4g N, %.4g mm p-p; direct at 10 kHz %.4g N, %.4g mm; peak %.4g N, clamped %.3g s\n"
      "rendered %.4g N/m, %.4g N s/m; ledger at least %.4g mJ (bar %.4g), in debt %.4g s; true work of the plant "
      "%.4g mJ, ledger off by %.3g mJ; settled after %.3g s of %.3g s%s%s\n",
      to_string(r.outcome), r.growing ? ", growing" : "", r.swing_n, r.swing_m * 1e3, r.reference_n,
      r.reference_m * 1e3, r.peak_n, r.clamped_s, r.rendered_n_per_m, r.rendered_n_s_per_m, r.lowest_ledger_j * 1e3,
      r.debt_bar_j() * 1e3, r.debt_s, r.plant_work_j * 1e3, r.ledger_error_j * 1e3, r.settled_s, r.simulated_s,
      r.error[0] != 0 ? "; " : "", r.error);
  const std::string stem = "case_" + std::to_string(seed);
  std::ofstream tsv(folder / (stem + ".tsv"));
  tsv << "# time [s]\ttip [mm]\tforce [N]\tproxy [mm]\tledger [mJ]\tforce of the law [N]\n";
  for (const StabilityTick& t : ticks) {
    tsv << t.time_s << '\t' << t.height_m * 1e3 << '\t' << t.force_n << '\t' << t.proxy_m * 1e3 << '\t'
        << t.ledger_j * 1e3 << '\t' << t.law_n << '\n';
  }
  tsv.close();
  if (const auto gnuplot = Gnuplot::find()) {
    Figure figure;
    figure.stem = stem;
    figure.height_px = 900;
    const std::string file = gnuplot_quoted(stem + ".tsv");
    figure.body = "set multiplot layout 3,1 title " +
                  gnuplot_quoted("case " + std::to_string(seed) + ", " + to_string(r.outcome)) +
                  "\nset grid lc rgb 'gray80'\nset lmargin 9\nset ylabel 'position [mm]'\nplot " + file +
                  " using 1:2 with lines lw 2 title 'tip', '' using 1:4 with lines title 'proxy'\n"
                  "set ylabel 'force [N]'\nplot " +
                  file +
                  " using 1:3 with lines lw 2 title 'sent', '' using 1:(abs($6)<20?$6:NaN) with lines title 'law'\n"
                  "set ylabel 'ledger [mJ]'\nset xlabel 'time [s]'\nplot " +
                  file + " using 1:5 with lines notitle\nunset multiplot\n";
    const auto drawn = gnuplot->draw(folder, figure);
    if (drawn) std::printf("drawn: %s\n", drawn->front().c_str());
  }
  return r.outcome == StabilityOutcome::kFailed ? kExitFailed : kExitFine;
}

}  // namespace tools
