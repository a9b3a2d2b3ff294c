/// What the cases of a sweep come to: rows, tables, checks.
#include <algorithm>
#include <array>
#include <cstdio>
#include <fstream>
#include <map>

#include "tools/evaluation/stability/stability.hpp"

namespace tools {

namespace {

constexpr std::size_t kOutcomes = 5;
constexpr std::size_t kWorstRows = 60;

/// Of the cases that are judged together.
struct Group {
  bool paper = false;
  std::array<std::size_t, kOutcomes> outcomes{};
  std::size_t cases = 0, lowered = 0, growing = 0, below_bar = 0, long_deficit = 0, growing_deficit = 0;
  double lowest_observed_j = 0.0, longest_deficit_s = 0.0, observed_error_j = 0.0, cpu_s = 0.0;

  void add(const StabilityCase& each, const StabilityResult& result) {
    paper = each.paper;
    ++outcomes[static_cast<std::size_t>(result.outcome)];
    ++cases;
    if (result.rendered_n_per_m < 0.999 * each.stiffness_n_per_m) ++lowered;
    if (result.growing) ++growing;
    if (result.lowest_observed_j < result.deficit_bar_j()) ++below_bar;
    if (result.deficit_s > kDeficitBarS) ++long_deficit;
    if (result.deficit_growth_j > kDeficitBarJ) ++growing_deficit;
    lowest_observed_j = std::min(lowest_observed_j, result.lowest_observed_j);
    longest_deficit_s = std::max(longest_deficit_s, result.deficit_s);
    observed_error_j = std::max(observed_error_j, result.observed_error_j);
    cpu_s += result.cpu_s;
  }
  [[nodiscard]] double count(StabilityOutcome outcome) const {
    return static_cast<double>(outcomes[static_cast<std::size_t>(outcome)]);
  }
};
using Groups = std::map<std::string, Group>;

std::string group_of(const StabilityCase& each) {
  if (each.envelope) return "in the envelope, `" + each.method + "`";
  if (each.paper) return "paper's form, `" + each.method + "`";
  return "outside, `" + each.method + "`";
}

Group group(const Groups& groups, const std::string& name) {
  const auto found = groups.find(name);
  return found == groups.end() ? Group{} : found->second;
}

/// In the order of a reader: the envelope first, the methods made for slow physics first.
std::vector<const Groups::value_type*> in_order(const Groups& groups) {
  std::vector<const Groups::value_type*> out;
  for (const char* const part : {"in the envelope", "outside", "paper's form"}) {
    const auto add = [&](auto&& wanted) {
      for (const auto& row : groups) {
        if (row.first.rfind(part, 0) == 0 && wanted(row.first)) out.push_back(&row);
      }
    };
    const auto names = [](const std::string& row, const char* method) { return row.find(method) != std::string::npos; };
    add([&](const std::string& row) { return names(row, StabilityEnvelope::kLocal); });
    add([&](const std::string& row) { return names(row, StabilityEnvelope::kRemote); });
    add([&](const std::string& row) {
      return !names(row, StabilityEnvelope::kLocal) && !names(row, StabilityEnvelope::kRemote);
    });
  }
  return out;
}

void write_header(std::ofstream& tsv) {
  tsv << "# seed\toutcome\tenvelope\tmethod\tform\ttask\thand\tK asked [N/m]\tK rendered [N/m]\tB asked [N s/m]\t"
         "B rendered [N s/m]\tphysics [Hz]\tloop [Hz]\tproxy [kg]\tbody/proxy\tfriction\tquantum [m]\tscale\t"
         "speed [m/s]\theight [m]\tdepth [m]\tjitter [s]\tlost\tloop pause [s]\tphysics pause [s]\tboxes\tsolver "
         "iterations\tswing [N p-p]\t"
         "swing [m p-p]\tdirect at 10 kHz [N p-p]\tdirect [m p-p]\tgrowing\tpeak [N]\tclamped [s]\tsettled after [s]\t"
         "lowest observed energy [J]\t|F||dx| of the worst tick [J]\tin deficit [s]\tdeficit growth [J]\tplant work "
         "[J]\t"
         "observed energy error [J]\toverspeed ticks\tpassivity ticks\tcpu [s]\terror\n";
}

void write_row(std::ofstream& tsv, const StabilityCase& c, const StabilityResult& r) {
  tsv << c.seed << '\t' << to_string(r.outcome) << '\t' << c.envelope << '\t' << c.method << '\t'
      << (c.paper ? "paper" : "improved") << '\t' << to_string(c.task) << '\t' << to_string(c.hand) << '\t'
      << c.stiffness_n_per_m << '\t' << r.rendered_n_per_m << '\t' << c.damping_n_s_per_m << '\t'
      << r.rendered_n_s_per_m << '\t' << c.physics_hz << '\t' << c.haptic_hz << '\t' << c.proxy_kg << '\t'
      << c.body_ratio << '\t' << c.friction << '\t' << c.quantum_m << '\t' << c.scale << '\t' << c.speed_m_s << '\t'
      << c.height_m << '\t' << c.depth_m << '\t' << c.jitter_s << '\t' << c.lost_share << '\t' << c.loop_pause_s << '\t'
      << c.physics_pause_s << '\t' << c.boxes << '\t' << c.solver_iterations << '\t' << r.swing_n << '\t' << r.swing_m
      << '\t' << r.reference_n << '\t' << r.reference_m << '\t' << r.growing << '\t' << r.peak_n << '\t' << r.clamped_s
      << '\t' << r.settled_s << '\t' << r.lowest_observed_j << '\t' << r.worst_tick_j << '\t' << r.deficit_s << '\t'
      << r.deficit_growth_j << '\t' << r.plant_work_j << '\t' << r.observed_error_j << '\t' << r.overspeed << '\t'
      << r.passivity << '\t' << r.cpu_s << '\t' << r.error << '\n';
}

/// The bars: in the envelope nothing diverges and the observed energy holds, outside nothing grows.
void check_method(const std::string& method, const Groups& groups, Experiment& experiment) {
  const Group envelope = group(groups, "in the envelope, `" + method + "`");
  const Group outside = group(groups, "outside, `" + method + "`");
  const std::string id = "stability." + method, name = method + ": ";
  experiment.check_at_least(id + ".envelope.cases", name + "cases in the envelope", static_cast<double>(envelope.cases),
                            "", 1.0);
  experiment.check_at_most(id + ".envelope.diverged", name + "diverged in the envelope",
                           envelope.count(StabilityOutcome::kDiverged), "cases", 0.0);
  experiment.check_at_most(id + ".envelope.energy", name + "observed energy below -(0.5 mJ + |F||dx|) in the envelope",
                           static_cast<double>(envelope.below_bar), "cases", 0.0);
  experiment.check_at_most(id + ".envelope.deficit", name + "longest deficit beyond 0.5 mJ in the envelope",
                           envelope.longest_deficit_s * 1e3, "ms", kDeficitBarS * 1e3);
  experiment.check_at_most(id + ".outside.growing", name + "oscillations that grow outside",
                           static_cast<double>(outside.growing), "cases", 0.0);
  experiment.check_at_most(id + ".outside.deficit_growth", name + "deficits that grow outside",
                           static_cast<double>(outside.growing_deficit), "cases", 0.0);
}

void check(const Groups& groups, Experiment& experiment) {
  double failed = 0.0, published = 0.0, diverged = 0.0;
  for (const auto& [name, each] : groups) {
    failed += each.count(StabilityOutcome::kFailed);
    if (!each.paper) continue;
    published += static_cast<double>(each.cases);
    diverged += each.count(StabilityOutcome::kDiverged);
  }
  experiment.check_at_most("stability.failed", "not finite or above the limit in any tick, all methods", failed,
                           "cases", 0.0);
  check_method(StabilityEnvelope::kLocal, groups, experiment);
  const auto drawn = [&](const char* method) {
    return group(groups, "in the envelope, `" + std::string(method) + "`").cases > 0;
  };
  // The third generation of the rules draws the default in place of remote coupling.
  const bool third = drawn(StabilityEnvelope::kDefault);
  if (third) check_method(StabilityEnvelope::kDefault, groups, experiment);
  if (!third || drawn(StabilityEnvelope::kRemote)) check_method(StabilityEnvelope::kRemote, groups, experiment);
  // A sweep in which nothing diverges would not have looked.
  if (published > 0.0) {
    experiment.check_at_least("stability.paper.diverged", "diverged with the methods as published", diverged, "cases",
                              1.0);
  }
}

/// The table of docs/results.md.
void write_markdown(const Groups& groups, const std::filesystem::path& file) {
  std::ofstream out(file);
  out << "| Cases | run | settled | moving | limit cycle | diverged | failed | growing | energy below its limit | "
         "deficit "
         "over "
         "50 ms | deficit growing |\n|---|---|---|---|---|---|---|---|---|---|---|\n";
  for (const auto* row : in_order(groups)) {
    const Group& each = row->second;
    out << "| " << row->first << " | " << each.cases;
    for (std::size_t i = 0; i < kOutcomes; ++i) out << " | " << each.outcomes[i];
    out << " | " << each.growing;
    if (each.paper) {
      out << " | – | – | – |\n";
    } else {
      out << " | " << each.below_bar << " | " << each.long_deficit << " | " << each.growing_deficit << " |\n";
    }
  }
}

Table outcomes_table(const Groups& groups) {
  Table table{"stability_outcomes",
              {"cases", "run", "settled", "moving", "limit cycle", "diverged", "failed", "stiffness lowered", "growing",
               "energy below its limit", "deficit over 50 ms", "deficit growing", "lowest observed energy [mJ]",
               "observed energy error [mJ]", "cpu per case [ms]"},
              {}};
  for (const auto* line : in_order(groups)) {
    const Group& each = line->second;
    std::vector<Cell> row{line->first, static_cast<double>(each.cases)};
    for (const std::size_t outcome : each.outcomes) row.emplace_back(static_cast<double>(outcome));
    for (const std::size_t n : {each.lowered, each.growing, each.below_bar, each.long_deficit, each.growing_deficit}) {
      row.emplace_back(static_cast<double>(n));
    }
    row.insert(row.end(), {each.lowest_observed_j * 1e3, each.observed_error_j * 1e3,
                           each.cpu_s / static_cast<double>(std::max<std::size_t>(1, each.cases)) * 1e3});
    table.rows.push_back(std::move(row));
  }
  return table;
}

/// What breaks a bar.
bool is_bad(const StabilityCase& each, const StabilityResult& result) {
  if (result.outcome == StabilityOutcome::kFailed) return true;
  if (each.paper) return false;
  const bool judged = each.method == StabilityEnvelope::kRemote || each.method == StabilityEnvelope::kLocal ||
                      each.method == StabilityEnvelope::kDefault;
  if (each.envelope) {
    return result.outcome == StabilityOutcome::kDiverged || result.lowest_observed_j < result.deficit_bar_j() ||
           result.deficit_s > kDeficitBarS;
  }
  return judged && (result.growing || result.deficit_growth_j > kDeficitBarJ);
}

}  // namespace

void report_cases(const std::vector<StabilityResult>& results, Experiment& experiment) {
  Groups groups;
  std::ofstream tsv(experiment.folder() / "stability_cases.tsv");
  write_header(tsv);
  Table worst{"stability_worst",
              {"seed", "outcome", "swing [N]", "swing [mm]", "grows", "deficit [ms]", "deficit growth [mJ]", "what"},
              {}};
  double cpu_s = 0.0;
  std::size_t bad = 0;
  for (const StabilityResult& result : results) {
    const StabilityCase each = draw_case(result.seed);
    groups[group_of(each)].add(each, result);
    cpu_s += result.cpu_s;
    write_row(tsv, each, result);
    if (!is_bad(each, result) || ++bad > kWorstRows) continue;
    worst.rows.push_back({std::to_string(result.seed), std::string(to_string(result.outcome)), result.swing_n,
                          result.swing_m * 1e3, std::string(result.growing ? "yes" : ""), result.deficit_s * 1e3,
                          result.deficit_growth_j * 1e3,
                          describe(each) + (result.error[0] != 0 ? ": " : "") + result.error});
  }
  experiment.add_table(outcomes_table(groups));
  if (!worst.rows.empty()) experiment.add_table(std::move(worst));
  if (bad > kWorstRows) experiment.note(std::to_string(bad) + " cases break a bar; the first are shown");
  write_markdown(groups, experiment.folder() / "stability_table.md");
  experiment.note(
      "stability_table.md has the outcomes as docs/results.md shows them; " +
      std::to_string(static_cast<int>(cpu_s * 1e6 / static_cast<double>(std::max<std::size_t>(1, results.size())))) +
      " us of CPU per case");
  check(groups, experiment);
}

}  // namespace tools
