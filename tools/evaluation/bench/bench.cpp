/// `rtbus bench WHAT`: figures of this machine.
#include <cstdio>
#include <filesystem>
#include <memory>

#include "rtbus/config/document.hpp"
#include "tools/cli/common/find_config.hpp"
#include "tools/evaluation/bench/bench_bridge.hpp"
#include "tools/evaluation/bench/bench_devices.hpp"
#include "tools/evaluation/bench/bench_external.hpp"
#include "tools/evaluation/bench/bench_physics.hpp"
#include "tools/evaluation/commands.hpp"

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

int bench(const BenchOptions& options, const std::string& command_line) {
  try {
    if (options.what == "devices") {
      Experiment experiment("bench", options.what, command_line, std::filesystem::path(options.out) / options.what);
      return experiment.run([&] { bench_devices({}, experiment); }, options.json);
    }
    if (options.what == "external") {
      Experiment experiment("bench", options.what, command_line, std::filesystem::path(options.out) / options.what);
      const auto measure = [&] {
        bench_external({find_session("wall"), find_session("free_block"), options.quick ? 3.0 : 10.0}, experiment);
      };
      return experiment.run(measure, options.json);
    }
    if (options.what == "bridge") {
      Experiment experiment("bench", options.what, command_line, std::filesystem::path(options.out) / options.what);
      const auto measure = [&] { bench_bridge({find_session("stack_125"), options.quick ? 3.0 : 10.0}, experiment); };
      return experiment.run(measure, options.json);
    }
    BenchPhysicsOptions physics;
    for (const std::string& session : options.sessions) physics.session_files.push_back(find_session(session));
    physics.assignments = options.assignments;
    if (options.quick) physics.steps = 300;
    Experiment experiment("bench", options.what, command_line, std::filesystem::path(options.out) / options.what);
    return experiment.run([&] { bench_physics(physics, experiment); }, options.json);
  } catch (const rtbus::config::Error& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return kExitUsage;
  } catch (const std::exception& error) {
    std::fprintf(stderr, "bench %s: %s\n", options.what.c_str(), error.what());
    return kExitFailed;
  }
}

}  // namespace

Action add_bench(rtbus::Command command) {
  auto options = std::make_shared<BenchOptions>();
  command
      .option("what", options->what,
              "physics: time of a step awake, pushed and asleep; devices: sample to force of each driver; "
              "external: what an engine of your own pays for its answers, and what of the force is lost on the way; "
              "bridge: what rtbus bridge costs, and how long DDS takes")
      .required()
      .one_of({"physics", "devices", "external", "bridge"});
  command.option("--session", options->sessions, "Of physics: session, by name or file; as often as needed")
      .show_default()
      .type_name("FILE|NAME");
  command.flag("--quick", options->quick, "300 steps per state instead of 1000; external, bridge: 3 s instead of 10");
  command.option("--set", options->assignments, "Change a key of each session: --set physics.solver_iterations=20")
      .take_all();
  command.option("--out", options->out, "Folder for the results").show_default();
  command.flag("--json", options->json, "Print summary.json instead of tables");
  return [options] {
    std::string line = "rtbus bench " + options->what;
    if (options->quick) line += " --quick";
    for (const std::string& text : options->assignments) line += " --set " + text;
    return bench(*options, line);
  };
}

}  // namespace tools
