// Nodes and the device's plant that are killed, stopped, hung, starved, slow or send nonsense.
#include <signal.h>

#include <limits>
#include <optional>
#include <utility>

#include "rtbus/topic.hpp"
#include "tools/evaluation/faults/fault_session.hpp"
#include "tools/evaluation/faults/helpers.hpp"
#include "tools/evaluation/faults/stopped_thread.hpp"

namespace tools {

namespace {

constexpr double kLongStop_s = 5.0;
constexpr double kHung_s = 1.0;
constexpr double kSlowStep_s = 2.0;
constexpr double kStarved_s = 1.0;
constexpr int kTopFifo = 99;
constexpr int kCrashes = 3;
constexpr double kAnotherLife_s = 15.0;

void hang(FaultSession& cell) {
  const std::uint64_t beats = cell.physics_beat().beats;
  const auto hung = StoppedThread::stop(cell.physics(), "physics_step");
  if (!hung) return cell.fail(hung.error());
  cell.follow(kHung_s);
  cell.mark_fault_at(cell.physics_beat().last_work_ns);  // its last step
  if (cell.physics_beat().beats < beats + 10) cell.fail("the heartbeat of physics stopped too: this was another fault");
  cell.mark_over(rtbus::monotonic_ns());
}

/// Held for two seconds, twice, and let go for a few steps in between.
void crawl(FaultSession& cell) {
  for (int step = 0; step < 2; ++step) {
    {
      const auto hung = StoppedThread::stop(cell.physics(), "physics_step");
      if (!hung) return cell.fail(hung.error());
      cell.follow(kSlowStep_s);
      const std::uint64_t last_step_ns = cell.physics_beat().last_work_ns;
      if (step == 0) cell.mark_fault_at(last_step_ns);
      cell.mark_over(rtbus::monotonic_ns());
      cell.expect_no_force(last_step_ns, rtbus::monotonic_ns());
    }
    cell.follow(0.005);
  }
}

/// Takes the place of physics, which is killed, and answers with numbers that are none.
void answer_nan(FaultSession& cell) {
  const pid_t physics = cell.physics();
  const rtbus::ProxyState last = cell.proxy();
  rtbus::Heartbeat beat = cell.physics_beat();
  cell.signal(physics, SIGKILL);
  cell.mark_fault();
  using Proxies = rtbus::Writer<rtbus::ProxyState>;
  using Beats = rtbus::Writer<rtbus::Heartbeat>;
  std::optional<Proxies> proxies;
  std::optional<Beats> beats;
  const auto take_over = [&] {
    if (!beats) {
      if (auto writer = Beats::create(cell.session(), "physics.heartbeat", {.capacity = 4})) {
        beats.emplace(std::move(*writer));
      }
    }
    if (!proxies) {
      if (auto writer = Proxies::create(cell.session(), "physics.proxy_state.haptic0", {.capacity = 8})) {
        proxies.emplace(std::move(*writer));
      }
    }
    return beats && proxies;
  };
  if (!cell.follow_until(0.5, take_over)) return cell.fail("the topics of physics could not be taken over");
  rtbus::ProxyState answer = last;
  answer.position_m.fill(std::numeric_limits<double>::quiet_NaN());
  const std::uint64_t end_ns = rtbus::monotonic_ns() + rtbus::kNsPerS;
  cell.follow_until(FaultSession::kHold_s, [&] {
    const std::uint64_t now_ns = rtbus::monotonic_ns();
    ++beat.beats;
    beat.last_work_ns = now_ns;
    ++answer.step_index;
    answer.device_time_ns = now_ns;
    beats->publish(beat, now_ns);
    proxies->publish(answer, now_ns);
    return now_ns > end_ns;
  });
}

/// Kills physics in each of its lives. @returns false when the session did not start it anew.
bool crash(FaultSession& cell, int times) {
  for (int i = 0; i < times; ++i) {
    const pid_t now = cell.physics();
    cell.signal(now, SIGKILL);
    if (i + 1 == times) break;
    const auto another = [&] { return cell.physics() != now && cell.physics() > 1; };
    if (!cell.follow_until(kAnotherLife_s, another)) return false;
  }
  return true;
}

}  // namespace

std::vector<FaultRow> node_faults() {
  std::vector<FaultRow> out;
  out.push_back({.name = "physics_killed",
                 .what = "SIGKILL to physics_node in mid-push",
                 .zero_ms = kLossZero_ms,
                 .restarts_least = 1,
                 .restarts_most = 1,
                 .happen = [](FaultSession& cell) {
                   cell.signal(cell.physics(), SIGKILL);
                   cell.mark_over(rtbus::monotonic_ns());
                   cell.await_zero();
                 }});
  out.push_back({.name = "physics_stopped",
                 .what = "SIGSTOP to physics_node, SIGCONT 5 s later",
                 .zero_ms = kLossZero_ms,
                 .held = true,
                 .happen = [](FaultSession& cell) { cell.stop_for(cell.physics(), kLongStop_s); }});
  out.push_back({.name = "engine_hung",
                 .what = "the stepping thread alone is stopped for a second; the heartbeat goes on",
                 .zero_ms = kHangZero_ms,
                 .held = true,
                 .happen = &hang});
  out.push_back({.name = "physics_half_hertz",
                 .what = "physics is held for 2 s between steps, twice; the heartbeat goes on",
                 .zero_ms = kHangZero_ms,
                 .held = true,
                 .happen = &crawl});
  out.push_back({.name = "physics_nan",
                 .what = "answers that are no numbers, for a second, from one who took the place of physics",
                 .zero_ms = kLossZero_ms,
                 .restarts_least = 1,
                 .restarts_most = 2,
                 .held = true,
                 .prepare =
                     [](RunCommand& command, const FaultSession&) {
                       // The place is free for that long.
                       command.arguments.insert(command.arguments.end(), {"--set", "supervise.first_delay_s=2"});
                     },
                 .happen = &answer_nan});
  out.push_back({.name = "physics_crash_loop",
                 .what = "physics is killed in each of three lives",
                 .zero_ms = kLossZero_ms,
                 .restarts_least = kCrashes,
                 .restarts_most = kCrashes,
                 .happen = [](FaultSession& cell) {
                   if (!crash(cell, kCrashes)) cell.fail("physics was not started again");
                 }});
  out.push_back({.name = "physics_given_up",
                 .what = "physics is killed once more than the session restarts it",
                 .zero_ms = kLossZero_ms,
                 .ends = Ends::kWithSession,
                 .restarts_least = 2,
                 .restarts_most = 2,
                 .exit_status = FaultRow::kAnyFailure,
                 .prepare =
                     [](RunCommand& command, const FaultSession&) {
                       command.arguments.insert(command.arguments.end(), {"--set", "supervise.restarts=2"});
                     },
                 .happen = [](FaultSession& cell) { (void)crash(cell, 3); }});
  out.push_back({.name = "haptic_killed",
                 .what = "SIGKILL to haptic_node: only the device's own time-out is left",
                 .zero_ms = kDeviceZero_ms,
                 .restarts_least = 1,
                 .restarts_most = 1,
                 .happen = [](FaultSession& cell) {
                   cell.signal(cell.haptic(), SIGKILL);
                   cell.mark_over(rtbus::monotonic_ns());
                   cell.await_zero();
                 }});
  out.push_back({.name = "haptic_stopped",
                 .what = "SIGSTOP to haptic_node, SIGCONT 5 s later",
                 .zero_ms = kDeviceZero_ms,
                 .own_wakeups = true,
                 .held = true,
                 .happen = [](FaultSession& cell) { cell.stop_for(cell.haptic(), kLongStop_s); }});
  out.push_back({.name = "haptic_starved",
                 .what = "a process of SCHED_FIFO 99 computes on the core of the haptic loop for a second",
                 .zero_ms = kDeviceZero_ms,
                 .alone = true,
                 .own_wakeups = true,
                 .takes_core = true,
                 .held = true,
                 .happen = [](FaultSession& cell) {
                   const CpuHogs hog(1, cell.haptic_core(), kTopFifo, kStarved_s);
                   if (!hog.run()) return cell.fail("no process of SCHED_FIFO 99 could be had");
                   cell.mark_fault_at(hog.began_ns());
                   cell.mark_over(hog.began_ns() + rtbus::ns_of(kStarved_s));
                   cell.follow(kStarved_s);
                 }});
  out.push_back({.name = "plant_killed",
                 .what = "SIGKILL to the device's own process",
                 .feels = Feels::kAnything,
                 .restarts_least = 1,
                 .restarts_most = 1,
                 .own_pauses = true,
                 .happen = [](FaultSession& cell) { cell.signal(cell.plant(), SIGKILL); }});
  out.push_back({.name = "plant_stopped",
                 .what = "SIGSTOP to the device's own process, SIGCONT a second later",
                 .feels = Feels::kAnything,
                 .own_pauses = true,
                 .happen = [](FaultSession& cell) { cell.stop_for(cell.plant(), FaultSession::kHold_s); }});
  return out;
}

}  // namespace tools
