/// `rtbus evaluate EXPERIMENT`: reproducible experiments with their checks, tables and figures.
#include <cstdio>
#include <filesystem>
#include <memory>
#include <optional>

#include "rtbus/config/document.hpp"
#include "tools/command.hpp"
#include "tools/experiments/drop.hpp"
#include "tools/experiments/faults.hpp"
#include "tools/experiments/overhead.hpp"
#include "tools/experiments/stability.hpp"
#include "tools/supervisor.hpp"

namespace tools {

namespace {

struct EvaluateOptions {
  std::string experiment;
  std::string out = "out/evaluate";
  std::string config;
  std::vector<std::string> assignments;
  bool quick = false;
  bool json = false;
  std::uint64_t seed = 1;
  std::size_t cases = 0;  ///< 0: the experiment's own number.
  int jobs = 0;           ///< 0: one per core.
  std::optional<std::uint64_t> one_case;
};

/// A session file of the project: from the folder where the command runs, else beside the build
/// (build/bin/../../config).
std::string find_session(const std::string& name) {
  for (const std::string& folder : {std::string("config"), folder_of_this_program() + "/../../config"}) {
    const std::filesystem::path file = std::filesystem::path(folder) / name;
    if (std::filesystem::exists(file)) return std::filesystem::weakly_canonical(file).string();
  }
  throw rtbus::config::Error("config/" + name + " is neither here nor beside the program; name it with --config");
}

int evaluate(const EvaluateOptions& options, const std::string& command_line) {
  try {
    Experiment experiment("evaluate", options.experiment, command_line,
                          std::filesystem::path(options.out) / options.experiment);
    if (options.experiment == "faults") {
      FaultsOptions faults;
      faults.session_file = options.config.empty() ? find_session("wall_own_plant.yaml") : options.config;
      faults.program = folder_of_this_program() + "/rtbus";
      faults.runs = options.quick ? 1 : 3;
      if (!options.assignments.empty()) {
        throw rtbus::config::Error("evaluate faults takes no --set; write a session file");
      }
      evaluate_faults(faults, experiment);
    } else if (options.experiment == "overhead") {
      if (!options.config.empty() || !options.assignments.empty()) {
        throw rtbus::config::Error(
            "evaluate overhead compares sessions of its own: it takes neither --config nor --set");
      }
      OverheadOptions overhead{find_session("wall.yaml"), find_session("stack_125.yaml")};
      if (options.quick) overhead.rounds = 2, overhead.seconds = 1.5;
      evaluate_overhead(overhead, experiment);
    } else if (options.experiment == "stability") {
      StabilityOptions stability;
      stability.session_file = options.config.empty() ? find_session("wall.yaml") : options.config;
      stability.assignments = options.assignments;
      stability.first_seed = options.seed;
      stability.cases = options.cases != 0 ? options.cases : options.quick ? 2'000 : 100'000;
      stability.jobs = options.jobs;
      stability.fine_maps = !options.quick;
      if (options.one_case) return show_stability_case(stability, *options.one_case, experiment.folder());
      evaluate_stability(stability, experiment);
    } else {
      DropOptions drop;
      drop.session_file = options.config.empty() ? find_session("drop_paper.yaml") : options.config;
      drop.assignments = options.assignments;
      drop.real_runs = options.quick ? 1 : 5;
      evaluate_drop(drop, experiment);
    }
    return experiment.finish(options.json);
  } catch (const rtbus::config::Error& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return kExitUsage;
  } catch (const std::exception& error) {
    std::fprintf(stderr, "evaluate %s: %s\n", options.experiment.c_str(), error.what());
    return kExitFailed;
  }
}

}  // namespace

Action add_evaluate(CLI::App& command) {
  auto options = std::make_shared<EvaluateOptions>();
  command
      .add_option("experiment", options->experiment,
                  "drop: free fall onto a wall (paper, Figs 8 to 11); faults: what the hand feels when something dies; "
                  "overhead: what each optional part costs; stability: seeded cases from easy to absurd, and maps")
      ->required()
      ->check(CLI::IsMember({"drop", "faults", "overhead", "stability"}));
  command.add_flag("--quick", options->quick, "Fewer runs");
  command
      .add_option("--set", options->assignments,
                  "Change a key of the session: --set haptic.0.coupling.stiffness_n_per_m=400")
      ->take_all();
  command.add_option("--config", options->config, "Session file; default: the experiment's own");
  command.add_option("--out", options->out, "Folder for the results")->capture_default_str();
  command.add_flag("--json", options->json, "Print summary.json instead of tables");
  command.add_option("--seed", options->seed, "stability: number of the first case")->capture_default_str();
  command.add_option("--cases", options->cases, "stability: how many [100000; with --quick 2000]");
  command.add_option("--jobs", options->jobs, "stability: processes at a time [one per core]");
  command.add_option("--case", options->one_case, "stability: this case alone, with a figure of force and position");
  return [options] {
    std::string line = "rtbus evaluate " + options->experiment;
    if (options->quick) line += " --quick";
    if (options->experiment == "stability") line += " --seed " + std::to_string(options->seed);
    if (options->cases != 0) line += " --cases " + std::to_string(options->cases);
    for (const std::string& text : options->assignments) line += " --set " + text;
    return evaluate(*options, line);
  };
}

}  // namespace tools
