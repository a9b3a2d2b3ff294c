#include "tools/evaluation/faults/fault_outcome.hpp"

#include <algorithm>
#include <nlohmann/json.hpp>

#include "rtbus/clock.hpp"

namespace tools {

namespace {

/// Hands every member that travels to `visit`, with its name.
template <class Outcome, class Visit>
void each_member(Outcome& outcome, const Visit& visit) {
  visit("problem", outcome.problem);
  visit("before_n", outcome.before_n);
  visit("peak_n", outcome.peak_n);
  visit("limit_n", outcome.limit_n);
  visit("zero_ms", outcome.zero_ms);
  visit("lowest_n", outcome.lowest_n);
  visit("after_zero_n", outcome.after_zero_n);
  visit("felt_until_ms", outcome.felt_until_ms);
  visit("back_ms", outcome.back_ms);
  visit("growth_per_ms", outcome.growth_per_ms);
  visit("pause_ms", outcome.pause_ms);
  visit("wakeup_ms", outcome.wakeup_ms);
  visit("device_timed_out", outcome.device_timed_out);
  visit("ticks", outcome.ticks);
  visit("due", outcome.due);
  visit("overruns", outcome.overruns);
  visit("elapsed_s", outcome.elapsed_s);
  visit("rate_hz", outcome.rate_hz);
  visit("topics", outcome.topics);
  visit("topics_back", outcome.topics_back);
  visit("exit_status", outcome.exit_status);
  visit("restarts", outcome.restarts);
  visit("processes_left", outcome.processes_left);
  visit("went_on", outcome.went_on);
  visit("restarted", outcome.restarted);
  visit("left_over", outcome.left_over);
  visit("fault_ns", outcome.fault_ns);
}

}  // namespace

void to_json(nlohmann::json& out, const FaultOutcome& outcome) {
  each_member(outcome, [&out](const char* name, const auto& member) { out[name] = member; });
}

void from_json(const nlohmann::json& in, FaultOutcome& outcome) {
  each_member(outcome, [&in](const char* name, auto& member) { in.at(name).get_to(member); });
}

void judge_trace(std::uint64_t ended_ns, FaultOutcome& out, const std::vector<Span>& without_force) {
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
    if (felt.time_ns <= out.fault_ns || i == 0) out.before_n = felt.force_n;
    if (felt.time_ns < out.fault_ns) continue;
    for (const Span& span : without_force) {
      if (felt.force_n == 0.0 || felt.time_ns < span.from_ns || felt.time_ns >= span.to_ns) continue;
      out.felt_until_ms = std::max(out.felt_until_ms, ms_since(span.from_ns, felt.time_ns));
    }
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
