// rtbus run: checks a session file and everything around it, then runs the session.
#include <unistd.h>

#include <cstdio>
#include <filesystem>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "rtbus/config/document.hpp"
#include "tools/command.hpp"
#include "tools/live_run.hpp"
#include "tools/run_plan.hpp"

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

int run(const RunOptions& options) {
  RunPlan plan;
  try {
    plan = make_run_plan(options.file, options.assignments);
  } catch (const rtbus::config::Error& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return kExitUsage;
  }
  if (const std::string who = who_is_live(plan.session.name); !who.empty()) {
    std::fprintf(stderr,
                 "rtbus run: session %s is live: %s; end it, or choose another name with "
                 "--set session=NAME\n",
                 plan.session.name.c_str(), who.c_str());
    return kExitFailed;
  }
  std::vector<fs::path> folders;
  if (!options.report.empty()) folders.push_back(fs::path(options.report).parent_path());
  if (!options.plots.empty()) folders.emplace_back(options.plots);
  for (const fs::path& folder : folders) {
    if (const std::string problem = prepare_folder(folder); !problem.empty()) {
      std::fprintf(stderr, "rtbus run: %s\n", problem.c_str());
      return kExitFailed;
    }
  }
  return run_session(options, std::move(plan));
}

}  // namespace

Action add_run(CLI::App& command) {
  const auto options = std::make_shared<RunOptions>();
  command.add_option("session", options->file, "Session file, for example config/wall.yaml")
      ->required()
      ->type_name("FILE");
  command.add_option("--duration", options->duration_s, "How long to run [s]; without it until Ctrl-C")
      ->check(CLI::Range(0.1, 7.0 * 86400.0))
      ->type_name("S");
  command.add_option("--report", options->report, "Write the report (rtbus-report/1, JSON), and figures beside it")
      ->type_name("FILE");
  command.add_option("--set", options->assignments, "Change a key of the session: --set haptic.0.rate_hz=2000")
      ->take_all()
      ->type_name("KEY=VALUE");
  command.add_option("--plots", options->plots, "Folder of the figures; with --report the default is REPORT_plots")
      ->type_name("DIR");
  command.add_flag("--stills", options->stills,
                   "Render the scene at the start, the hardest push and the end, among the figures (needs povray; "
                   "physics publishes body poses meanwhile)");
  command.add_flag("--no-plots", options->no_plots, "No figures");
  command.add_flag("--no-bare-loop", options->no_bare_loop,
                   "Do not run a bare realtime loop beside the haptic loop (it is run with --report)");
  command.add_flag("--no-restart", options->no_restart,
                   "End the session when a node crashes, whatever `supervise` in its file says");
  command.add_flag("--json", options->json, "Print the report as JSON");
  command.add_flag("--quiet", options->quiet, "Neither progress nor the nodes' messages");
  return [options] { return run(*options); };
}

}  // namespace tools
