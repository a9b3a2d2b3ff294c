// What happens to `rtbus run`: killed, stopped, started twice, and its E-stop.
#include <signal.h>
#include <sys/wait.h>

#include <nlohmann/json.hpp>

#include "tools/cli/orders/order_socket.hpp"
#include "tools/evaluation/faults/fault_session.hpp"
#include "tools/evaluation/faults/helpers.hpp"

namespace tools {

namespace {

constexpr double kStopped_s = 2.0;
constexpr double kBusy_s = 20.0;
constexpr double kWarm_s = 0.3;
constexpr double kTool_s = 20.0;
constexpr int kKilled = 128 + SIGKILL;

void kill_supervisor(FaultSession& cell) {
  cell.mark_fault();
  cell.signal(cell.supervisor(), SIGKILL);
  cell.await_zero();
}

void estop(FaultSession& cell) {
  cell.mark_fault();
  const auto reply = send_order(cell.name(), {{"order", "estop"}, {"reason", "fault"}}, 5.0);
  if (!reply) return cell.fail(reply.error());
  cell.await_zero();
  cell.follow(FaultSession::kHold_s);
  cell.mark_over(rtbus::monotonic_ns());
  const auto rearmed = send_order(cell.name(), {{"order", "rearm"}}, 5.0);
  if (!rearmed) cell.fail(rearmed.error());
}

void on_a_busy_machine(FaultSession& cell, void (*happen)(FaultSession&)) {
  const CpuHogs hogs(hogs_of_a_busy_machine(), -1, 0, kBusy_s);
  if (!hogs.run()) return cell.fail("the CPU hogs could not be started");
  cell.follow(kWarm_s);
  happen(cell);
}

void start_twice(FaultSession& cell) {
  if (cell.start_tool({"run", cell.setup().session_file, "--set", "session=" + cell.name(), "--no-plots"}) == 0) return;
  if (!cell.follow_until(kTool_s, [&] { return cell.tool_end().has_value(); })) {
    return cell.fail("a second session of the same name did not end");
  }
  if (cell.tool_end()->wait_status == 0) cell.fail("a second session of the same name ended with status 0");
}

}  // namespace

std::vector<FaultRow> supervisor_faults() {
  std::vector<FaultRow> out;
  out.push_back({.name = "supervisor_killed",
                 .what = "SIGKILL to `rtbus run`",
                 .zero_ms = kDeviceZero_ms,
                 .ends = Ends::kWithSession,
                 .exit_status = kKilled,
                 .happen = &kill_supervisor});
  out.push_back({.name = "supervisor_killed_busy",
                 .what = "the same beside two CPU hogs per core",
                 .zero_ms = kDeviceZero_ms,
                 .ends = Ends::kWithSession,
                 .exit_status = kKilled,
                 .alone = true,
                 .happen = [](FaultSession& cell) { on_a_busy_machine(cell, &kill_supervisor); }});
  out.push_back({.name = "supervisor_stopped",
                 .what = "SIGSTOP to `rtbus run`, SIGCONT 2 s later",
                 .feels = Feels::kNothing,
                 .happen = [](FaultSession& cell) { cell.stop_for(cell.supervisor(), kStopped_s); }});
  out.push_back({.name = "estop",
                 .what = "an E-stop, re-armed a second later",
                 .zero_ms = kEstopZero_ms,
                 .held = true,
                 .happen = &estop});
  out.push_back({.name = "estop_busy",
                 .what = "the same beside two CPU hogs per core",
                 .zero_ms = kEstopZero_ms,
                 .alone = true,
                 .held = true,
                 .happen = [](FaultSession& cell) { on_a_busy_machine(cell, &estop); }});
  out.push_back({.name = "session_started_twice",
                 .what = "a second `rtbus run` with the name of the session",
                 .feels = Feels::kNothing,
                 .happen = &start_twice});
  return out;
}

}  // namespace tools
