#pragma once
/// @file run_observer.hpp
/// Follows the topics of a running session and keeps, in bounded memory, what its report and figures need.
#include <cstdint>
#include <memory>
#include <optional>
#include <string>

#include "haptic_node/node_config.hpp"
#include "haptic_node/rendering/mapping.hpp"
#include "rtbus/histogram.hpp"
#include "rtbus/link_messages.hpp"
#include "rtbus/messages.hpp"
#include "rtbus/subscription.hpp"
#include "tools/cli/run/live_error.hpp"
#include "tools/cli/run/report.hpp"
#include "tools/cli/run/trace.hpp"

namespace tools {

/// One tick for the figures; lengths and forces at the device.
struct MotionRow {
  double time_s = 0.0;  ///< Since the first row.
  rtbus::Vec3 position_m{}, proxy_m{}, force_n{}, rendered_n{};
  double proxy_age_ms = 0.0;
  void absorb(const MotionRow& later) noexcept {
    if (later.proxy_age_ms > proxy_age_ms) proxy_age_ms = later.proxy_age_ms;
  }
};

/// One physics step for the figures.
struct StepRow {
  double time_s = 0.0;
  double step_ms = 0.0;
  void absorb(const StepRow& later) noexcept {
    if (later.step_ms > step_ms) step_ms = later.step_ms;
  }
};

/// One haptic node and the proxy that physics makes for it. One thread.
class HapticObserver {
 public:
  /// @param config Outlives the observer.
  /// @param figures Keeps what figures are drawn from: up to 8 MiB in the first minutes.
  HapticObserver(const rtbus::Session& session, const haptic::HapticConfig& config, bool figures);

  /// Opens the node's topics, and holds its telemetry on; opens anew what a restarted node or somebody's `rm` has
  /// replaced. @returns false when some are not there.
  [[nodiscard]] bool attach();

  /// Takes in everything that is new, then attaches again: call it every 20 ms, and once more after the nodes have
  /// ended (their last statistics stay mapped here).
  void drain();

  /// Fills in what was seen. The cost of the process is the caller's to add.
  [[nodiscard]] HapticFigures figures() const;
  [[nodiscard]] ProxyFigures proxy_figures() const;

  [[nodiscard]] const haptic::HapticConfig& config() const noexcept { return config_; }
  [[nodiscard]] bool needs_physics() const noexcept { return needs_physics_; }
  [[nodiscard]] const rtbus::NodeInfo& info() const noexcept { return info_.value; }
  [[nodiscard]] const rtbus::Telemetry& last_tick() const noexcept { return tick_.value; }
  [[nodiscard]] double achieved_hz() const noexcept { return stats_.value.achieved_hz; }
  /// When the tick was published in which the device's E-stop button was last down; 0: none.
  [[nodiscard]] std::uint64_t estop_pressed_ns() const noexcept { return estop_pressed_ns_; }
  /// Likewise, in which an E-stop last acted on the force.
  [[nodiscard]] std::uint64_t estop_acted_ns() const noexcept { return estop_acted_ns_; }
  [[nodiscard]] std::uint64_t observed_ticks() const noexcept { return observed_ticks_; }

  /// Both empty without figures.
  [[nodiscard]] const Trace<MotionRow>& motion() const noexcept { return motion_; }
  [[nodiscard]] const Trace<StepRow>& steps() const noexcept { return steps_; }
  [[nodiscard]] const rtbus::Histogram& wakeup_ns() const noexcept { return *wakeup_ns_; }

 private:
  void take(const rtbus::Telemetry& tick);
  void watch_estop(const rtbus::Telemetry& tick, std::uint64_t stamp_ns);
  void take(const rtbus::ProxyState& proxy);

  const haptic::HapticConfig& config_;
  rtbus::Subscription<rtbus::Telemetry> ticks_;
  rtbus::Subscription<rtbus::LoopStats> stats_reader_;
  rtbus::Subscription<rtbus::NodeInfo> info_reader_;
  rtbus::Subscription<rtbus::ProxyState> proxies_;
  std::optional<rtbus::Subscription<rtbus::LinkStats>> link_reader_;  ///< Of a device over USB.
  bool needs_physics_ = false;
  std::optional<LiveError> error_;  ///< None for a method that finds the proxy in the loop.

  rtbus::Stamped<rtbus::Telemetry> tick_;
  rtbus::Stamped<rtbus::ProxyState> proxy_;
  rtbus::Stamped<rtbus::LoopStats> stats_;
  rtbus::Stamped<rtbus::NodeInfo> info_;
  rtbus::Stamped<rtbus::LinkStats> link_;
  std::uint64_t first_due_ns_ = 0;
  /// A press lasts for tens of ticks, an E-stop until it is re-armed; a damaged tick is one.
  static constexpr int kSureTicks = 5;
  int pressed_ticks_ = 0, acted_ticks_ = 0;
  std::uint64_t estop_pressed_ns_ = 0, estop_acted_ns_ = 0;
  std::uint64_t observed_ticks_ = 0;
  double generated_peak_j_ = 0.0;
  double observed_min_j_ = 0.0;
  std::uint64_t contact_steps_ = 0;
  RmsPeak coupling_n_, contact_n_;
  haptic::Mapping mapping_;  ///< Of forces: rotation and scale, which nothing shifts.
  ImpulseBalance impulse_;
  std::uint64_t answered_ns_ = 0;  ///< The device sample of the last step.
  const bool keeps_figures_;
  Trace<MotionRow> motion_;
  Trace<StepRow> steps_;
  std::unique_ptr<rtbus::Histogram> wakeup_ns_ = std::make_unique<rtbus::Histogram>();
};

/// The physics node's own topics. One thread.
class PhysicsObserver {
 public:
  explicit PhysicsObserver(const rtbus::Session& session)
      : stats_reader_(session, "physics.step_stats"), info_reader_(session, "physics.node_info") {}
  [[nodiscard]] bool attach();
  void drain();
  /// Without the proxies and the cost of the process.
  [[nodiscard]] PhysicsFigures figures() const;
  [[nodiscard]] const rtbus::StepStats& stats() const noexcept { return stats_.value; }

 private:
  rtbus::Subscription<rtbus::StepStats> stats_reader_;
  rtbus::Subscription<rtbus::NodeInfo> info_reader_;
  rtbus::Stamped<rtbus::StepStats> stats_;
  rtbus::Stamped<rtbus::NodeInfo> info_;
};

}  // namespace tools
