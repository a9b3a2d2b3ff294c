/// The beat thread of the physics node: heartbeat, statistics, what the node says of itself, and warnings.
#include <spdlog/spdlog.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <string>
#include <utility>

#include "physics_node/node.hpp"
#include "physics_node/node_topics.hpp"
#include "rtbus/clock.hpp"
#include "rtbus/realtime.hpp"
#include "rtbus/why_behind.hpp"

namespace physics {
namespace {

constexpr int kStatsEvery = 10;      // beats: 5 Hz
constexpr int kInfoEvery = 50;       // 1 Hz
constexpr double kKeepsUp = 0.97;    // of real time; less is worth a warning
constexpr int kWarnAgainAfter = 50;  // statistics: 10 s

}  // namespace

/// What the beat thread says, and remembers from one beat to the next.
class Node::Beats {
 public:
  explicit Beats(Node& node);

  void publish_beat(rtbus::NodeState state);
  /// @param ending The rate of a second in which steps ended says nothing: the last one is kept.
  void publish_stats(bool ending);
  void publish_info();
  /// An engine that cannot keep up is told to the user at once, and again while it lasts, but not every second.
  void warn_when_slow();
  /// Ignored device states, bodies put back, topics made anew: when there are more than at the last call.
  void warn_of_troubles();

 private:
  Node& node_;
  rtbus::NodeInfo info_;
  rtbus::Heartbeat beat_;
  rtbus::StepStats stats_;
  std::array<std::pair<std::uint64_t, std::uint64_t>, 6> history_{};  // (time, steps); six statistics span one second
  double checked_wall_s_ = 0.0, checked_simulated_s_ = 0.0;
  int quiet_rounds_ = 0;
  std::uint64_t warned_ignored_ = 0, warned_recoveries_ = 0;
  rtbus::RenewalCount told_;
};

Node::Beats::Beats(Node& node) : node_(node) {
  const PhysicsConfig& physics = node.config_.physics;
  rtbus::set_text(info_.role, "physics");
  rtbus::set_text(info_.kind, physics.engine);
  rtbus::set_text(info_.clock, physics.clock());
  info_.rate_hz = 1.0 / physics.step_s();
  info_.core = 0xffffffff;
  info_.bodies = static_cast<std::uint32_t>(node.stepper_->world().bodies());
  beat_.pid = static_cast<std::uint32_t>(getpid());
  beat_.work_period_ns = node.period_ns();
  stats_.rate_hz = info_.rate_hz;
  stats_.bodies = node.stepper_->world().bodies();
  history_.fill({rtbus::monotonic_ns(), 0});
}

void Node::Beats::publish_beat(rtbus::NodeState state) {
  ++beat_.beats;
  beat_.last_work_ns = node_.last_work_ns_.load(std::memory_order_relaxed);
  beat_.work_compute_ns = node_.last_compute_ns_.load(std::memory_order_relaxed);
  beat_.state = static_cast<std::uint32_t>(state);
  node_.topics_->heartbeat.publish(beat_, rtbus::monotonic_ns());
}

void Node::Beats::publish_stats(bool ending) {
  const std::uint64_t now_ns = rtbus::monotonic_ns();
  stats_.steps = node_.steps_.load(std::memory_order_relaxed);
  stats_.late = node_.late_.load(std::memory_order_relaxed);
  stats_.due = node_.due_.load(std::memory_order_relaxed);
  stats_.simulated_s = node_.simulated_s_.load(std::memory_order_relaxed);
  stats_.wall_s = node_.wall_s_.load(std::memory_order_relaxed);
  stats_.step_p50_ms = static_cast<double>(node_.step_time_ns_.percentile(0.50)) * 1e-6;
  stats_.step_p99_ms = static_cast<double>(node_.step_time_ns_.percentile(0.99)) * 1e-6;
  stats_.step_max_ms = static_cast<double>(node_.step_time_ns_.max()) * 1e-6;
  std::rotate(history_.begin(), history_.begin() + 1, history_.end());
  history_.back() = {now_ns, stats_.steps};
  const double span_s = rtbus::seconds_between(history_.front().first, now_ns);
  if (!ending) {
    stats_.achieved_hz = span_s > 0.1 ? static_cast<double>(stats_.steps - history_.front().second) / span_s : 0.0;
  }
  node_.topics_->step_stats.publish(stats_, now_ns);
}

void Node::Beats::publish_info() {
  rtbus::set_text(info_.left_out, node_.left_out());
  rtbus::set_text(info_.scheduling, node_.scheduling_.policy());
  rtbus::set_text(info_.realtime, node_.scheduling_.summary());
  node_.topics_->node_info.publish(info_, rtbus::monotonic_ns());
}

void Node::Beats::warn_when_slow() {
  if (--quiet_rounds_ > 0 || stats_.wall_s - checked_wall_s_ < 0.9) return;
  const double share = (stats_.simulated_s - checked_simulated_s_) / (stats_.wall_s - checked_wall_s_);
  checked_wall_s_ = stats_.wall_s;
  checked_simulated_s_ = stats_.simulated_s;
  if (share > kKeepsUp) return;
  spdlog::warn("physics: {} {:g} Hz: simulated time runs at {:.0f} % of real time; {}",
               rtbus::steps_fit(stats_) ? "behind its" : "too slow for", stats_.rate_hz, 100.0 * share,
               rtbus::why_behind(stats_, node_.config_.physics.engine));
  quiet_rounds_ = kWarnAgainAfter;
}

void Node::Beats::warn_of_troubles() {
  const std::uint64_t ignored = node_.ignored_.load(std::memory_order_relaxed);
  if (ignored > warned_ignored_) {
    spdlog::warn("physics: {} device states refused so far: a value was not finite or implausible", ignored);
    warned_ignored_ = ignored;
  }
  const std::uint64_t recoveries = node_.recoveries_.load(std::memory_order_relaxed);
  if (recoveries > warned_recoveries_) {
    spdlog::warn(
        "physics: {} times so far a soft body turned inside out or became non-finite, and was put back to "
        "where the scene places it; lower its bulk_modulus_pa or linear_stiffness, or raise physics.rate_hz",
        recoveries);
    warned_recoveries_ = recoveries;
  }
  if (const rtbus::RenewalCount renewals = node_.topics_->renewals(); renewals != told_) {
    spdlog::warn("physics: {}", renewals.text());
    told_ = renewals;
  }
}

void Node::beat_thread() noexcept {
  rtbus::name_this_thread("physics_beat");
  // A machine that is busy is not a dead physics process: the beat must not wait behind other work.
  (void)rtbus::prefer_on_time();
  Beats beats(*this);
  std::uint64_t due_ns = rtbus::monotonic_ns();
  for (int round = 0; !stop_beats_.load(std::memory_order_acquire); ++round) {
    const bool stepped = steps_.load(std::memory_order_relaxed) > 0;
    beats.publish_beat(stop_steps_.load(std::memory_order_relaxed) ? rtbus::NodeState::kStopping
                       : stepped                                   ? rtbus::NodeState::kRunning
                                                                   : rtbus::NodeState::kStarting);
    scheduling_.watch();
    topics_->maintain();
    if (poses_) poses_->maintain();
    if (soft_nodes_) soft_nodes_->maintain();
    contact_points_.maintain();
    if (const std::string failed = contact_topics_.maintain(); !failed.empty()) spdlog::warn("physics: {}", failed);
    if (round % kStatsEvery == 0) {
      beats.publish_stats(false);
      beats.warn_when_slow();
    }
    if (round % kInfoEvery == 0) {
      beats.publish_info();
      beats.warn_of_troubles();
    }
    due_ns = std::max(due_ns + kBeatPeriodNs, rtbus::monotonic_ns());
    rtbus::sleep_until(due_ns);
  }
  beats.publish_stats(true);
  beats.publish_beat(rtbus::NodeState::kStopping);
}

}  // namespace physics
