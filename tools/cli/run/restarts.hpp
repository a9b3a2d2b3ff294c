#pragma once
/// @file restarts.hpp
/// The children of a session that have ended by themselves: which of them start again, and when.
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "tools/cli/run/restart_policy.hpp"
#include "tools/cli/run/run_plan.hpp"
#include "tools/cli/run/supervisor.hpp"

namespace tools {

/// Starts nothing itself. Times are CLOCK_MONOTONIC.
class Restarts {
 public:
  /// @param plan Outlives this. @param allowed False: no child starts again, whatever the session file says.
  Restarts(const RunPlan& plan, bool allowed);

  /// A child has ended. With a verdict to restart it is waiting from now on.
  [[nodiscard]] RestartPolicy::Verdict on_end(const ChildEnd& end, std::uint64_t now_ns);

  /// A child whose delay is over; it waits no more.
  [[nodiscard]] std::optional<ChildSpec> take_due(std::uint64_t now_ns);

  /// Names of the children that wait.
  [[nodiscard]] std::vector<std::string> waiting() const;

  /// CPU time of a child's ended processes, all together [s].
  [[nodiscard]] double ended_cpu_s(const std::string& name) const;

 private:
  struct Waiting {
    ChildSpec child;
    std::uint64_t due_ns;
  };
  [[nodiscard]] const ChildSpec* find(const std::string& name) const;

  const RunPlan& plan_;
  rtbus::config::SuperviseConfig rules_;
  std::map<std::string, RestartPolicy> policies_;  ///< By the child's name.
  std::map<std::string, double> ended_cpu_s_;      ///< Likewise.
  std::vector<Waiting> waiting_;
};

}  // namespace tools
