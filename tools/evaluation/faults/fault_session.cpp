#include "tools/evaluation/faults/fault_session.hpp"

#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>

#include "rtbus/topic_directory.hpp"
#include "tools/evaluation/soak/process_watch.hpp"

namespace tools {

namespace {

constexpr std::uint64_t kLook_ns = 5 * rtbus::kNsPerMs;
constexpr double kStart_s = 25.0;  // a loaded machine, sanitizers
constexpr double kBack_s = 10.0;   // back-off, start and ramp, with room
constexpr double kSettle_s = 0.3;
constexpr double kEnd_s = 20.0;
constexpr double kPressed_n = 0.3;
constexpr std::size_t kPast = 400;  ///< States of the plant that are kept from before the fault: a tenth of a second.
/// Of the witness: above all that a session runs, so that nothing of ours can delay it. What delays it all the same is
/// the machine, or a program that is none of ours.
constexpr int kWitnessPriority = 98;
/// It has begun by then: the loop's wake-ups are judged from there on.
constexpr double kWitnessUp_s = 0.03;
constexpr const char* kRun = "rtbus run";

double norm(const rtbus::Vec3& v) { return std::hypot(v[0], v[1], v[2]); }

}  // namespace

struct FaultSession::Topics {
  explicit Topics(const rtbus::Session& session)
      : plant(session, "haptic0.plant_state"),
        ticks(session, "haptic0.telemetry", {.presence = true}),
        stats(session, "haptic0.loop_stats"),
        info(session, "haptic0.node_info"),
        haptic_beat(session, "haptic0.heartbeat"),
        physics_beat(session, "physics.heartbeat"),
        proxy(session, "physics.proxy_state.haptic0") {}
  rtbus::Subscription<rtbus::PlantState> plant;
  rtbus::Subscription<rtbus::Telemetry> ticks;
  rtbus::Subscription<rtbus::LoopStats> stats;
  rtbus::Subscription<rtbus::NodeInfo> info;
  rtbus::Subscription<rtbus::Heartbeat> haptic_beat, physics_beat;
  rtbus::Subscription<rtbus::ProxyState> proxy;
};

FaultSession::FaultSession(const FaultSetup& setup)
    : setup_(setup), supervisor_([](const std::string&, std::string_view) {}) {
  session_.name = setup.session;
}

FaultSession::~FaultSession() = default;

void FaultSession::fail(std::string problem) {
  if (out_.problem.empty()) out_.problem = std::move(problem);
}

void FaultSession::look() {
  rtbus::Stamped<rtbus::PlantState> state;
  while (topics_->plant.read_next(state) == rtbus::ReadStatus::kFresh) {
    if (!out_.trace.empty() && state.stamp_ns <= out_.trace.back().time_ns) continue;
    out_.trace.push_back({state.stamp_ns, norm(state.value.applied_force_n)});
    out_.device_timed_out = out_.device_timed_out || state.value.timed_out != 0;
  }
  rtbus::Stamped<rtbus::Telemetry> tick;
  while (topics_->ticks.read_next(tick) == rtbus::ReadStatus::kFresh) {
    worst_wakeup_ms_ = std::max(worst_wakeup_ms_, tick.value.wakeup_us * 1e-3);
  }
  (void)topics_->stats.read_latest(stats_now_);
  (void)topics_->info.read_latest(info_now_);
  (void)topics_->haptic_beat.read_latest(haptic_beat_now_);
  (void)topics_->physics_beat.read_latest(physics_beat_now_);
  (void)topics_->proxy.read_latest(proxy_now_);
  topics_->plant.maintain();
  topics_->ticks.maintain();
  topics_->stats.maintain();
  topics_->info.maintain();
  topics_->haptic_beat.maintain();
  topics_->physics_beat.maintain();
  topics_->proxy.maintain();
}

void FaultSession::forget_the_past() {
  look();
  auto& trace = out_.trace;
  if (trace.size() > kPast) trace.erase(trace.begin(), trace.end() - kPast);
  worst_wakeup_ms_ = 0.0;
  out_.device_timed_out = false;
}

bool FaultSession::follow_until(double timeout_s, const std::function<bool()>& condition) {
  const std::uint64_t end_ns = rtbus::monotonic_ns() + static_cast<std::uint64_t>(timeout_s * 1e9);
  while (rtbus::monotonic_ns() < end_ns) {
    look();
    if (condition()) return true;
    while (auto ended = supervisor_.poll()) {
      if (ended->name == tool_) tool_end_ = ended;
      if (ended->name != kRun) continue;
      take_end(*ended);
      if (!session_may_end()) return false;
    }
    rtbus::sleep_until(rtbus::monotonic_ns() + kLook_ns);
  }
  return false;
}

void FaultSession::follow(double seconds) {
  (void)follow_until(seconds, [] { return false; });
}

void FaultSession::await_zero() {
  const auto is_zero = [this] {
    const auto since = std::find_if(out_.trace.rbegin(), out_.trace.rend(), [this](const Felt& felt) {
      return felt.time_ns < out_.fault_ns || felt.force_n == 0.0;
    });
    return since != out_.trace.rend() && since->time_ns >= out_.fault_ns;
  };
  if (!follow_until(kZeroPatience_s, is_zero)) fail("the force never went to zero");
}

void FaultSession::take_end(const ChildEnd& ended) {
  out_.exit_status = WIFEXITED(ended.wait_status) ? WEXITSTATUS(ended.wait_status) : 128 + WTERMSIG(ended.wait_status);
  run_pid_ = 0;
  if (ending_ || (session_may_end() && (happens_ || setup_.row->ends == Ends::kNeverStarts))) return;
  std::string problem = "rtbus run " + ended.how();
  for (const std::string& line : ended.last_words) problem += "\n  " + line;
  fail(problem);
}

bool FaultSession::start() {
  RunCommand command{{"run", setup_.session_file, "--set", "session=" + setup_.session, "--report", setup_.report,
                      "--no-plots", "--no-bare-loop"},
                     {},
                     {},
                     {}};
  if (!setup_.method.empty()) {
    command.arguments.insert(command.arguments.end(), {"--set", "haptic.0.method=" + setup_.method});
  }
  std::remove(trigger().c_str());
  std::remove(setup_.report.c_str());
  if (setup_.row->prepare) setup_.row->prepare(command, *this);
  topics_ = std::make_unique<Topics>(session_);
  ChildSpec spec{kRun, Stage::kPlant, setup_.program, std::move(command.arguments)};
  spec.preload = command.preload;
  spec.environment = command.environment;
  if (!command.limits.empty()) {
    spec.program = "/bin/sh";
    spec.arguments.insert(spec.arguments.begin(), {"-c", command.limits + "; exec \"$@\"", "sh", setup_.program});
  }
  if (auto started = supervisor_.start(spec); !started) {
    fail(started.error());
    return false;
  }
  run_pid_ = supervisor_.running().front().pid;
  if (setup_.row->ends == Ends::kNeverStarts) {
    out_.fault_ns = rtbus::monotonic_ns();
    if (!follow_until(kStart_s + kEnd_s, [this] { return run_pid_ == 0; })) fail("rtbus run did not give up");
    return false;
  }
  // In mid-push: the hand is on its way into the wall.
  const bool pressed = follow_until(kStart_s, [this] { return force_n() > kPressed_n; });
  if (!pressed) fail("the hand never pressed on the wall");
  return pressed;
}

pid_t FaultSession::haptic() {
  const auto pid = static_cast<pid_t>(haptic_beat_now_.value.pid);
  if (pid <= 1) fail("haptic_node does not name itself in its heartbeat");  // kill(2) takes 0 and -1 for many
  return std::max(pid, 1);
}

pid_t FaultSession::physics() {
  const auto pid = static_cast<pid_t>(physics_beat_now_.value.pid);
  if (pid <= 1) fail("physics does not name itself in its heartbeat");
  return std::max(pid, 1);
}

pid_t FaultSession::plant() {
  const auto uses = uses_below(run_pid_);
  const auto found = run_pid_ > 1 ? uses.find("simulated_plant") : uses.end();
  if (found == uses.end()) fail("no simulated_plant runs");
  return found == uses.end() ? 1 : found->second.pid;
}

std::vector<pid_t> FaultSession::processes() {
  std::vector<pid_t> out;
  if (run_pid_ <= 1) return out;
  for (const auto& [program, use] : uses_below(run_pid_)) out.push_back(use.pid);
  return out;
}

void FaultSession::signal(pid_t process, int number) {
  if (process > 1) ::kill(process, number);
}

void FaultSession::stop_for(pid_t process, double seconds) {
  signal(process, SIGSTOP);
  follow(seconds);
  mark_over(rtbus::monotonic_ns());
  signal(process, SIGCONT);
}

pid_t FaultSession::start_tool(const std::vector<std::string>& arguments, bool any_program) {
  tool_ = "tool " + std::to_string(++tools_);
  tool_end_.reset();
  ChildSpec spec{tool_, Stage::kObserver, setup_.program, arguments};
  if (any_program) {
    spec.program = arguments.front();
    spec.arguments.erase(spec.arguments.begin());
  }
  if (auto started = supervisor_.start(spec); !started) {
    fail(started.error());
    return 0;
  }
  return supervisor_.running().back().pid;
}

bool FaultSession::back() const {
  double peak_n = 0.0;
  for (const Felt& felt : out_.trace) peak_n = std::max(peak_n, felt.force_n);
  const Felt& last = out_.trace.back();
  return last.time_ns > over_ns_ + 100 * rtbus::kNsPerMs && last.force_n > 0.5 * peak_n && last.force_n > kPressed_n;
}

void FaultSession::await_what_comes() {
  switch (setup_.row->ends) {
    case Ends::kComesBack:
      if (!follow_until(kBack_s, [this] { return back(); })) fail("the force did not come back");
      return follow(kSettle_s);
    case Ends::kStaysAtZero:
      return follow(kHold_s);
    case Ends::kWithSession:
      if (!follow_until(kEnd_s, [this] { return run_pid_ == 0; })) fail("the session did not end");
      return follow(kSettle_s);
    case Ends::kMayGoOn:
      out_.went_on = run_pid_ != 0;
      return follow(kSettle_s);
    case Ends::kNeverStarts:
      return;
  }
}

void FaultSession::take_pauses(BareLoop& witness) {
  witness.stop();
  out_.wakeup_ms = worst_wakeup_ms_;
  if (setup_.row->takes_core) return;
  out_.pause_ms = static_cast<double>(witness.wakeup_ns().max()) * 1e-6;
  // Without the right to a priority above the loop's, nothing tells the machine's delays from ours.
  if (!witness.grant().fifo && !setup_.row->own_wakeups) out_.pause_ms = std::max(out_.pause_ms, worst_wakeup_ms_);
}

FaultOutcome FaultSession::run() {
  if (start()) {
    BareLoop witness({.core = haptic_core(), .priority = kWitnessPriority});
    follow(kWitnessUp_s);
    forget_the_past();
    stats_before_ = stats_now_;
    const std::uint32_t same_node = haptic_beat_now_.value.pid;
    happens_ = true;
    mark_fault();
    setup_.row->happen(*this);
    if (over_ns_ == 0) over_ns_ = rtbus::monotonic_ns();
    if (out_.problem.empty()) await_what_comes();
    out_.limit_n = info_now_.value.force_limit_n;
    take_pauses(witness);
    if (haptic_beat_now_.value.pid == same_node) {
      const rtbus::LoopStats &now = stats_now_.value, &before = stats_before_.value;
      out_.ticks = now.ticks - before.ticks;
      out_.due = now.ticks_due - before.ticks_due;
      out_.overruns = now.overruns - before.overruns;
      out_.elapsed_s = rtbus::seconds_between(stats_before_.stamp_ns, stats_now_.stamp_ns);
      out_.rate_hz = now.rate_hz;
    }
    if (setup_.row->held && without_force_.empty()) expect_no_force(out_.fault_ns, over_ns_);
  }
  if (!out_.trace.empty()) judge_trace(over_ns_, out_, without_force_);
  // Without a force there is nothing that a pause could delay.
  if (setup_.row->own_pauses || setup_.row->ends == Ends::kNeverStarts) out_.pause_ms = 0.0;
  end();
  return std::move(out_);
}

void FaultSession::end() {
  ending_ = true;
  if (run_pid_ > 1) {
    ::kill(run_pid_, SIGINT);
    (void)follow_until(kEnd_s, [this] { return run_pid_ == 0; });
    if (run_pid_ != 0) fail("rtbus run did not end");
  }
  (void)supervisor_.end_all();
  std::remove(trigger().c_str());
  topics_.reset();
  for (const rtbus::TopicInfo& topic : rtbus::list_topics(session_.name)) out_.left_over.push_back(topic.topic);
  std::ifstream file(setup_.report);
  const auto report = nlohmann::json::parse(file, nullptr, false);
  if (report.is_object() && report.contains("restarts")) {
    out_.restarts = static_cast<int>(report["restarts"].size());
    if (out_.restarts == 1) out_.restarted = report["restarts"][0].value("node", "");
  }
  // What was written over the telemetry is no wake-up: the node's own count of its whole life is never less.
  const nlohmann::json::json_pointer latest("/haptic/0/wakeup_latency_us/max");
  if (out_.ticks > 0 && report.is_object() && report.contains(latest) && report[latest].is_number()) {
    out_.wakeup_ms = std::min(out_.wakeup_ms, report[latest].get<double>() * 1e-3);
  }
}

}  // namespace tools
