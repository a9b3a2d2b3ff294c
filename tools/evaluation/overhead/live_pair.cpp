#include "tools/evaluation/overhead/live_pair.hpp"
#include "tools/cli/common/find_config.hpp"

#include <unistd.h>

#include <algorithm>
#include <cctype>
#include <cstdio>
#include <filesystem>
#include <map>
#include <set>
#include <utility>

#include "rtbus/clock.hpp"
#include "rtbus/messages.hpp"
#include "rtbus/topic.hpp"
#include "rtbus/topic_directory.hpp"
#include "tools/cli/common/interrupt.hpp"
#include "tools/cli/host/ask_kernel.hpp"
#include "tools/cli/run/run_plan.hpp"
#include "tools/cli/run/supervisor.hpp"

namespace tools {

namespace {

constexpr std::uint64_t kPoll_ns = 20 * rtbus::kNsPerMs;
constexpr double kStartPatience_s = 15.0;
constexpr double kLagPatience_s = 60.0;  // to settle, in simulated time, on a machine that is busy with others

/// One run, from start to end.
class LiveRun {
 public:
  LiveRun(const LiveVariant& variant, RunPlan plan) : variant_(variant), plan_(std::move(plan)) {
    if (!variant.physics) {
      std::erase_if(plan_.nodes, [](const ChildSpec& child) { return child.stage == Stage::kPhysics; });
    }
  }

  std::optional<LiveFigures> operator()(double duration_s) {
    std::optional<LiveFigures> figures;
    if (start() && settle(variant_.settle_s) &&
        wait([&] { return simulated_long_enough(); }, kLagPatience_s, "simulate enough")) {
      if (proxies_) (void)proxies_->read_latest(proxy_);  // from here on
      steps_us_.clear();
      const Instant begin = now();
      if (settle(duration_s)) figures = measure(begin, now());
    }
    supervisor_.end_all();
    rtbus::remove_dead(plan_.session.name);
    if (variant_.record) (void)::unlink(recording().c_str());
    return figures;
  }

 private:
  bool start() {
    for (const ChildSpec& child : plan_.plants) {
      if (!supervisor_.start(child)) return false;
    }
    for (const haptic::HapticConfig& haptic : plan_.haptic) {
      if (!haptic.device->own_process()) continue;
      if (!wait([&] { return alive<rtbus::PlantState>(haptic.name + ".plant_state"); })) return false;
    }
    for (const ChildSpec& child : plan_.nodes) {
      if (!supervisor_.start(child)) return false;
    }
    return wait([&] {
      bool all = !plays_physics() || runs("physics");
      for (const haptic::HapticConfig& haptic : plan_.haptic) all = all && runs(haptic.name);
      return all && observe() && record();
    });
  }

  [[nodiscard]] std::string recording() const {
    return std::filesystem::temp_directory_path() / (plan_.session.name + ".h5");
  }

  /// Starts the recorder once there is something to record. It is the last to end, so that it loses nothing.
  bool record() {
    if (!variant_.record || recording_) return true;
    const std::vector<std::string> arguments{"record", recording(), "--session", plan_.session.name, "--json"};
    recording_ = supervisor_
                     .start({.name = "recorder",
                             .stage = Stage::kPlant,
                             .program = folder_of_this_program() + "/rtbus",
                             .arguments = arguments})
                     .has_value();
    return recording_;
  }

  [[nodiscard]] bool plays_physics() const { return plan_.physics && variant_.physics; }

  template <class T>
  bool alive(const std::string& topic) {
    auto reader = rtbus::Reader<T>::open(plan_.session, topic);
    return reader && reader->writer_alive();
  }

  bool runs(const std::string& node) {
    auto reader = rtbus::Reader<rtbus::Heartbeat>::open(plan_.session, node + ".heartbeat");
    rtbus::Stamped<rtbus::Heartbeat> beat;
    return reader && reader->writer_alive() && reader->read_latest(beat) == rtbus::ReadStatus::kFresh &&
           beat.value.state == static_cast<std::uint32_t>(rtbus::NodeState::kRunning);
  }

  bool observe() {
    if (plays_physics() && !proxies_) {
      auto opened =
          rtbus::Reader<rtbus::ProxyState>::open(plan_.session, "physics.proxy_state." + plan_.haptic.front().name);
      if (!opened) return false;
      proxies_.emplace(std::move(*opened));
    }
    if (variant_.observe_telemetry && !telemetry_) {
      auto opened = rtbus::Reader<rtbus::Telemetry>::open(plan_.session, plan_.haptic.front().name + ".telemetry",
                                                          {.presence = true});
      if (!opened) return false;
      telemetry_.emplace(std::move(*opened));
    }
    if (variant_.observe_bodies && !poses_ && !nodes_) {
      auto poses = rtbus::Reader<rtbus::BodyPoses>::open(plan_.session, "physics.body_poses", {.presence = true});
      if (poses) poses_.emplace(std::move(*poses));
      auto nodes = rtbus::Reader<rtbus::SoftNodes>::open(plan_.session, "physics.soft_nodes", {.presence = true});
      if (nodes) nodes_.emplace(std::move(*nodes));
      return poses_ || nodes_;
    }
    return true;
  }

  /// Follows the children and the times of the steps. What an observer asked for is not read: that is its own cost.
  bool poll() {
    if (const auto end = supervisor_.poll()) {
      std::fprintf(stderr, "%s %s\n", end->name.c_str(), end->how().c_str());
      for (const std::string& line : end->last_words) std::fprintf(stderr, "  %s\n", line.c_str());
      return false;
    }
    while (proxies_ && proxies_->read_next(proxy_) == rtbus::ReadStatus::kFresh) {
      steps_us_.push_back(1e6 * proxy_.value.step_compute_s);
    }
    return sleep_unless_interrupted(kPoll_ns);
  }

  template <class Condition>
  bool wait(const Condition& condition, double patience_s = kStartPatience_s, const char* what = "start") {
    const std::uint64_t end_ns = rtbus::monotonic_ns() + static_cast<std::uint64_t>(patience_s * 1e9);
    while (!condition()) {
      if (rtbus::monotonic_ns() > end_ns) {
        std::fprintf(stderr, "%s did not %s within %.0f s\n", variant_.session_file.c_str(), what, patience_s);
        return false;
      }
      if (!poll()) return false;
    }
    return true;
  }

  /// On a busy machine simulated time falls behind, and with it the sleep of bodies.
  bool simulated_long_enough() {
    if (!plays_physics()) return true;
    auto steps = rtbus::Reader<rtbus::StepStats>::open(plan_.session, "physics.step_stats");
    rtbus::Stamped<rtbus::StepStats> stats;
    return steps && steps->read_latest(stats) == rtbus::ReadStatus::kFresh &&
           stats.value.simulated_s >= variant_.settle_s;
  }

  bool settle(double seconds) {
    const std::uint64_t end_ns = rtbus::monotonic_ns() + static_cast<std::uint64_t>(seconds * 1e9);
    while (rtbus::monotonic_ns() < end_ns) {
      if (!poll()) return false;
    }
    return true;
  }

  /// Counters, and when they stood so: on a machine that is busy every question takes its time.
  struct Instant {
    std::uint64_t counted_ns = 0, used_ns = 0;
    std::vector<rtbus::TopicInfo> topics;
    double cpu_s = 0.0;
  };
  Instant now() {
    Instant out;
    out.topics = rtbus::list_topics(plan_.session.name);
    out.counted_ns = rtbus::monotonic_ns();
    for (const ChildView& child : supervisor_.running()) {
      if (const auto usage = ask_process(child.pid)) out.cpu_s += usage->cpu_s;
    }
    out.used_ns = rtbus::monotonic_ns();
    return out;
  }

  LiveFigures measure(const Instant& begin, const Instant& end) {
    LiveFigures out;
    std::set<std::string> libraries;
    for (const ChildView& child : supervisor_.running()) {
      for (std::string& library : mapped_libraries(child.pid)) libraries.insert(std::move(library));
      for (std::string& thread : thread_names(child.pid)) out.threads.push_back(std::move(thread));
      if (const auto usage = ask_process(child.pid)) {
        ++out.processes;
        out.rss_mib += static_cast<double>(usage->rss_bytes) / (1024.0 * 1024.0);
      }
    }
    out.libraries.assign(libraries.begin(), libraries.end());
    out.cpu_s_per_s = (end.cpu_s - begin.cpu_s) / rtbus::seconds_between(begin.used_ns, end.used_ns);
    std::map<std::string, std::uint64_t> before;
    for (const rtbus::TopicInfo& topic : begin.topics) before[topic.topic] = topic.published;
    for (const rtbus::TopicInfo& topic : end.topics) {
      out.shm_bytes += topic.segment_bytes;
      out.topics_hz[topic.topic] = static_cast<double>(topic.published - before[topic.topic]) /
                                   rtbus::seconds_between(begin.counted_ns, end.counted_ns);
    }
    auto loop = rtbus::Reader<rtbus::LoopStats>::open(plan_.session, plan_.haptic.front().name + ".loop_stats");
    rtbus::Stamped<rtbus::LoopStats> ticks;
    if (loop && loop->read_latest(ticks) == rtbus::ReadStatus::kFresh) out.tick_ns = 1e3 * ticks.value.compute_p50_us;
    if (!steps_us_.empty()) {
      const auto middle = steps_us_.begin() + static_cast<std::ptrdiff_t>(steps_us_.size() / 2);
      std::nth_element(steps_us_.begin(), middle, steps_us_.end());
      out.step_us = *middle;
      const auto slow = steps_us_.begin() + static_cast<std::ptrdiff_t>(0.99 * static_cast<double>(steps_us_.size()));
      std::nth_element(steps_us_.begin(), slow, steps_us_.end());
      out.step_p99_us = *slow;
    }
    return out;
  }

  const LiveVariant& variant_;
  RunPlan plan_;
  std::optional<rtbus::Reader<rtbus::ProxyState>> proxies_;
  rtbus::Stamped<rtbus::ProxyState> proxy_;
  std::vector<double> steps_us_;  ///< Engine time of each step in the window.
  std::optional<rtbus::Reader<rtbus::Telemetry>> telemetry_;
  std::optional<rtbus::Reader<rtbus::BodyPoses>> poses_;
  std::optional<rtbus::Reader<rtbus::SoftNodes>> nodes_;
  bool recording_ = false;
  Supervisor supervisor_{[](const std::string&, std::string_view) {}};
};

}  // namespace

std::size_t LiveFigures::libraries_named(const std::string& part) const {
  const auto lower = [](std::string text) {
    for (char& c : text) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
    return text;
  };
  return static_cast<std::size_t>(std::count_if(libraries.begin(), libraries.end(), [&](const std::string& library) {
    return lower(library.substr(library.rfind('/') + 1)).find(lower(part)) != std::string::npos;
  }));
}

std::size_t LiveFigures::threads_named(const std::string& name) const {
  return static_cast<std::size_t>(std::count(threads.begin(), threads.end(), name));
}

std::optional<LiveFigures> run_live(const LiveVariant& variant, double duration_s) {
  static int runs = 0;
  std::vector<std::string> assignments = variant.assignments;
  assignments.push_back("session=live-" + std::to_string(getpid()) + "-" + std::to_string(++runs));
  return LiveRun(variant, make_run_plan(variant.session_file, assignments))(duration_s);
}

}  // namespace tools
