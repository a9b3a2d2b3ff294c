/// `rtbus conformance ENGINE.yaml`: our worlds' conformance suite on an external engine, from outside.
#include <cstdio>
#include <filesystem>
#include <memory>
#include <string>

#include "rtbus/config/document.hpp"
#include "tools/evaluation/commands.hpp"
#include "tools/evaluation/conformance/engine_checks.hpp"

namespace tools {

namespace {

struct ConformanceOptions {
  std::string file;
  std::string out = "out/conformance";
  bool json = false;
};

int check(const ConformanceOptions& options) {
  try {
    const EngineFile engine = read_engine_file(options.file);
    Experiment experiment("conformance", engine.name, "rtbus conformance " + options.file,
                          std::filesystem::path(options.out) / engine.name);
    return experiment.run([&] { check_engine(engine, experiment); }, options.json);
  } catch (const rtbus::config::Error& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return kExitUsage;
  } catch (const std::exception& error) {
    std::fprintf(stderr, "rtbus conformance: %s\n", error.what());
    return kExitFailed;
  }
}

}  // namespace

Action add_engine_conformance(rtbus::Command command) {
  auto options = std::make_shared<ConformanceOptions>();
  command.option("engine", options->file, "What the engine is and how exact it means to be (schema: engine/1)")
      .required()
      .existing_file()
      .type_name("ENGINE.yaml");
  command.option("--out", options->out, "Folder for the results").show_default();
  command.flag("--json", options->json, "Print summary.json instead of tables");
  command.footer("\nExit status 0: every check passed. docs/your-own-physics.md says what is asked.");
  return [options] { return check(*options); };
}

}  // namespace tools
