#pragma once
/// @file link_monitor.hpp
/// Whether physics lives. Two signs, because a process can be dead, stopped, or alive with a hung engine. Two more:
/// what it says can be believed, and is about the hand as it is now.
#include <algorithm>
#include <cstdint>

#include "rtbus/clock.hpp"
#include "rtbus/messages.hpp"
#include "rtbus/realtime.hpp"

namespace haptic {

struct LinkMonitorConfig {
  double loss_timeout_s = 0.055;  ///< A heartbeat (every 20 ms) older than this: the process is dead or stopped.
  /// A hung engine: older than max(this, step_periods × declared period + step time) … 100 ms are promised: what sees
  /// it is the next tick, and the force of the last one acts until the device's own next step.
  double min_step_age_s = 0.098;
  double step_periods = 2.5;     ///< Declared periods [1].
  double max_step_age_s = 10.0;  ///< … or than this, whatever physics declares.
  /// Answers to samples that are older than max(this, twice the age limit of a step) are none: slow physics, whose
  /// answers are two periods and a step old, stays far below it, and so does a link of 0.2 s each way.
  double min_answer_age_s = 0.5;
};

/// The same limits where physics is at the other end of a network, which loses some of what it carries. What arrives
/// is stamped on arrival, so a delay that stays the same makes nothing older; what a round trip adds is the age of the
/// hand that an answer belongs to, and at worst a gap as long as itself.
/// @param round_trip_s The longest of the network.
[[nodiscard]] inline LinkMonitorConfig across_network(LinkMonitorConfig config, double round_trip_s) noexcept {
  constexpr double kSureBeats_s = 0.2;   // ten heartbeats; where 30 % are lost, all ten about once an hour
  constexpr double kSurePeriods = 10.0;  // likewise of answers
  config.loss_timeout_s = kSureBeats_s + 0.5 * round_trip_s;
  config.min_step_age_s = std::max(config.min_step_age_s, kSureBeats_s + 0.5 * round_trip_s);
  config.min_answer_age_s += 2.0 * round_trip_s;
  config.step_periods = kSurePeriods;
  return config;
}

/// Judges the age of the heartbeat and of the last step. A slow engine with a live heartbeat is not lost.
/// @realtime Yes, all of it.
class LinkMonitor {
 public:
  explicit LinkMonitor(const LinkMonitorConfig& config) noexcept : config_(config) {}

  void heartbeat(const rtbus::Heartbeat& beat, std::uint64_t stamp_ns) noexcept RTBUS_NONBLOCKING {
    beat_ = beat;
    beat_ns_ = stamp_ns;
  }

  /// A proxy was published at `stamp_ns`.
  void proxy(std::uint64_t stamp_ns) noexcept RTBUS_NONBLOCKING { proxy_ns_ = stamp_ns; }

  /// A sample was refused (sane_sample.hpp): somebody writes into the topics of physics, or its numbers are none. What
  /// was accepted around it may be wrong too, so physics counts as lost until nothing was refused for a while.
  void refused(std::uint64_t now_ns) noexcept RTBUS_NONBLOCKING { refused_ns_ = now_ns; }

  /// How far the hand's sample that the newest answer belongs to lies behind the newest sample; 0: no answer counts
  /// yet. Measured by the hand, so that a device that repeats its last sample is not taken for a physics that lags.
  void behind(std::uint64_t behind_ns) noexcept RTBUS_NONBLOCKING { behind_ns_ = behind_ns; }

  /// The newest answer belongs to a hand of too long ago, however recently it was published.
  [[nodiscard]] bool lags() const noexcept RTBUS_NONBLOCKING { return too_far_behind(behind_ns_); }
  [[nodiscard]] bool too_far_behind(std::uint64_t behind_ns) const noexcept RTBUS_NONBLOCKING {
    return static_cast<double>(behind_ns) * 1e-9 > std::max(config_.min_answer_age_s, 2.0 * step_age_limit_s());
  }

  /// Looks at the clock; true while physics is alive. Counts each change from alive to lost.
  [[nodiscard]] bool update(std::uint64_t now_ns) noexcept RTBUS_NONBLOCKING {
    const bool alive =
        beat_ns_ != 0 && proxy_ns_ != 0 && beat_.state == static_cast<std::uint32_t>(rtbus::NodeState::kRunning) &&
        !(refused_ns_ != 0 && young(refused_ns_, now_ns, kTrust_s)) &&
        young(beat_ns_, now_ns, config_.loss_timeout_s) && young(proxy_ns_, now_ns, step_age_limit_s()) && !lags();
    if (alive_ && !alive) {
      ++losses_;
      last_loss_ns_ = now_ns;
    }
    alive_ = alive;
    return alive;
  }

  /// A step that takes longer than its period is late, however long it takes: it must not say itself how long it may.
  [[nodiscard]] double step_age_limit_s() const noexcept RTBUS_NONBLOCKING {
    const std::uint64_t step_ns = std::min(beat_.work_compute_ns, beat_.work_period_ns);
    return std::clamp(
        config_.step_periods * static_cast<double>(beat_.work_period_ns) * 1e-9 + static_cast<double>(step_ns) * 1e-9,
        config_.min_step_age_s, config_.max_step_age_s);
  }
  [[nodiscard]] std::uint64_t losses() const noexcept { return losses_; }
  [[nodiscard]] std::uint64_t last_loss_ns() const noexcept { return last_loss_ns_; }

 private:
  /// A stamp from the future by more than a scheduling delay comes from a broken writer: no sign of life.
  [[nodiscard]] static bool young(std::uint64_t stamp_ns, std::uint64_t now_ns,
                                  double limit_s) noexcept RTBUS_NONBLOCKING {
    const double age_s = rtbus::seconds_between(stamp_ns, now_ns);
    return age_s >= -kMaxFuture_s && age_s <= limit_s;
  }
  static constexpr double kTrust_s = 0.05;
  static constexpr double kMaxFuture_s = 0.02;  // a loop preempted between the clock and the topic

  LinkMonitorConfig config_;
  rtbus::Heartbeat beat_{};
  std::uint64_t beat_ns_ = 0;
  std::uint64_t proxy_ns_ = 0;
  std::uint64_t refused_ns_ = 0;  ///< 0: never.
  std::uint64_t behind_ns_ = 0;
  bool alive_ = false;
  std::uint64_t losses_ = 0;
  std::uint64_t last_loss_ns_ = 0;
};

}  // namespace haptic
