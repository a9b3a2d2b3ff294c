/// `rtbus evaluate EXPERIMENT`: reproducible experiments with their checks, tables and figures.
#include <cstdio>
#include <filesystem>
#include <memory>

#include "rtbus/config/document.hpp"
#include "tools/command.hpp"
#include "tools/experiments/drop.hpp"
#include "tools/experiments/faults.hpp"
#include "tools/experiments/overhead.hpp"
#include "tools/experiments/soft.hpp"
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
    } else if (options.experiment == "soft") {
      SoftOptions soft;
      soft.session_file = options.config.empty() ? find_session("soft.yaml") : options.config;
      soft.assignments = options.assignments;
      soft.real_runs = options.quick ? 1 : 3;
      evaluate_soft(soft, experiment);
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
                  "overhead: what each optional part costs; soft: five soft bodies touched (paper, Figs 17 to 19)")
      ->required()
      ->check(CLI::IsMember({"drop", "faults", "overhead", "soft"}));
  command.add_flag("--quick", options->quick, "Fewer runs");
  command
      .add_option("--set", options->assignments,
                  "Change a key of the session: --set haptic.0.coupling.stiffness_n_per_m=400")
      ->take_all();
  command.add_option("--config", options->config, "Session file; default: the experiment's own");
  command.add_option("--out", options->out, "Folder for the results")->capture_default_str();
  command.add_flag("--json", options->json, "Print summary.json instead of tables");
  return [options] {
    std::string line = "rtbus evaluate " + options->experiment;
    if (options->quick) line += " --quick";
    for (const std::string& text : options->assignments) line += " --set " + text;
    return evaluate(*options, line);
  };
}

}  // namespace tools
