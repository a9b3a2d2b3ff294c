// What the cells promise to the hand, and how a trace is judged. Pure.
#include <algorithm>

#include "rtbus/clock.hpp"
#include "tools/evaluation/faults/fault_cells.hpp"

namespace tools {

const char* to_string(Fault fault) noexcept {
  switch (fault) {
    case Fault::kPhysicsKilled:
      return "physics_killed";
    case Fault::kPhysicsStopped:
      return "physics_stopped";
    case Fault::kEngineHung:
      return "engine_hung";
    case Fault::kHapticKilled:
      return "haptic_killed";
    case Fault::kTopicsDeleted:
      return "topics_deleted";
    case Fault::kDevice:
      return "device";
    case Fault::kPython:
      return "python";
  }
  return "?";
}

const char* name_of(const FaultSetup& setup) noexcept {
  if (setup.device != nullptr) return setup.device->name;
  return setup.python != nullptr ? setup.python->name : to_string(setup.fault);
}

bool ends_in_zero(const FaultSetup& setup) noexcept {
  return setup.python != nullptr ? setup.python->ends_in_zero : setup.fault != Fault::kTopicsDeleted;
}

bool restarts_a_node(const FaultSetup& setup) noexcept {
  if (setup.python != nullptr) return setup.python->ends_the_program;
  return setup.fault == Fault::kPhysicsKilled || setup.fault == Fault::kHapticKilled;
}

bool comes_back(const FaultSetup& setup) noexcept { return setup.device == nullptr || setup.device->lasts_s >= 0.0; }

double promised_zero_ms(const FaultSetup& setup) noexcept {
  if (setup.device != nullptr) return setup.device->zero_ms;
  // docs/safety.md: a loss is declared after 60 ms at most (a hung engine: 100 ms after its last step), the fade takes
  // 40 ms; a device whose node is gone lets go after 20 ms. One tick on top.
  if (setup.python != nullptr && setup.python->beats_on) return 100.0 + 40.0 + 1.0;
  switch (setup.fault) {
    case Fault::kEngineHung:
      return 100.0 + 40.0 + 1.0;
    case Fault::kHapticKilled:
      return 20.0 + 1.0;
    default:
      return 60.0 + 40.0 + 1.0;
  }
}

void judge_trace(std::uint64_t ended_ns, FaultOutcome& out) {
  const auto ms_since = [](std::uint64_t from_ns, std::uint64_t to_ns) {
    return rtbus::seconds_between(from_ns, to_ns) * 1e3;
  };
  std::uint64_t last_ns = 0;
  for (const Felt& felt : out.trace) {
    out.peak_n = std::max(out.peak_n, felt.force_n);
    if (last_ns != 0) out.pause_ms = std::max(out.pause_ms, ms_since(last_ns, felt.time_ns));
    last_ns = felt.time_ns;
  }
  out.lowest_n = out.peak_n;
  std::size_t earlier = 0;
  for (std::size_t i = 0; i < out.trace.size(); ++i) {
    const Felt& felt = out.trace[i];
    // The last state that is at least one millisecond older.
    while (earlier + 1 < i && felt.time_ns >= out.trace[earlier + 1].time_ns + rtbus::kNsPerMs) ++earlier;
    if (felt.time_ns < out.fault_ns) continue;
    out.lowest_n = std::min(out.lowest_n, felt.force_n);
    if (out.zero_ms >= 0.0) out.after_zero_n = std::max(out.after_zero_n, felt.force_n);
    if (out.zero_ms < 0.0 && felt.force_n == 0.0) out.zero_ms = ms_since(out.fault_ns, felt.time_ns);
    const Felt& before = out.trace[earlier];
    const double elapsed_ms = ms_since(before.time_ns, felt.time_ns);
    if (elapsed_ms >= 1.0 && out.peak_n > 0.0) {
      out.growth_per_ms = std::max(out.growth_per_ms, (felt.force_n - before.force_n) / out.peak_n / elapsed_ms);
    }
  }
  // Back is what comes after the zero, when there was one.
  for (const Felt& felt : out.trace) {
    if (felt.time_ns <= ended_ns || felt.force_n < 0.5 * out.peak_n) continue;
    if (out.zero_ms >= 0.0 && rtbus::seconds_between(out.fault_ns, felt.time_ns) * 1e3 <= out.zero_ms) continue;
    out.back_ms = ms_since(ended_ns, felt.time_ns);
    break;
  }
}

}  // namespace tools
