#include "tools/evaluation/faults/fault_cells.hpp"

#include <fcntl.h>
#include <signal.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <fstream>
#include <nlohmann/json.hpp>
#include <optional>

#include "rtbus/clock.hpp"
#include "rtbus/messages.hpp"
#include "rtbus/subscription.hpp"
#include "rtbus/topic_directory.hpp"
#include "tools/cli/run/supervisor.hpp"
#include "tools/evaluation/faults/stopped_thread.hpp"

namespace tools {

namespace {

constexpr std::uint64_t kLook_ns = 5 * rtbus::kNsPerMs;
constexpr double kStart_s = 25.0;  // a loaded machine, sanitizers
constexpr double kHold_s = 1.0;    // how long something stays stopped
constexpr double kBack_s = 10.0;   // back-off, start and ramp, with room
constexpr double kPressed_n = 0.3;

double norm(const rtbus::Vec3& v) { return std::hypot(v[0], v[1], v[2]); }

/// Everything that one looks at while a cell runs.
class Watch {
 public:
  explicit Watch(const rtbus::Session& session)
      : plant_(session, "haptic0.plant_state"),
        ticks_(session, "haptic0.telemetry", {.presence = true}),
        stats_(session, "haptic0.loop_stats"),
        haptic_beat_(session, "haptic0.heartbeat"),
        physics_beat_(session, "physics.heartbeat") {}

  void look() {
    rtbus::Stamped<rtbus::PlantState> state;
    while (plant_.read_next(state) == rtbus::ReadStatus::kFresh) {
      if (!trace.empty() && state.stamp_ns <= trace.back().time_ns) continue;
      trace.push_back({state.stamp_ns, norm(state.value.applied_force_n)});
      timed_out = timed_out || state.value.timed_out != 0;
    }
    rtbus::Stamped<rtbus::Telemetry> tick;
    while (ticks_.read_next(tick) == rtbus::ReadStatus::kFresh) {
      worst_wakeup_ms = std::max(worst_wakeup_ms, tick.value.wakeup_us * 1e-3);
    }
    (void)stats_.read_latest(stats);
    (void)haptic_beat_.read_latest(haptic);
    (void)physics_beat_.read_latest(physics);
    plant_.maintain();
    ticks_.maintain();
    stats_.maintain();
    haptic_beat_.maintain();
    physics_beat_.maintain();
  }
  [[nodiscard]] double force_n() const { return trace.empty() ? 0.0 : trace.back().force_n; }
  /// Forgets what was before, but for a tenth of a second.
  void begin() {
    look();
    const auto from = trace.size() > 400 ? trace.end() - 400 : trace.begin();
    trace.erase(trace.begin(), from);
    worst_wakeup_ms = 0.0;
    timed_out = false;
  }

  std::vector<Felt> trace;
  bool timed_out = false;
  double worst_wakeup_ms = 0.0;
  rtbus::Stamped<rtbus::LoopStats> stats;
  rtbus::Stamped<rtbus::Heartbeat> haptic, physics;

 private:
  rtbus::Subscription<rtbus::PlantState> plant_;
  rtbus::Subscription<rtbus::Telemetry> ticks_;
  rtbus::Subscription<rtbus::LoopStats> stats_;
  rtbus::Subscription<rtbus::Heartbeat> haptic_beat_, physics_beat_;
};

/// One cell, from `rtbus run` to its report.
class CellSession {
 public:
  explicit CellSession(const FaultSetup& setup)
      : fault_(setup.fault),
        setup_(setup),
        trigger_(setup.report + ".fault"),
        supervisor_([](const std::string&, std::string_view) {}) {
    session_.name = setup.session;
    watch_.emplace(session_);
  }

  FaultOutcome run() {
    if (start()) {
      out_.before_n = watch_->force_n();
      watch_->begin();
      before_ = watch_->stats;
      std::uint64_t ended_ns = break_something();
      if (out_.problem.empty()) {
        if (comes_back(setup_) && !follow(kBack_s, [&] { return back_since(ended_ns); })) {
          out_.problem = "the force did not come back";
        }
        follow(comes_back(setup_) ? 0.3 : kHold_s, [] { return false; });
      }
      out_.trace = std::move(watch_->trace);
      // A loop that its silent device paces wakes late without the machine's doing.
      out_.pause_ms = fault_ == Fault::kDevice ? 0.0 : watch_->worst_wakeup_ms;
      out_.device_timed_out = watch_->timed_out;
      if (fault_ != Fault::kHapticKilled) {
        const rtbus::LoopStats &before = before_.value, &after = watch_->stats.value;
        out_.ticks = after.ticks - before.ticks;
        out_.due = after.ticks_due - before.ticks_due;
        out_.overruns = after.overruns - before.overruns;
      }
      judge_trace(ended_ns, out_);
    }
    end();
    return std::move(out_);
  }

 private:
  template <class Condition>
  bool follow(double timeout_s, const Condition& condition) {
    const std::uint64_t end_ns = rtbus::monotonic_ns() + static_cast<std::uint64_t>(timeout_s * 1e9);
    while (rtbus::monotonic_ns() < end_ns) {
      watch_->look();
      if (condition()) return true;
      if (auto ended = supervisor_.poll()) {
        take_end(*ended);
        return false;
      }
      rtbus::sleep_until(rtbus::monotonic_ns() + kLook_ns);
    }
    return false;
  }

  void take_end(const ChildEnd& ended) {
    out_.exit_status =
        WIFEXITED(ended.wait_status) ? WEXITSTATUS(ended.wait_status) : 128 + WTERMSIG(ended.wait_status);
    if (ending_) return;
    out_.problem = "rtbus run " + ended.how();
    for (const std::string& line : ended.last_words) out_.problem += "\n  " + line;
  }

  bool start() {
    ChildSpec spec{"rtbus run",
                   Stage::kPlant,
                   setup_.program,
                   {"run", setup_.session_file, "--set", "session=" + setup_.session, "--report", setup_.report,
                    "--no-plots", "--no-bare-loop"}};
    std::remove(trigger_.c_str());
    if (setup_.device != nullptr) {
      for (const std::string& each : assignments_of(*setup_.device, trigger_)) {
        spec.arguments.insert(spec.arguments.end(), {"--set", each});
      }
    }
    if (setup_.python != nullptr) {
      for (const std::string& each : write_python_engine(setup_.report + ".py", trigger_, *setup_.python)) {
        spec.arguments.insert(spec.arguments.end(), {"--set", each});
      }
    }
    if (auto started = supervisor_.start(spec); !started) {
      out_.problem = started.error();
      return false;
    }
    pid_ = supervisor_.running()[0].pid;
    // In mid-push: the hand is on its way into the wall.
    const bool pressed = follow(kStart_s, [&] { return watch_->force_n() > kPressed_n; });
    if (!pressed && out_.problem.empty()) out_.problem = "the hand never pressed on the wall";
    return pressed;
  }

  [[nodiscard]] bool back_since(std::uint64_t ended_ns) const {
    double peak_n = 0.0;
    for (const Felt& felt : watch_->trace) peak_n = std::max(peak_n, felt.force_n);
    const Felt& last = watch_->trace.back();
    return last.time_ns > ended_ns + 100 * rtbus::kNsPerMs && last.force_n > 0.5 * peak_n && last.force_n > kPressed_n;
  }

  /// Does it, waits for zero where zero is promised, mends what must be mended. @returns when the fault was over.
  std::uint64_t break_something() {
    const auto haptic = static_cast<pid_t>(watch_->haptic.value.pid),
               physics = static_cast<pid_t>(watch_->physics.value.pid);
    const std::uint64_t beats = watch_->physics.value.beats;
    if (haptic <= 1 || (physics <= 1 && fault_ != Fault::kDevice)) {  // kill(2) takes 0 and -1 for many
      out_.problem = "a node does not name itself in its heartbeat";
      return rtbus::monotonic_ns();
    }
    out_.fault_ns = rtbus::monotonic_ns();
    switch (fault_) {
      case Fault::kPhysicsKilled:
      case Fault::kHapticKilled:
        ::kill(fault_ == Fault::kPhysicsKilled ? physics : haptic, SIGKILL);
        if (!follow(2.0, [&] { return watch_->force_n() == 0.0; })) out_.problem = "the force never went to zero";
        return out_.fault_ns;
      case Fault::kPhysicsStopped:
        stop_for_a_while(physics);
        break;
      case Fault::kEngineHung: {
        const auto hung = StoppedThread::stop(physics, "physics_step");
        if (!hung) {
          out_.problem = hung.error();
          break;
        }
        follow(kHold_s, [] { return false; });
        out_.beats = watch_->physics.value.beats - beats;
        break;
      }
      case Fault::kTopicsDeleted:
        delete_topics();
        break;
      case Fault::kDevice:
        std::ofstream(trigger_).flush();
        if (!follow(2.0, [&] { return watch_->force_n() == 0.0; })) out_.problem = "the force never went to zero";
        return out_.fault_ns + static_cast<std::uint64_t>(std::max(0.0, setup_.device->lasts_s) * 1e9);
      case Fault::kPython:
        if (setup_.python->statements[0] == '\0') {
          stop_for_a_while(physics);
        } else {
          let_python_fail();
        }
        break;
    }
    return rtbus::monotonic_ns();
  }

  void stop_for_a_while(pid_t process) {
    ::kill(process, SIGSTOP);
    follow(kHold_s, [] { return false; });
    ::kill(process, SIGCONT);
  }

  /// Lets the engine in Python fail, and waits until it has.
  void let_python_fail() {
    std::ofstream(trigger_).flush();
    if (!follow(5.0, [&] { return ::access(trigger_.c_str(), F_OK) != 0; })) {
      out_.problem = "the engine never began to fail";
    }
    out_.fault_ns = rtbus::monotonic_ns() - kLook_ns;  // it began within the last look
    if (ends_in_zero(setup_) && !follow(2.0, [&] { return watch_->force_n() == 0.0; })) {
      out_.problem = "the force never went to zero";
    }
    follow(kHold_s, [] { return false; });
  }

  void delete_topics() {
    for (const rtbus::TopicInfo& topic : rtbus::list_topics(session_.name)) {
      const std::string path = "/dev/shm/" + rtbus::segment_name(session_.name, topic.topic);
      if (::unlink(path.c_str()) != 0) continue;
      ++out_.topics;
      const auto is_back = [&] {
        for (const rtbus::TopicInfo& now : rtbus::list_topics(session_.name)) {
          if (now.topic != topic.topic) continue;
          // What is published for observers alone may be silent, before and after.
          return now.writer_alive && now.writer_pid == topic.writer_pid && (now.published > 0 || topic.published == 0);
        }
        return false;
      };
      if (follow(5.0, is_back)) ++out_.topics_back;
      // Until the old memory has been let go: what still hung on it would starve now.
      follow(0.35, [] { return false; });
    }
  }

  void end() {
    ending_ = true;
    if (out_.exit_status < 0 && pid_ > 0) {
      ::kill(pid_, SIGINT);
      follow(15.0, [] { return false; });
      if (out_.exit_status < 0)
        out_.problem += (out_.problem.empty() ? "" : "; ") + std::string("rtbus run did not end");
    }
    (void)supervisor_.end_all();
    std::remove(trigger_.c_str());
    watch_.reset();
    for (const rtbus::TopicInfo& topic : rtbus::list_topics(session_.name)) out_.left_over.push_back(topic.topic);
    std::ifstream file(setup_.report);
    const auto report = nlohmann::json::parse(file, nullptr, false);
    if (report.is_object() && report.contains("restarts")) {
      out_.restarts = static_cast<int>(report["restarts"].size());
      if (out_.restarts == 1) out_.restarted = report["restarts"][0].value("node", "");
    }
  }

  Fault fault_;
  const FaultSetup& setup_;
  const std::string trigger_;  ///< The file whose appearance makes a device fail.
  rtbus::Session session_;
  FaultOutcome out_;
  rtbus::Stamped<rtbus::LoopStats> before_;
  pid_t pid_ = 0;
  bool ending_ = false;
  std::optional<Watch> watch_;
  Supervisor supervisor_;
};

}  // namespace

FaultOutcome run_fault_cell(const FaultSetup& setup) { return CellSession(setup).run(); }

}  // namespace tools
