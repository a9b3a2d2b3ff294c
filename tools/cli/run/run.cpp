// rtbus run: checks a session file and everything around it, then runs the session.
#include <unistd.h>

#include <cstdio>
#include <filesystem>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "rtbus/config/document.hpp"
#include "tools/cli/common/command.hpp"
#include "tools/cli/common/find_config.hpp"
#include "tools/cli/run/live_run.hpp"
#include "tools/cli/run/run_plan.hpp"

namespace tools {

namespace {

namespace fs = std::filesystem;

/// Nothing is started for a result that cannot be written. @returns what is wrong, or "".
std::string prepare_folder(const fs::path& folder) {
  std::error_code error;
  const fs::path place = folder.empty() ? fs::path(".") : folder;
  fs::create_directories(place, error);
  if (error) return place.string() + ": " + error.message();
  if (::access(place.c_str(), W_OK) != 0) return place.string() + " may not be written";
  return "";
}

int run(RunOptions options) {
  RunPlan plan;
  try {
    options.file = find_session(options.file);
    plan = make_run_plan(options.file, options.assignments, options.only);
  } catch (const rtbus::config::Error& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return kExitUsage;
  }
  if (const std::string who = who_is_live(plan); !who.empty()) {
    std::fprintf(stderr,
                 "rtbus run: session %s is live: %s; end it, or choose another name with "
                 "--set session=NAME\n",
                 plan.session.name.c_str(), who.c_str());
    return kExitFailed;
  }
  std::vector<fs::path> folders;
  if (!options.report.empty()) folders.push_back(fs::path(options.report).parent_path());
  if (!options.plots.empty()) folders.emplace_back(options.plots);
  if (!options.record.empty()) folders.push_back(fs::path(options.record).parent_path());
  for (const fs::path& folder : folders) {
    if (const std::string problem = prepare_folder(folder); !problem.empty()) {
      std::fprintf(stderr, "rtbus run: %s\n", problem.c_str());
      return kExitFailed;
    }
  }
  if (!options.record.empty() && ::access(options.record.c_str(), F_OK) == 0) {
    std::fprintf(stderr, "rtbus run: %s exists already; choose another name, or remove it first\n",
                 options.record.c_str());
    return kExitFailed;
  }
  return run_session(options, std::move(plan));
}

}  // namespace

Action add_run(rtbus::Command command) {
  const auto options = std::make_shared<RunOptions>();
  command.option("session", options->file, "Session file, or the name of one: wall, stack_125, …")
      .required()
      .type_name("FILE|NAME");
  command.option("--duration", options->duration_s, "How long to run [s]; without it until Ctrl-C")
      .range(0.1, 7.0 * 86400.0)
      .type_name("S");
  command.option("--report", options->report, "Write the report (rtbus-report/1, JSON), and figures beside it")
      .type_name("FILE");
  command.option("--record", options->record, "Record into this file (HDF5) from the first tick").type_name("FILE.h5");
  command.option("--record-with", options->record_with, "Also what a recording leaves out: bodies, contacts")
      .one_of({"bodies", "contacts"})
      .take_all();
  command.option("--set", options->assignments, "Change a key of the session: --set haptic.0.rate_hz=2000")
      .take_all()
      .type_name("KEY=VALUE");
  command
      .option("--only", options->only,
              "Run these nodes alone, physics or haptic nodes; the others run on another machine (link: dds)")
      .take_all()
      .type_name("NODE");
  command.option("--plots", options->plots, "Folder of the figures; with --report the default is REPORT_plots")
      .type_name("DIR");
  command.flag("--stills", options->stills,
               "Render the scene at the hardest push and at the end, among the figures (needs povray; "
               "physics publishes body poses meanwhile)");
  command.flag("--no-plots", options->no_plots, "No figures");
  command.flag("--no-bare-loop", options->no_bare_loop,
               "Do not run a bare realtime loop beside the haptic loop (it is run with --report)");
  command.flag("--no-restart", options->no_restart,
               "End the session when a node crashes, whatever `supervise` in its file says");
  command.flag("--json", options->json, "Print the report as JSON");
  command.flag("--quiet", options->quiet, "Neither progress nor the nodes' messages");
  return [options] { return run(*options); };
}

}  // namespace tools
