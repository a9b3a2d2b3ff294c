#include "tools/cli/run/live_run.hpp"

#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "rtbus/clock.hpp"
#include "rtbus/realtime.hpp"
#include "rtbus/topic.hpp"
#include "rtbus/topic_directory.hpp"
#include "tools/cli/common/command.hpp"
#include "tools/cli/common/interrupt.hpp"
#include "tools/cli/common/run_progress.hpp"
#include "tools/cli/common/text_table.hpp"
#include "tools/cli/common/utc_now.hpp"
#include "tools/cli/host/bare_loop.hpp"
#include "tools/cli/run/order_desk.hpp"
#include "tools/cli/run/report.hpp"
#include "tools/cli/run/restarts.hpp"
#include "tools/cli/run/run_observer.hpp"
#include "tools/cli/run/run_plots.hpp"
#include "tools/cli/run/run_recording.hpp"
#include "tools/cli/run/run_stills.hpp"
#include "tools/cli/run/supervisor.hpp"

namespace tools {

namespace {

namespace fs = std::filesystem;

constexpr std::uint64_t kDrainPeriod_ns = 20 * rtbus::kNsPerMs;
constexpr std::uint64_t kShowPeriod_ns = 200 * rtbus::kNsPerMs;
constexpr double kStartPatience_s = 15.0;    // a loaded machine, sanitizers, a device that homes
constexpr double kEnginePatience_s = 300.0;  // somebody starts it by hand

/// CPU time and published counts at one moment; two of them make rates.
struct Snapshot {
  std::uint64_t time_ns = rtbus::monotonic_ns();
  std::map<std::string, ProcessUsage> processes;  ///< By the child's name.
  std::vector<rtbus::TopicInfo> topics;

  Snapshot(const Supervisor& supervisor, const std::string& session) : topics(rtbus::list_topics(session)) {
    for (const ChildView& child : supervisor.running()) {
      if (const auto usage = ask_process(child.pid)) processes[child.name] = *usage;
    }
  }
};

/// One run, from the first child to the last line.
class Run {
 public:
  Run(const RunOptions& options, RunPlan plan)
      : options_(options),
        plan_(std::move(plan)),
        progress_(!options.quiet && ::isatty(STDERR_FILENO) == 1 && options.duration_s.value_or(1e9) > 2.0,
                  !options.quiet),
        supervisor_([this](const std::string&, std::string_view line) { progress_.log(line); }) {
    for (const haptic::HapticConfig& haptic : plan_.haptic) {
      observers_.push_back(std::make_unique<HapticObserver>(plan_.session, haptic, draws()));
    }
    if (plan_.physics) physics_.emplace(plan_.session);
    if (options.stills && draws()) stills_.emplace(plan_);
    if (options.record.empty()) return;
    for (ChildSpec& node : plan_.nodes) {  // the recorder comes to hear their first tick too
      if (node.stage == Stage::kHaptic) node.arguments.emplace_back("--telemetry");
    }
  }

  int operator()();

 private:
  [[nodiscard]] bool draws() const {
    return !options_.no_plots && (!options_.plots.empty() || !options_.report.empty());
  }
  [[nodiscard]] bool start();
  [[nodiscard]] bool start_children(const std::vector<ChildSpec>& children);
  template <class Ready>
  [[nodiscard]] bool wait_for(const std::string& what, const Ready& ready);
  [[nodiscard]] bool all_beat();
  void follow();
  void start_bare_loop();
  void drain();
  void show();
  void fail(const ChildEnd& end, const std::string& more = "");
  void fail(const std::string& fault);
  [[nodiscard]] std::optional<ChildEnd> ended_node();
  [[nodiscard]] bool plan_restart(const ChildEnd& end);
  [[nodiscard]] bool start_again();
  /// The session goes on without its bridge, and fails at its end.
  [[nodiscard]] bool is_bridge(const std::string& name) const { return plan_.bridge && plan_.bridge->name == name; }
  void fill_report(const Snapshot& first, const Snapshot& last);
  [[nodiscard]] int finish();

  const RunOptions& options_;
  RunPlan plan_;
  RunProgress progress_;
  std::vector<std::unique_ptr<HapticObserver>> observers_;
  std::optional<PhysicsObserver> physics_;
  std::optional<RunStills> stills_;
  std::unique_ptr<BareLoop> bare_;
  std::unique_ptr<OrderDesk> desk_;
  Restarts restarts_{plan_, !options_.no_restart};
  RunReport report_;
  std::uint64_t began_ns_ = rtbus::monotonic_ns();
  std::uint64_t running_ns_ = 0;
  std::uint64_t shown_ns_ = 0;
  Supervisor supervisor_;  ///< Last, so that the nodes have ended before anything they are reported to is gone.
  RunRecording recording_{supervisor_, plan_, options_.file, options_.assignments};
};

void Run::fail(const std::string& fault) {
  report_.faults.push_back(fault);
  progress_.clear();
  std::fprintf(stderr, "rtbus run: %s\n", fault.c_str());
}

/// A node that has ended. The session goes on without its recorder, and fails at its end.
std::optional<ChildEnd> Run::ended_node() {
  auto end = supervisor_.poll();
  if (!end || end->name != RunRecording::kName) return end;
  if (const std::string fault = recording_.on_end(*end); !fault.empty()) fail(fault);
  return std::nullopt;
}

void Run::fail(const ChildEnd& end, const std::string& more) {
  std::string fault = end.name + " (pid " + std::to_string(end.pid) + ") " + end.how();
  if (!more.empty()) fault += ", " + more;
  report_.faults.push_back(fault);
  progress_.clear();
  if (options_.quiet) {  // its words have not been shown yet
    for (const std::string& line : end.last_words) std::fprintf(stderr, "%s\n", line.c_str());
  }
  std::fprintf(stderr, "rtbus run: %s\n", fault.c_str());
}

bool Run::start_children(const std::vector<ChildSpec>& children) {
  for (const ChildSpec& child : children) {
    if (auto started = supervisor_.start(child); !started) {
      report_.faults.push_back(started.error());
      std::fprintf(stderr, "rtbus run: %s\n", started.error().c_str());
      return false;
    }
  }
  return true;
}

template <class Ready>
bool Run::wait_for(const std::string& what, const Ready& ready) {
  const double patience_s = plan_.awaits_physics ? kEnginePatience_s : kStartPatience_s;
  const std::uint64_t end_ns = rtbus::monotonic_ns() + static_cast<std::uint64_t>(patience_s * 1e9);
  while (!ready()) {
    if (const auto end = ended_node()) {
      fail(*end);
      return false;
    }
    if (rtbus::monotonic_ns() > end_ns) {
      report_.faults.push_back(what + " did not come within " + fixed(patience_s, 0) + " s");
      std::fprintf(stderr, "rtbus run: %s\n", report_.faults.back().c_str());
      return false;
    }
    if (!desk_->serve(kDrainPeriod_ns)) {
      std::fprintf(stderr, "rtbus run: interrupted before all nodes ran\n");
      return false;
    }
  }
  return true;
}

bool Run::all_beat() {
  std::vector<std::string> names;
  if (plan_.physics) names.emplace_back("physics");
  for (const haptic::HapticConfig& haptic : plan_.haptic) names.push_back(haptic.name);
  return std::all_of(names.begin(), names.end(), [this](const std::string& name) {
    auto reader = rtbus::Reader<rtbus::Heartbeat>::open(plan_.session, name + ".heartbeat");
    rtbus::Stamped<rtbus::Heartbeat> beat;
    return reader && reader->writer_alive() && reader->read_latest(beat) == rtbus::ReadStatus::kFresh &&
           beat.value.state == static_cast<std::uint32_t>(rtbus::NodeState::kRunning);
  });
}

bool Run::start() {
  auto desk = OrderDesk::open(plan_, recording_);
  if (!desk) {
    fail(desk.error());
    return false;
  }
  desk_ = std::move(*desk);
  if (!options_.record.empty()) {
    if (auto recorded = recording_.start(options_.record, options_.record_with); !recorded) {
      fail(recorded.error());
      return false;
    }
  }
  if (!start_children(plan_.plants)) return false;
  for (const haptic::HapticConfig& haptic : plan_.haptic) {
    if (!haptic.device->own_process()) continue;
    const std::string topic = haptic.name + ".plant_state";
    const auto there = [&] {
      auto reader = rtbus::Reader<rtbus::PlantState>::open(plan_.session, topic);
      return reader && reader->writer_alive();
    };
    if (!wait_for(topic, there)) return false;
  }
  if (!start_children(plan_.nodes)) return false;
  if (plan_.awaits_physics) {
    std::fprintf(stderr, "rtbus run: waits for the physics of %s, an engine that you start (engine: external)\n",
                 plan_.session.name.c_str());
  }
  if (!wait_for("a running heartbeat of every node", [this] { return all_beat(); })) return false;
  const bool complete = wait_for("the topics of every node", [this] {
    bool all = !physics_ || physics_->attach();
    for (const auto& observer : observers_) all = observer->attach() && all;
    if (stills_) all = stills_->attach() && all;
    return all;
  });
  if (complete && plan_.bridge) (void)start_children({*plan_.bridge});  // the session goes on without it
  return complete;
}

bool Run::plan_restart(const ChildEnd& end) {
  const std::uint64_t now_ns = rtbus::monotonic_ns();
  const RestartPolicy::Verdict verdict = restarts_.on_end(end, now_ns);
  if (!verdict.restart) {
    fail(end, verdict.why_not);
    return is_bridge(end.name);
  }
  RestartFigures restart;
  restart.node = end.name;
  restart.how = end.how();
  if (WIFEXITED(end.wait_status)) restart.status = WEXITSTATUS(end.wait_status);
  if (WIFSIGNALED(end.wait_status)) restart.signal = WTERMSIG(end.wait_status);
  restart.at_s = rtbus::seconds_between(running_ns_, now_ns);
  restart.lived_s = rtbus::seconds_between(end.started_ns, now_ns);
  restart.delay_s = verdict.delay_s;
  report_.restarts.push_back(restart);
  progress_.clear();
  if (options_.quiet) {  // its words have not been shown yet
    for (const std::string& line : end.last_words) std::fprintf(stderr, "%s\n", line.c_str());
  }
  std::fprintf(stderr, "rtbus run: %s (pid %d) %s; started again in %s s\n", end.name.c_str(), end.pid,
               restart.how.c_str(), fixed(verdict.delay_s, 2).c_str());
  return true;
}

bool Run::start_again() {
  while (const auto child = restarts_.take_due(rtbus::monotonic_ns())) {
    if (!start_children({*child}) && !is_bridge(child->name)) return false;
  }
  return true;
}

void Run::drain() {
  for (const auto& observer : observers_) observer->drain();
  if (physics_) physics_->drain();
  if (stills_ && running_ns_ != 0) stills_->drain(rtbus::seconds_between(running_ns_, rtbus::monotonic_ns()));
}

void Run::start_bare_loop() {
  // Its phase and core are those of the first haptic loop, which has told both by now.
  if (observers_.empty()) return;
  const HapticObserver& beside = *observers_.front();
  if (bare_ || options_.report.empty() || options_.no_bare_loop || beside.observed_ticks() == 0 ||
      beside.info().rate_hz <= 0.0) {
    return;
  }
  BareLoopOptions options;
  options.period_ns = beside.config().period_ns();
  options.phase_ns = beside.last_tick().due_ns;
  options.core = static_cast<std::int32_t>(beside.info().core);  // 0xffffffff is −1: not pinned
  options.priority = std::max(1, beside.config().realtime.priority - 1);
  bare_ = std::make_unique<BareLoop>(options);
}

void Run::show() {
  const std::uint64_t now_ns = rtbus::monotonic_ns();
  if (!progress_.has_bar() || now_ns < shown_ns_ + kShowPeriod_ns) return;
  shown_ns_ = now_ns;
  std::string figures;
  for (const auto& observer : observers_) {
    const rtbus::Vec3& f = observer->last_tick().force_n;
    figures += "  " + observer->config().name + " " + fixed(observer->achieved_hz(), 0) + " Hz " +
               fixed(std::hypot(f[0], f[1], f[2]), 2) + " N";
  }
  if (physics_) figures += "  physics " + fixed(physics_->stats().achieved_hz, 0) + " Hz";
  progress_.show(rtbus::seconds_between(running_ns_, now_ns), options_.duration_s.value_or(0.0), figures);
}

void Run::follow() {
  if (!options_.duration_s && !options_.quiet && !progress_.has_bar()) {
    std::fprintf(stderr, "rtbus run: session %s runs until Ctrl-C\n", plan_.session.name.c_str());
  }
  const std::uint64_t end_ns =
      options_.duration_s ? running_ns_ + static_cast<std::uint64_t>(*options_.duration_s * 1e9) : UINT64_MAX;
  while (true) {
    // The others go on, safely, while a node is away; without it for good the run is not what was asked for.
    const auto end = ended_node();
    if ((end && !plan_restart(*end)) || !start_again()) {
      report_.ended = "failure";
      return;
    }
    drain();
    for (const auto& observer : observers_) {
      desk_->heed_device(observer->config(), observer->estop_pressed_ns(), observer->estop_acted_ns());
    }
    start_bare_loop();
    show();
    const std::uint64_t now_ns = rtbus::monotonic_ns();
    if (now_ns >= end_ns) {
      report_.ended = "duration";
      return;
    }
    if (!desk_->serve(std::min(kDrainPeriod_ns, end_ns - now_ns))) {
      report_.ended = "interrupt";
      return;
    }
  }
}

void Run::fill_report(const Snapshot& first, const Snapshot& last) {
  const auto cost = [&](const std::string& name) {
    const auto before = first.processes.find(name), after = last.processes.find(name);
    if (before == first.processes.end() || after == last.processes.end()) return ProcessCost{};
    return ProcessCost{restarts_.ended_cpu_s(name) + after->second.cpu_s - before->second.cpu_s,
                       static_cast<double>(after->second.rss_bytes) / (1024.0 * 1024.0), after->second.threads};
  };
  report_.duration_s = rtbus::seconds_between(first.time_ns, last.time_ns);
  for (const auto& observer : observers_) {
    report_.haptic.push_back(observer->figures());
    report_.haptic.back().cost = cost(observer->config().name);
  }
  if (physics_) {
    report_.physics = physics_->figures();
    report_.physics->cost = cost("physics");
    for (const auto& observer : observers_) report_.physics->proxies.push_back(observer->proxy_figures());
  }
  if (bare_) {
    const haptic::HapticConfig& beside = observers_.front()->config();
    report_.bare_loop = bare_->figures(beside.name, beside.rate_hz);
  }
  for (const rtbus::TopicInfo& topic : last.topics) {
    report_.shm_bytes += topic.segment_bytes;
    const auto before = std::find_if(first.topics.begin(), first.topics.end(),
                                     [&](const rtbus::TopicInfo& each) { return each.topic == topic.topic; });
    // A topic that was made anew counts from one again.
    const std::uint64_t base =
        before == first.topics.end() || before->published > topic.published ? 0 : before->published;
    report_.topics.push_back({topic.topic, topic.type_name, topic.sample_bytes, topic.published,
                              static_cast<double>(topic.published - base) / report_.duration_s});
  }
}

int Run::finish() {
  if (draws()) {
    RunPlots plots;
    const fs::path report(options_.report);
    plots.folder =
        !options_.plots.empty() ? fs::path(options_.plots) : report.parent_path() / (report.stem().string() + "_plots");
    plots.session = plan_.session.name;
    for (const auto& observer : observers_) plots.haptic.push_back(observer.get());
    plots.bare = bare_.get();
    RunPlotsOutcome drawn = draw_run_plots(plots);
    report_.figures = std::move(drawn.files);
    if (!drawn.problem.empty()) std::fprintf(stderr, "rtbus run: %s\n", drawn.problem.c_str());
    if (stills_) {
      const StillsOutcome rendered = stills_->draw(plots.folder);
      report_.figures.insert(report_.figures.end(), rendered.files.begin(), rendered.files.end());
      if (!rendered.problem.empty()) std::fprintf(stderr, "rtbus run: %s\n", rendered.problem.c_str());
    }
  }
  report_.wall_s = rtbus::seconds_between(began_ns_, rtbus::monotonic_ns());
  // Texts of a node may hold anything: what is no UTF-8 is replaced.
  const std::string text = to_json(report_).dump(2, ' ', false, nlohmann::ordered_json::error_handler_t::replace);
  bool written = true;
  if (!options_.report.empty()) {
    std::ofstream out(options_.report);
    out << text << '\n';
    out.close();
    written = static_cast<bool>(out);
    if (!written) std::fprintf(stderr, "rtbus run: cannot write %s\n", options_.report.c_str());
  }
  if (options_.json) {
    std::printf("%s\n", text.c_str());
  } else {
    std::printf("%s", to_text(report_).c_str());
    if (written && !options_.report.empty()) std::printf("report: %s\n", options_.report.c_str());
    for (const std::string& recording : report_.recordings) std::printf("recording: %s\n", recording.c_str());
    for (const std::string& figure : report_.figures) {
      if (figure.ends_with(".png")) std::printf("figure: %s\n", figure.c_str());
    }
  }
  return report_.faults.empty() && written ? kExitFine : kExitFailed;
}

int Run::operator()() {
  // Who takes the orders has to get a CPU on a busy machine too, and so has a process that was killed: only when it has
  // ended does the kernel send its children SIGTERM. The loops and what started them come first.
  const rtbus::ThreadScheduling ordinary;
  (void)rtbus::prefer_on_time();
  report_.config = options_.file;
  report_.overrides = options_.assignments;
  report_.session = plan_.session.name;
  report_.scene = plan_.scene;
  report_.warnings = plan_.warnings;
  report_.started_utc = utc_now();
  report_.machine = ask_machine();

  const bool started = start();
  std::optional<Snapshot> first, last;
  if (started) {
    first.emplace(supervisor_, plan_.session.name);
    running_ns_ = first->time_ns;
    follow();
    last.emplace(supervisor_, plan_.session.name);
    if (bare_) bare_->stop();
    for (const std::string& name : restarts_.waiting()) {
      report_.faults.push_back(name + " had crashed and was not back when the session ended");
      progress_.clear();
      std::fprintf(stderr, "rtbus run: %s\n", report_.faults.back().c_str());
    }
  }
  progress_.clear();
  for (const ChildEnd& end : supervisor_.end_all()) fail(end);
  report_.recordings = recording_.files();
  drain();  // what the nodes published last is still mapped here
  // A node that was killed could not remove its topics.
  rtbus::remove_dead(plan_.session.name);
  ordinary.restore();
  if (!started) return kExitFailed;
  fill_report(*first, *last);
  return finish();
}

}  // namespace

int run_session(const RunOptions& options, RunPlan plan) { return Run(options, std::move(plan))(); }

}  // namespace tools
