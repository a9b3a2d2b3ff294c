#include "tools/evaluation/network/real_cell.hpp"

#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <deque>
#include <fstream>
#include <optional>
#include <sstream>
#include <type_traits>
#include <utility>

#include "haptic_node/node_config.hpp"
#include "rtbus/clock.hpp"
#include "rtbus/config/session.hpp"
#include "rtbus/eigen.hpp"
#include "rtbus/topic_directory.hpp"
#include "tools/cli/common/command.hpp"
#include "tools/cli/common/formatted.hpp"
#include "tools/cli/common/interrupt.hpp"
#include "tools/cli/run/supervisor.hpp"
#include "tools/evaluation/stability/stability_watch.hpp"

namespace tools {

namespace {

constexpr double kLeft_m = 0.2e-3;
constexpr std::uint64_t kPoll_ns = 10 * rtbus::kNsPerMs;
/// Processes and DDS find each other within so long, and within so many round trips. The hand waits for it.
constexpr double kFinding_s = 3.0, kFindingTrips = 8.0;
constexpr double kStartPatience_s = 20.0;   // until the first tick
constexpr const char* kHere = "10.77.0.1";  // of tools/network/two_machines
constexpr const char* kThere = "10.77.0.2";
constexpr const char* kRemote = StabilityEnvelope::kRemote;
constexpr const char* kLocal = StabilityEnvelope::kLocal;

using Task = StabilityTask;

std::vector<std::string> words_of(const char* variable) {
  const char* const text = std::getenv(variable);
  std::istringstream words(text != nullptr ? text : "");
  std::vector<std::string> out;
  for (std::string word; words >> word;) out.push_back(word);
  return out;
}

/// The session of a cell on two machines, followed from here.
class RealSession {
 public:
  RealSession(const RealCell& cell, const std::string& session_file, const std::vector<std::string>& assignments,
              std::string program)
      : each_(case_of(cell)), program_(std::move(program)), watch_times_(each_) {
    session_.name = "cell" + std::to_string(getpid());
    arguments_ = {"run", session_file, "--no-bare-loop", "--no-plots"};
    std::vector<std::string> sets = assignments_of(each_);
    sets.insert(sets.end(), assignments.begin(), assignments.end());
    for (const std::string& set : {"session=" + session_.name, std::string("network.machines.physics=") + kThere,
                                   std::string("network.machines.haptic0=") + kHere}) {
      sets.push_back(set);
    }
    if (hands() == 2) sets.push_back(std::string("network.machines.second=") + kHere);
    for (int hand = 0; hand < hands(); ++hand) {
      sets.push_back(formatted("haptic.%d.link=dds", hand));
      sets.push_back(
          formatted("haptic.%d.link_round_trip_ms=%.9g", hand, std::max(1.0, 1e3 * each_.longest_round_trip_s())));
    }
    std::vector<rtbus::config::Override> overrides;
    for (const std::string& set : sets) {
      arguments_.insert(arguments_.end(), {"--set", set});
      overrides.push_back(rtbus::config::parse_override(set));
    }
    rtbus::config::SessionConfig session = rtbus::config::load_session(session_file, overrides);
    limit_n_ = haptic::read_haptic_config(session, 0).safety.max_force_n;
  }
  ~RealSession() {
    supervisor_.end_all();
    rtbus::remove_dead(session_.name);
  }
  RealSession(const RealSession&) = delete;
  RealSession& operator=(const RealSession&) = delete;

  /// @returns why not; empty: `out` holds the run.
  [[nodiscard]] std::string run(RealRun& out) {
    Watch watch(each_, limit_n_, 1.0 / each_.haptic_hz, out.result);
    watch_ = &watch;
    if (!start("physics there", words_of("RTBUS_THERE"), {"physics"}) ||
        !start("hand here", {},
               hands() == 2 ? std::vector<std::string>{"haptic0", "second"} : std::vector<std::string>{"haptic0"})) {
      return problem_;
    }
    const std::uint64_t began_ns = rtbus::monotonic_ns();
    while (problem_.empty() && !done_) {
      if (!sleep_unless_interrupted(kPoll_ns)) return "interrupted";
      if (const auto end = supervisor_.poll()) return "the session's " + end->name + " " + end->how() + last_lines();
      if (out.trace.empty() && rtbus::seconds_between(began_ns, rtbus::monotonic_ns()) > kStartPatience_s) {
        return formatted("no tick of the hand within %g s", kStartPatience_s) + last_lines();
      }
      if (!ticks_) {
        auto opened = rtbus::Reader<rtbus::Telemetry>::open(session_, "haptic0.telemetry", {.presence = true});
        if (opened) ticks_.emplace(std::move(*opened));
      }
      rtbus::Stamped<rtbus::Telemetry> tick;
      while (ticks_ && !done_ && problem_.empty() && ticks_->read_next(tick) == rtbus::ReadStatus::kFresh) {
        take(tick.value, out);
      }
    }
    return problem_;
  }

 private:
  [[nodiscard]] int hands() const { return each_.task == Task::kSecondHand ? 2 : 1; }

  bool start(const char* name, std::vector<std::string> before, const std::vector<std::string>& nodes) {
    before.push_back(program_);
    before.insert(before.end(), arguments_.begin(), arguments_.end());
    for (const std::string& node : nodes) before.insert(before.end(), {"--only", node});
    const std::string first = before.front().find('/') == std::string::npos ? "/usr/bin/env" : before.front();
    if (first == before.front()) before.erase(before.begin());
    if (auto started = supervisor_.start({name, Stage::kHaptic, first, before}); !started) problem_ = started.error();
    return problem_.empty();
  }

  void take(const rtbus::Telemetry& tick, RealRun& out) {
    if (began_ns_ == 0) began_ns_ = tick.due_ns - rtbus::ns_of(static_cast<double>(tick.tick) / each_.haptic_hz);
    const double now_s = rtbus::seconds_between(began_ns_, tick.due_ns);
    const bool begins = now_s >= each_.start_s() && (out.trace.empty() || out.trace.back().time_s < each_.start_s());
    if (begins && tick.gate < 1.0) {
      problem_ = formatted("the hand began to move after %g s, and no force acted yet", each_.start_s()) + last_lines();
      return;
    }
    out.trace.push_back(StabilityTick::of(tick, each_, now_s));
    watch_->tick(tick, rtbus::vector_of(tick.position_m), tick.energy_absorbed_j, now_s);
    if (now_s < next_s_) return;
    if (!windows_) {
      watch_->begin_windows();
      windows_ = true;
      next_s_ = each_.end_s() + watch_times_.window_s;
      return;
    }
    const bool rested = watch_->end_window();
    next_s_ += watch_times_.window_s;
    if (!rested && now_s + 0.5 * watch_times_.window_s < until_s_) return;
    watch_->judge(rested);
    out.result.simulated_s = now_s;
    // As under the simulated clock: what does not end is watched for longer.
    const bool goes_on = out.result.growing || out.result.outcome == StabilityOutcome::kDiverged;
    done_ = rested || !goes_on || until_s_ > each_.end_s() + watch_times_.watched_s;
    until_s_ = each_.end_s() + WatchTimes::kLongerLook * watch_times_.watched_s;
  }

  [[nodiscard]] std::string last_lines() const {
    std::string out;
    for (const std::string& line : lines_) out += "\n  " + line;
    return out;
  }

  StabilityCase each_;
  std::string program_;
  WatchTimes watch_times_;
  rtbus::Session session_;
  std::vector<std::string> arguments_;
  std::deque<std::string> lines_;
  Supervisor supervisor_{[this](const std::string& child, std::string_view line) {
    lines_.push_back(child + ": " + std::string(line));
    if (lines_.size() > 24) lines_.pop_front();
  }};
  std::optional<rtbus::Reader<rtbus::Telemetry>> ticks_;
  std::uint64_t began_ns_ = 0;
  double next_s_ = each_.end_s(), until_s_ = each_.end_s() + watch_times_.watched_s;
  double limit_n_ = 0.0;  ///< Largest force of the device.
  Watch* watch_ = nullptr;
  bool windows_ = false, done_ = false;
  std::string problem_;
};

}  // namespace

const std::vector<RealCell>& real_cells() {
  static const std::vector<RealCell> cells{
      {"wall_local_0", Task::kPress, kLocal, {.round_trip_s = 0.0, .lost_share = 0.1}},
      {"wall_local_200", Task::kPress, kLocal, {.round_trip_s = 0.2, .jitter_share = 0.3, .lost_share = 0.1}},
      {"wall_remote_50", Task::kPress, kRemote, {.round_trip_s = 0.05, .jitter_share = 0.3, .lost_share = 0.01}},
      {"wall_remote_200", Task::kPress, kRemote, {.round_trip_s = 0.2, .jitter_share = 0.3, .lost_share = 0.1}},
      {"block_local_10", Task::kBlock, kLocal, {.round_trip_s = 0.01, .jitter_share = 0.3, .lost_share = 0.01}},
      {"block_local_200", Task::kBlock, kLocal, {.round_trip_s = 0.2, .jitter_share = 0.3, .lost_share = 0.1}},
      {"block_remote_100", Task::kBlock, kRemote, {.round_trip_s = 0.1, .jitter_share = 0.3, .lost_share = 0.1}},
      {"block_remote_500", Task::kBlock, kRemote, {.round_trip_s = 0.5, .jitter_share = 0.3, .lost_share = 0.3}},
      {"plate_local_200", Task::kPlate, kLocal, {.round_trip_s = 0.2, .jitter_share = 0.3, .lost_share = 0.1}},
      {"plate_remote_50", Task::kPlate, kRemote, {.round_trip_s = 0.05, .lost_share = 0.1}},
      {"second_hand_remote_10",
       Task::kSecondHand,
       kRemote,
       {.round_trip_s = 0.01, .jitter_share = 0.3, .lost_share = 0.3}},
      {"second_hand_remote_200",
       Task::kSecondHand,
       kRemote,
       {.round_trip_s = 0.2, .jitter_share = 0.3, .lost_share = 0.1}},
  };
  return cells;
}

const RealCell& real_cell(const std::string& name) {
  std::string names;
  for (const RealCell& cell : real_cells()) {
    if (name == cell.name) return cell;
    names += std::string(names.empty() ? "" : ", ") + cell.name;
  }
  throw rtbus::config::Error("evaluate network --real has no cell '" + name + "'; there are " + names);
}

StabilityCase case_of(const RealCell& cell) {
  const NetworkMethod method{.name = cell.method, .method = cell.method, .bounds = true, .damps = true, .lags = true};
  StabilityCase out = network_cell(method, cell.task, cell.network);
  out.seed = 1;
  out.begins_s = kFinding_s + kFindingTrips * out.longest_round_trip_s();
  return out;
}

NetworkVerdict verdict_of(const StabilityResult& result) noexcept {
  if (result.outcome == StabilityOutcome::kFailed || result.growing || result.clamped_s > kClampBarS) {
    return NetworkVerdict::kDiverged;
  }
  return result.outcome == StabilityOutcome::kDiverged ? NetworkVerdict::kSwings : NetworkVerdict::kStable;
}

const char* to_string(NetworkVerdict verdict) noexcept {
  constexpr const char* names[] = {"stable", "swings", "diverged"};
  return names[static_cast<std::size_t>(verdict)];
}

double leaves_start_s(const std::vector<StabilityTick>& trace, double starts_s) {
  const StabilityTick* before = nullptr;
  double rest_m = 0.0;
  for (const StabilityTick& tick : trace) {
    if (tick.time_s < starts_s) {
      rest_m = tick.height_m;
    } else if (before != nullptr && std::abs(tick.height_m - rest_m) >= kLeft_m) {
      const double way_m = std::abs(tick.height_m - rest_m) - std::abs(before->height_m - rest_m);
      const double share = way_m > 0.0 ? (kLeft_m - std::abs(before->height_m - rest_m)) / way_m : 1.0;
      return before->time_s + share * (tick.time_s - before->time_s);
    }
    before = &tick;
  }
  return -1.0;
}

std::vector<StabilityTick> at_times_of(const std::vector<StabilityTick>& like, const std::vector<StabilityTick>& run,
                                       double later_s) {
  std::vector<StabilityTick> out;
  std::size_t at = 0;
  for (const StabilityTick& wanted : like) {
    const double time_s = wanted.time_s + later_s;
    while (at < run.size() && run[at].time_s < time_s) ++at;
    if (at == run.size()) break;
    StabilityTick tick = run[at];
    tick.time_s = wanted.time_s;
    if (at > 0) {  // between two ticks, on a line
      const StabilityTick& before = run[at - 1];
      const double share = (time_s - before.time_s) / (run[at].time_s - before.time_s);
      tick.height_m = before.height_m + share * (run[at].height_m - before.height_m);
      tick.force_n = before.force_n + share * (run[at].force_n - before.force_n);
    }
    out.push_back(tick);
  }
  return out;
}

int run_real_cell(const RealCell& cell, const std::string& session_file, const std::vector<std::string>& assignments,
                  const std::string& program, const std::string& file) {
  RealRun run;
  std::string problem;
  {
    RealSession session(cell, session_file, assignments, program);
    problem = session.run(run);
  }
  if (!problem.empty()) {
    std::fprintf(stderr, "%s: %s\n", cell.name, problem.c_str());
    return kExitFailed;
  }
  static_assert(std::is_trivially_copyable_v<StabilityResult> && std::is_trivially_copyable_v<StabilityTick>);
  std::ofstream out(file, std::ios::binary);
  out.write(reinterpret_cast<const char*>(&run.result), sizeof run.result);
  out.write(reinterpret_cast<const char*>(run.trace.data()),
            static_cast<std::streamsize>(run.trace.size() * sizeof(StabilityTick)));
  out.close();
  if (out) return kExitFine;
  std::fprintf(stderr, "%s: cannot write %s\n", cell.name, file.c_str());
  return kExitFailed;
}

std::optional<RealRun> read_real_run(const std::string& file) {
  std::ifstream in(file, std::ios::binary);
  RealRun run;
  if (!in.read(reinterpret_cast<char*>(&run.result), sizeof run.result)) return std::nullopt;
  StabilityTick tick;
  while (in.read(reinterpret_cast<char*>(&tick), sizeof tick)) run.trace.push_back(tick);
  if (in.gcount() != 0 || run.trace.empty()) return std::nullopt;
  return run;
}

}  // namespace tools
