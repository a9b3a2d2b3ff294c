#include "tools/evaluation/soak/soak_session.hpp"

#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <limits>
#include <memory>
#include <optional>

#include "rtbus/clock.hpp"
#include "rtbus/contact_messages.hpp"
#include "rtbus/messages.hpp"
#include "rtbus/order_messages.hpp"
#include "rtbus/subscription.hpp"
#include "rtbus/topic_directory.hpp"
#include "tools/cli/common/interrupt.hpp"
#include "tools/cli/run/supervisor.hpp"
#include "tools/harness/random.hpp"

namespace tools {

namespace {

constexpr double kStart_s = 40.0, kLongestReturn_s = 30.0;
/// A command takes at most a second for its answer, and as long as a busy machine needs to start it.
constexpr double kToolEnd_s = 20.0;
/// The promise is 100 ms (docs/orders.md); a paused machine adds to it, and the check of returns judges the speed.
constexpr double kOrderFelt_s = 5.0;
/// node_info and orders are published once a second, and a hand-over takes two samples.
constexpr double kHandOver_s = 10.0, kHandOverLook_s = 0.25;
constexpr double kPressed_n = 0.3;
constexpr std::uint64_t kLook_ns = 10 * rtbus::kNsPerMs;

double norm(const rtbus::Vec3& v) { return std::hypot(v[0], v[1], v[2]); }

/// Attached as tools are.
struct Observers {
  explicit Observers(const rtbus::Session& session)
      : ticks(session, "haptic0.telemetry", {.presence = true}),
        poses(session, "physics.proxy_state.haptic0", {.presence = true}),
        points(session, "physics.contact_points.haptic0", {.presence = true}) {}
  void look() {
    rtbus::Stamped<rtbus::Telemetry> tick;
    while (ticks.read_next(tick) == rtbus::ReadStatus::kFresh) {
    }
    (void)poses.read_latest(pose);
    ticks.maintain();
    poses.maintain();
    points.maintain();
  }
  rtbus::Subscription<rtbus::Telemetry> ticks;
  rtbus::Subscription<rtbus::ProxyState> poses;
  rtbus::Subscription<rtbus::ContactPoints> points;
  rtbus::Stamped<rtbus::ProxyState> pose;
};

class Soak {
 public:
  explicit Soak(const SoakSetup& setup)
      : setup_(setup), random_(setup.seed), supervisor_([](const std::string&, std::string_view) {}) {
    session_.name = setup.name;
    plant_.emplace(session_, "haptic0.plant_state");
    stats_.emplace(session_, "haptic0.loop_stats");
    order_topic_.emplace(session_, "haptic0.orders");
  }

  SoakOutcome run() {
    if (start()) {
      const std::uint64_t end_ns = rtbus::monotonic_ns() + static_cast<std::uint64_t>(setup_.seconds * 1e9);
      follow(1.0);
      take_stock();
      while (out_.problem.empty() && rtbus::monotonic_ns() < end_ns && !interrupted()) {
        follow(random_.between(0.3, 2.0));
        const SoakEvent event = draw();
        ++out_.events[to_string(event)];
        absorbed_before_j_ = last_.value.energy_absorbed_j;
        happen(event);
        await_return(event);
        if (event == SoakEvent::kTopicsDeleted) await_hand_over();
        follow(0.6);  // what restarted has its memory and its threads
        take_stock();
      }
    }
    end();
    return std::move(out_);
  }

 private:
  SoakEvent draw() {
    // However short the session is.
    if (out_.events.empty() && can_happen(SoakEvent::kDeviceFails)) return SoakEvent::kDeviceFails;
    for (;;) {
      const auto event = static_cast<SoakEvent>(random_.below(kSoakEvents));
      if (can_happen(event)) return event;
    }
  }
  /// A virtual device lives in the haptic node: it dies with it. Its sessions have a wall alone, and no physics
  /// process.
  [[nodiscard]] bool can_happen(SoakEvent event) const {
    switch (event) {
      case SoakEvent::kPhysicsKilled:
      case SoakEvent::kPhysicsStopped:
      case SoakEvent::kHapticKilled:
      case SoakEvent::kPlantKilled:
      case SoakEvent::kPlantStopped:
        return setup_.trigger.empty();
      case SoakEvent::kDeviceFails:
        return !setup_.trigger.empty();
      default:
        return true;
    }
  }

  void look() {
    rtbus::Stamped<rtbus::PlantState> state;
    while (plant_->read_next(state) == rtbus::ReadStatus::kFresh) {
      force_n_ = norm(state.value.applied_force_n);
      out_.peak_n = std::max(out_.peak_n, force_n_);
      if (force_n_ > limit_n_ * (1.0 + 1e-6)) ++out_.above_limit;
      felt_ns_ = state.stamp_ns;
    }
    rtbus::Stamped<rtbus::LoopStats> stats;
    if (stats_->read_latest(stats) == rtbus::ReadStatus::kFresh) {
      // Another life of the loop counts from zero: the one before is over.
      if (stats.value.ticks_due < last_.value.ticks_due) {
        bank();
        absorbed_before_j_ = 0.0;
      }
      if (last_.stamp_ns == 0) first_ = stats;
      last_ = stats;
      const double absorbed_j = last_.value.energy_absorbed_j;
      out_.least_absorbed_j = std::min(out_.least_absorbed_j, absorbed_j);
      out_.least_since_event_j = std::min(out_.least_since_event_j, absorbed_j - absorbed_before_j_);
    }
    if (observers_) observers_->look();
    (void)order_topic_->read_latest(orders_);
    plant_->maintain();
    stats_->maintain();
    order_topic_->maintain();
  }
  void bank() {
    if (last_.stamp_ns == 0) return;
    const rtbus::LoopStats &first = first_.value, &last = last_.value;
    out_.ticks += last.ticks;
    out_.due += last.ticks_due;
    out_.overruns += last.overruns;
    const double passed = last.rate_hz * rtbus::seconds_between(first_.stamp_ns, last_.stamp_ns);
    const double told =
        static_cast<double>(last.ticks + last.overruns) - static_cast<double>(first.ticks + first.overruns);
    out_.ticks_not_told = std::max(out_.ticks_not_told, std::abs(passed - told));
    last_ = {};
  }

  template <class Condition>
  bool follow_until(double timeout_s, const Condition& condition) {
    const std::uint64_t end_ns = rtbus::monotonic_ns() + static_cast<std::uint64_t>(timeout_s * 1e9);
    while (rtbus::monotonic_ns() < end_ns) {
      look();
      if (condition()) return true;
      if (auto ended = supervisor_.poll()) {
        if (ended->name == kRun) {
          take_end(*ended);
          return false;
        }
        if (ended->name == tool_) tool_end_ = std::move(ended);
      }
      rtbus::sleep_until(rtbus::monotonic_ns() + kLook_ns);
    }
    return false;
  }
  void follow(double seconds) {
    (void)follow_until(seconds, [] { return false; });
  }
  void take_end(const ChildEnd& ended) {
    out_.exit_status =
        WIFEXITED(ended.wait_status) ? WEXITSTATUS(ended.wait_status) : 128 + WTERMSIG(ended.wait_status);
    pid_ = 0;
    if (ending_) return;
    out_.problem = "rtbus run " + ended.how();
    for (const std::string& line : ended.last_words) out_.problem += "\n  " + line;
  }

  bool start() {
    ChildSpec spec{kRun,
                   Stage::kPlant,
                   setup_.program,
                   {"run", setup_.session_file, "--set", "session=" + setup_.name, "--set", "supervise.restarts=1000",
                    "--set", "supervise.longest_delay_s=0.5", "--no-plots", "--no-bare-loop"}};
    for (const std::string& text : setup_.assignments) spec.arguments.insert(spec.arguments.end(), {"--set", text});
    if (auto started = supervisor_.start(spec); !started) {
      out_.problem = started.error();
      return false;
    }
    pid_ = supervisor_.running()[0].pid;
    const bool pressed = follow_until(kStart_s, [this] { return force_n_ > kPressed_n; });
    if (!pressed && out_.problem.empty()) out_.problem = "the hand never pressed on the wall";
    rtbus::Subscription<rtbus::NodeInfo> told(session_, "haptic0.node_info");
    rtbus::Stamped<rtbus::NodeInfo> info;
    const bool known = pressed && follow_until(kHandOver_s, [&] {
                         told.maintain();
                         return told.read_latest(info) == rtbus::ReadStatus::kFresh && info.value.force_limit_n > 0.0;
                       });
    if (pressed && !known && out_.problem.empty()) out_.problem = "the node does not tell its largest force";
    limit_n_ = info.value.force_limit_n;
    if (out_.peak_n > limit_n_ * (1.0 + 1e-6)) ++out_.above_limit;
    return known;
  }

  void signal_child(const char* program, int signal) const {
    const auto uses = uses_below(pid_);
    if (const auto found = uses.find(program); found != uses.end() && found->second.pid > 1) {
      ::kill(found->second.pid, signal);
    }
  }
  void stop_for_a_while(const char* program) {
    signal_child(program, SIGSTOP);
    follow(random_.between(0.05, 1.2));
    signal_child(program, SIGCONT);
  }
  /// @returns its process; 0: it could not be started.
  pid_t start_tool(std::vector<std::string> arguments) {
    tool_ = "tool " + std::to_string(++tools_);
    tool_end_.reset();
    if (auto started = supervisor_.start({tool_, Stage::kObserver, setup_.program, std::move(arguments)}); !started) {
      out_.problem = started.error();
      return 0;
    }
    return supervisor_.running().back().pid;
  }
  void kill_tool(std::vector<std::string> arguments) {
    const pid_t tool = start_tool(std::move(arguments));
    follow(random_.between(0.05, 0.8));
    if (tool > 1 && !tool_end_) ::kill(tool, SIGKILL);
    (void)follow_until(kToolEnd_s, [this] { return tool_end_.has_value(); });
  }
  /// An order by the command that users take. It ends by itself: it has a limit of its own for the answer.
  /// @returns whether the order was taken.
  bool order(std::vector<std::string> arguments) {
    const std::string what = arguments[0] + (arguments.size() > 1 ? " " + arguments[1] : "");
    arguments.insert(arguments.end(), {"--session", setup_.name});
    if (start_tool(std::move(arguments)) == 0) return false;
    if (!follow_until(kToolEnd_s, [this] { return tool_end_.has_value(); })) {
      if (out_.problem.empty()) out_.problem = "rtbus " + what + " had not ended after " + in_seconds(kToolEnd_s);
      return false;
    }
    if (tool_end_->wait_status == 0) return true;
    out_.problem = "rtbus " + what + " " + tool_end_->how();
    for (const std::string& line : tool_end_->last_words) out_.problem += "\n  " + line;
    return false;
  }
  static std::string in_seconds(double seconds) { return std::to_string(static_cast<int>(seconds)) + " s"; }
  /// An E-stop that was taken is in the topic of orders, and soon at the hand.
  void estop_and_rearm() {
    if (!order({"estop"})) return;
    const std::uint64_t taken_ns = rtbus::monotonic_ns();
    if (orders_.value.estop == 0 && !follow_until(kOrderFelt_s, [this] { return orders_.value.estop != 0; })) {
      if (out_.problem.empty()) out_.problem = "rtbus estop ended well, but haptic0.orders does not tell of an E-stop";
      return;
    }
    const auto felt = [&] { return felt_ns_ > taken_ns && force_n_ == 0.0; };
    if (!follow_until(kOrderFelt_s, felt)) {
      if (out_.problem.empty()) out_.problem = "an E-stop that was ordered did not end in zero force";
      return;
    }
    (void)order({"estop", "--rearm"});
  }

  void happen(SoakEvent event) {
    switch (event) {
      case SoakEvent::kPhysicsKilled:
        return signal_child("physics_node", SIGKILL);
      case SoakEvent::kPhysicsStopped:
        return stop_for_a_while("physics_node");
      case SoakEvent::kHapticKilled:
        return signal_child("haptic_node", SIGKILL);
      case SoakEvent::kHapticStopped:
        return stop_for_a_while("haptic_node");
      case SoakEvent::kPlantKilled:
        return signal_child("simulated_plant", SIGKILL);
      case SoakEvent::kPlantStopped:
        return stop_for_a_while("simulated_plant");
      case SoakEvent::kTopicsDeleted:
        for (const rtbus::TopicInfo& topic : rtbus::list_topics(session_.name)) {
          ::unlink(("/dev/shm/" + rtbus::segment_name(session_.name, topic.topic)).c_str());
        }
        return follow(0.5);
      case SoakEvent::kObservers:
        observers_ = std::make_unique<Observers>(session_);
        follow(random_.between(0.1, 1.5));
        observers_.reset();
        return;
      case SoakEvent::kObserverKilled:
        return kill_tool({"echo", "haptic0.telemetry", "--session", setup_.name});
      case SoakEvent::kEstop:
        return estop_and_rearm();
      case SoakEvent::kDeviceFails: {
        std::ofstream(setup_.trigger).flush();
        follow(random_.between(0.05, 1.2));
        std::error_code ignored;
        std::filesystem::remove(setup_.trigger, ignored);
        return;
      }
    }
  }

  void await_return(SoakEvent event) {
    const std::uint64_t from_ns = rtbus::monotonic_ns();
    // A loss is felt a tenth of a second later: a force that is still there is no return.
    follow(0.15);
    const bool back = follow_until(kLongestReturn_s,
                                   [&] { return felt_ns_ > from_ns + 100 * rtbus::kNsPerMs && force_n_ > kPressed_n; });
    if (!out_.problem.empty()) return;
    if (!back) {
      out_.problem = std::string("the force did not come back after ") + to_string(event);
      return;
    }
    const double seconds = rtbus::seconds_between(from_ns, rtbus::monotonic_ns());
    if (seconds <= out_.slowest_return_s) return;
    out_.slowest_return_s = seconds;
    out_.slowest_after = to_string(event);
  }

  /// A writer keeps the ring that was deleted until the one that publishes has let it go: two samples later, which are
  /// seconds for the slowest topics. Those that nobody reads publish for an observer.
  void await_hand_over() {
    observers_ = std::make_unique<Observers>(session_);
    for (double waited_s = 0.0; pid_ > 0 && waited_s < kHandOver_s; waited_s += kHandOverLook_s) {
      follow(kHandOverLook_s);
      if (pid_ <= 0 || !watch_.more_descriptors(pid_)) break;
    }
    observers_.reset();
  }

  void take_stock() {
    if (pid_ <= 0) return;
    watch_.look(pid_);
    const int segments = segments_of(session_.name);
    if (segments_ == 0) segments_ = segments;
    out_.segments_more = std::max(out_.segments_more, segments - segments_);
  }

  void end() {
    ending_ = true;
    bank();
    if (pid_ > 0) {
      ::kill(pid_, SIGINT);
      (void)follow_until(20.0, [] { return false; });
      if (pid_ > 0 && out_.problem.empty()) out_.problem = "rtbus run did not end";
    }
    (void)supervisor_.end_all();
    plant_.reset();
    stats_.reset();
    order_topic_.reset();
    out_.left_over = segments_of(session_.name);
    out_.growth = watch_.growth();
  }

  static constexpr const char* kRun = "rtbus run";

  const SoakSetup& setup_;
  rtbus::Session session_;
  Random random_;
  SoakOutcome out_;
  double force_n_ = 0.0;
  double absorbed_before_j_ = 0.0;                            ///< When the last event began.
  double limit_n_ = std::numeric_limits<double>::infinity();  ///< The node tells it before the hand presses.
  std::uint64_t felt_ns_ = 0;
  rtbus::Stamped<rtbus::LoopStats> first_, last_;  ///< Of the present life of the loop.
  pid_t pid_ = 0;
  bool ending_ = false;
  int segments_ = 0, tools_ = 0;
  ProcessWatch watch_;
  std::optional<rtbus::Subscription<rtbus::PlantState>> plant_;
  std::optional<rtbus::Subscription<rtbus::LoopStats>> stats_;
  std::optional<rtbus::Subscription<rtbus::Orders>> order_topic_;
  rtbus::Stamped<rtbus::Orders> orders_;
  std::unique_ptr<Observers> observers_;
  std::string tool_;                  ///< The last one that was started,
  std::optional<ChildEnd> tool_end_;  ///< and how it ended.
  Supervisor supervisor_;
};

}  // namespace

const char* to_string(SoakEvent event) noexcept {
  static constexpr const char* kNames[kSoakEvents] = {
      "physics killed",  "physics stopped", "haptic node killed", "haptic node stopped",
      "plant killed",    "plant stopped",   "topics deleted",     "observers",
      "observer killed", "E-stop",          "device fails"};
  return kNames[static_cast<std::size_t>(event)];
}

SoakOutcome run_soak_session(const SoakSetup& setup) { return Soak(setup).run(); }

}  // namespace tools
