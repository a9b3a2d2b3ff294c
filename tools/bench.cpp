/// `rtbus bench WHAT`: figures of this machine.
#include <cstdio>
#include <filesystem>
#include <memory>

#include "rtbus/config/document.hpp"
#include "tools/bench_physics.hpp"
#include "tools/command.hpp"
#include "tools/supervisor.hpp"

namespace tools {

namespace {

struct BenchOptions {
  std::string what;
  std::string out = "out/bench";
  std::vector<std::string> sessions{"stack_125", "stack_250", "stack_500", "beads_mm"};
  std::vector<std::string> assignments;
  bool quick = false;
  bool json = false;
};

/// A session by its name or file: as given, else among the project's own, here or beside the build.
std::string find_session(const std::string& name) {
  if (std::filesystem::exists(name)) return name;
  for (const std::string& folder : {std::string("config"), folder_of_this_program() + "/../../config"}) {
    const std::filesystem::path file = std::filesystem::path(folder) / (name + ".yaml");
    if (std::filesystem::exists(file)) return std::filesystem::weakly_canonical(file).string();
  }
  throw rtbus::config::Error(name + " is neither a file nor a session of config/");
}

int bench(const BenchOptions& options, const std::string& command_line) {
  try {
    BenchPhysicsOptions physics;
    for (const std::string& session : options.sessions) physics.session_files.push_back(find_session(session));
    physics.assignments = options.assignments;
    if (options.quick) physics.steps = 300;
    Experiment experiment("bench", options.what, command_line, std::filesystem::path(options.out) / options.what);
    bench_physics(physics, experiment);
    return experiment.finish(options.json);
  } catch (const rtbus::config::Error& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return kExitUsage;
  } catch (const std::exception& error) {
    std::fprintf(stderr, "bench %s: %s\n", options.what.c_str(), error.what());
    return kExitFailed;
  }
}

}  // namespace

Action add_bench(CLI::App& command) {
  auto options = std::make_shared<BenchOptions>();
  command.add_option("what", options->what, "physics: time of a step awake, pushed and asleep")
      ->required()
      ->check(CLI::IsMember({"physics"}));
  command.add_option("--session", options->sessions, "Session, by name or file; as often as needed")
      ->capture_default_str();
  command.add_flag("--quick", options->quick, "300 steps per state instead of 1000");
  command.add_option("--set", options->assignments, "Change a key of each session: --set physics.solver_iterations=20")
      ->take_all();
  command.add_option("--out", options->out, "Folder for the results")->capture_default_str();
  command.add_flag("--json", options->json, "Print summary.json instead of tables");
  return [options] {
    std::string line = "rtbus bench " + options->what;
    if (options->quick) line += " --quick";
    for (const std::string& text : options->assignments) line += " --set " + text;
    return bench(*options, line);
  };
}

}  // namespace tools
