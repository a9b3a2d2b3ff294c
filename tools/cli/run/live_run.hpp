#pragma once
/// @file live_run.hpp
/// One run of a session, from the first process to the last line of the report.
#include <optional>
#include <string>
#include <vector>

#include "tools/cli/run/run_plan.hpp"

namespace tools {

/// As the user gave them.
struct RunOptions {
  std::string file;                      ///< Session file.
  std::optional<double> duration_s;      ///< None: until Ctrl-C.
  std::string report;                    ///< "": none is written.
  std::string plots;                     ///< "": beside the report, if there is one.
  std::vector<std::string> assignments;  ///< --set.
  std::vector<std::string> only;         ///< Nodes of this machine; empty: all.
  std::string record;                    ///< Recording to make from the first tick; "": none.
  std::vector<std::string> record_with;  ///< "bodies", "contacts".
  bool no_plots = false;
  bool stills = false;  ///< Among the plots.
  bool no_bare_loop = false;
  bool no_restart = false;
  bool json = false;
  bool quiet = false;
};

/// Starts what the plan says, follows it for the duration or until Ctrl-C, restarts what crashes meanwhile as the
/// session's `supervise` says, ends it in order, reports. A node that does not come up at the beginning is not
/// restarted: then something is wrong that the user should see.
/// @returns the exit status: 0 when every node did what it should.
[[nodiscard]] int run_session(const RunOptions& options, RunPlan plan);

}  // namespace tools
