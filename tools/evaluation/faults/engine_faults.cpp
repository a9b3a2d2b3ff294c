// Physics of the user's own (`engine: external`), here in Python, that misbehaves.
#include <unistd.h>

#include <algorithm>
#include <fstream>

#include "tools/evaluation/faults/fault_session.hpp"
#include "tools/evaluation/faults/python_engine.hpp"

namespace tools {

namespace {

constexpr double kBegins_s = 5.0;
constexpr std::uint64_t kTriggerLook_ns = 5 * rtbus::kNsPerMs;

void let_fail(FaultSession& cell, const PythonFault& fault) {
  std::ofstream(cell.trigger()).flush();
  if (!cell.follow_until(kBegins_s, [&] { return ::access(cell.trigger().c_str(), F_OK) != 0; })) {
    return cell.fail("the engine never began to fail");
  }
  cell.mark_fault_at(rtbus::monotonic_ns() - kTriggerLook_ns);  // it began within the last look
  const std::uint64_t began_ns = cell.outcome().fault_ns;
  if (fault.ends_in_zero) cell.await_zero();
  cell.follow(std::max(FaultSession::kHold_s, fault.lasts_s));
  if (fault.lasts_s > 0.0) cell.mark_over(began_ns + rtbus::ns_of(fault.lasts_s));
}

FaultRow row_of(const PythonFault& fault) {
  FaultRow row;
  row.name = fault.name;
  row.what = fault.what;
  row.feels = fault.ends_in_zero ? Feels::kZero : Feels::kAnything;
  row.zero_ms = !fault.ends_in_zero ? 0.0 : fault.beats_on ? kHangZero_ms : kLossZero_ms;
  row.restarts_least = row.restarts_most = fault.ends_the_program ? 1 : 0;
  row.hold_s = fault.lasts_s;
  row.held = fault.lasts_s > 0.0;
  row.why_not = [] {
    static const std::string why = why_no_python_engine();
    return why;
  };
  row.prepare = [&fault](RunCommand& command, const FaultSession& cell) {
    for (const std::string& each : write_python_engine(cell.setup().report + ".py", cell.trigger(), fault)) {
      command.arguments.insert(command.arguments.end(), {"--set", each});
    }
  };
  row.happen = [&fault](FaultSession& cell) {
    if (fault.statements[0] == '\0') return cell.stop_for(cell.physics(), FaultSession::kHold_s);
    let_fail(cell, fault);
  };
  return row;
}

}  // namespace

std::vector<FaultRow> engine_faults() {
  std::vector<FaultRow> out;
  for (const PythonFault& fault : python_faults()) out.push_back(row_of(fault));
  return out;
}

}  // namespace tools
