#pragma once
/// @file stability_watch.hpp
/// What is said of a run tick by tick, under the simulated clock and in real processes alike.
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <vector>

#include <Eigen/Core>

#include "haptic_node/safety.hpp"
#include "rtbus/eigen.hpp"
#include "rtbus/histogram.hpp"
#include "rtbus/messages.hpp"
#include "tools/evaluation/stability/stability_run.hpp"

namespace tools {

/// Peak to peak of each axis over a window, and how far it has drifted meanwhile.
class Swing {
 public:
  void add(const Eigen::Vector3d& value) {
    if (count_++ == 0) first_ = low_ = high_ = value;
    low_ = low_.cwiseMin(value);
    high_ = high_.cwiseMax(value);
    last_ = value;
  }
  /// Largest of the axes; what only creeps one way does not swing.
  [[nodiscard]] double size() const {
    return count_ == 0 ? 0.0 : ((high_ - low_) - (last_ - first_).cwiseAbs()).maxCoeff();
  }
  [[nodiscard]] double drift() const { return (last_ - first_).cwiseAbs().maxCoeff(); }

 private:
  int count_ = 0;
  Eigen::Vector3d first_ = Eigen::Vector3d::Zero(), last_ = Eigen::Vector3d::Zero(), low_ = Eigen::Vector3d::Zero(),
                  high_ = Eigen::Vector3d::Zero();
};

struct Window {
  Swing force_n, tip_m;
};

/// How a run is watched after its script has ended: in windows, each of which holds some periods of physics and of
/// whatever may swing slower.
struct WatchTimes {
  explicit WatchTimes(const StabilityCase& each)
      : window_s(std::max({0.3, 4.0 / each.physics_hz, 2.0 * each.longest_round_trip_s()})),
        watched_s(std::max({6.0, 60.0 / each.physics_hz, 20.0 * each.longest_round_trip_s()})) {}
  double window_s, watched_s;
  /// An oscillation that seems to grow, or not to end, is watched so many times as long; one that still grows once
  /// more.
  static constexpr double kLongerLook = 2.0;
};

/// Watches one run tick by tick.
class Watch {
 public:
  /// @param limit_n Largest force of the device. @param dt_s Between two ticks.
  Watch(const StabilityCase& each, double limit_n, double dt_s, StabilityResult& out)
      : each_(each),
        out_(out),
        limit_n_(limit_n),
        dt_s_(dt_s),
        quantum_m_(each.quantum_m > 0.0 ? each.quantum_m : kNominalQuantumM) {}

  /// @param tip Where it is, as exactly as that is known. @param absorbed_j Likewise, what the hand has put in.
  void tick(const rtbus::Telemetry& telemetry, const Eigen::Vector3d& tip, double absorbed_j, double now_s) {
    const Eigen::Vector3d force = rtbus::vector_of(telemetry.force_n);
    const double norm = force.norm();
    if (!force.allFinite()) ++out_.nonfinite;
    if (norm > limit_n_ * (1.0 + 1e-9)) ++out_.above_limit;
    if ((telemetry.safety & haptic::kNonfinite) != 0) ++out_.law_nonfinite;
    if ((telemetry.safety & haptic::kOverspeed) != 0) ++out_.overspeed;
    if ((telemetry.safety & haptic::kPassivity) != 0) ++out_.passivity;
    out_.peak_n = std::max(out_.peak_n, norm);
    if (ticks_ > 0) out_.worst_tick_j = std::max(out_.worst_tick_j, last_n_ * (tip - last_tip_).norm());

    const bool nobody_pushes = each_.hand == StabilityHand::kNone ? now_s > each_.start_s() : now_s > rest_from_s();
    clamp_run_s_ = nobody_pushes && norm >= 0.995 * limit_n_ ? clamp_run_s_ + dt_s_ : 0.0;
    out_.clamped_s = std::max(out_.clamped_s, clamp_run_s_);

    const double observed_j = telemetry.energy_observed_j;
    out_.lowest_observed_j = std::min(out_.lowest_observed_j, observed_j);
    deficit_run_s_ = observed_j < -kDeficitBarJ ? deficit_run_s_ + dt_s_ : 0.0;
    out_.deficit_s = std::max(out_.deficit_s, deficit_run_s_);
    window_observed_j_ = std::min(window_observed_j_, observed_j);
    out_.observed_error_j = std::max(out_.observed_error_j, std::abs(telemetry.energy_absorbed_j - absorbed_j));
    out_.plant_work_j = -absorbed_j;

    if (now_s > each_.start_s()) {
      if (telemetry.proxy_sequence != 0) ages_ns_.record(telemetry.proxy_age_ns);
      if ((telemetry.safety & haptic::kStale) != 0) out_.stale_s += dt_s_;
    }

    window_.force_n.add(force);
    window_.tip_m.add(tip);
    last_n_ = norm;
    last_tip_ = tip;
    ++ticks_;
  }

  /// What came before is motion, and does not count as swing.
  void begin_windows() {
    motion_observed_j_ = window_observed_j_;
    window_ = {};
    window_observed_j_ = 0.0;
  }

  /// Ends a window; true when there is nothing more to see.
  bool end_window() {
    windows_.push_back(window_);
    windows_observed_j_.push_back(window_observed_j_);
    window_ = {};
    window_observed_j_ = 0.0;
    const auto quiet = [this](const Window& w) {
      return w.force_n.size() <= 0.2 * kSwingBarN && w.tip_m.size() <= 0.2 * bar_m() &&
             w.force_n.drift() <= 0.2 * kSwingBarN && w.tip_m.drift() <= bar_m();
    };
    return windows_.size() >= 2 && quiet(windows_.back()) && quiet(windows_[windows_.size() - 2]);
  }

  /// What the windows say, without the reference.
  void judge(bool rested) {
    out_.age_p50_s = 1e-9 * static_cast<double>(ages_ns_.percentile(0.5));
    out_.age_max_s = 1e-9 * static_cast<double>(ages_ns_.max());
    if (windows_.empty()) return;
    const std::size_t n = windows_.size();
    // The median window of the last quarter: what happens once (a stack falls, physics was lost for a moment) is no
    // oscillation.
    const std::size_t late = n - std::max<std::size_t>(1, n / 4);
    out_.swing_n = median(late, n, [](const Window& w) { return w.force_n.size(); });
    out_.swing_m = median(late, n, [](const Window& w) { return w.tip_m.size(); });
    const double before_j = std::min(
        motion_observed_j_,
        late > 0 ? *std::min_element(windows_observed_j_.begin(), windows_observed_j_.begin() + static_cast<long>(late))
                 : 0.0);
    // The second lowest: what happens once in the last quarter (the first touch after a long way) is no growth.
    std::vector<double> last_j(windows_observed_j_.begin() + static_cast<long>(late), windows_observed_j_.end());
    std::sort(last_j.begin(), last_j.end());
    out_.deficit_growth_j = before_j - last_j[std::min<std::size_t>(1, last_j.size() - 1)];
    if (out_.nonfinite + out_.above_limit > 0) {
      out_.outcome = StabilityOutcome::kFailed;
      return;
    }
    // A tip that creeps one way is not at rest, and the ripple of the force on its way no oscillation.
    const bool creeps = median(late, n, [](const Window& w) { return w.tip_m.drift(); }) > bar_m();
    const bool large = out_.swing_m > bar_m() || (out_.swing_n > kSwingBarN && !creeps);
    const double before_n = median(n / 4, n / 2, [](const Window& w) { return w.force_n.size(); });
    const double before_m = median(n / 4, n / 2, [](const Window& w) { return w.tip_m.size(); });
    const double faded = std::max(ratio(out_.swing_n, before_n, kSwingBarN), ratio(out_.swing_m, before_m, bar_m()));
    // What has grown to the limit cannot grow on.
    const bool saturated = out_.growing && out_.swing_n > 0.5 * limit_n_;
    out_.growing = !rested && large &&
                   (saturated || grows([](const Window& w) { return w.force_n.size(); }, kSwingBarN) ||
                    grows([](const Window& w) { return w.tip_m.size(); }, bar_m()));
    if (out_.clamped_s > kClampBarS || out_.law_nonfinite > 0) {
      out_.outcome = StabilityOutcome::kDiverged;
    } else if (rested) {
      out_.outcome = StabilityOutcome::kSettled;
    } else if (large) {
      out_.outcome = faded < kFading ? StabilityOutcome::kMoving : StabilityOutcome::kDiverged;
    } else if (!creeps && (out_.swing_n > 0.2 * kSwingBarN || out_.swing_m > 0.2 * bar_m())) {
      out_.outcome = faded < kFading ? StabilityOutcome::kMoving : StabilityOutcome::kLimitCycle;
    } else {
      out_.outcome = StabilityOutcome::kMoving;
    }
  }

  [[nodiscard]] double bar_m() const { return kSwingBarQuanta * quantum_m_; }
  [[nodiscard]] double rest_from_s() const { return each_.end_s() + 0.1; }

 private:
  /// An oscillation that has lost a quarter in half of the time dies out.
  static constexpr double kFading = 0.75;
  static constexpr double kGrowing = 1.1;
  template <class Value>
  [[nodiscard]] double median(std::size_t from, std::size_t to, Value value) const {
    std::vector<double> values;
    for (std::size_t i = from; i < std::max(to, from + 1) && i < windows_.size(); ++i)
      values.push_back(value(windows_[i]));
    if (values.empty()) return 0.0;
    const auto middle = values.begin() + static_cast<long>(values.size() / 2);
    std::nth_element(values.begin(), middle, values.end());
    return *middle;
  }
  /// Larger in the last quarter than in the second: in the median, and window by window more often than chance makes an
  /// oscillation that only wavers (nine pairs of ten).
  template <class Value>
  [[nodiscard]] bool grows(Value value, double bar) const {
    const std::size_t n = windows_.size(), late = n - std::max<std::size_t>(1, n / 4);
    if (ratio(median(late, n, value), median(n / 4, n / 2, value), bar) <= kGrowing) return false;
    std::size_t pairs = 0, above = 0;
    for (std::size_t i = n / 4; i < n / 2; ++i) {
      for (std::size_t j = late; j < n; ++j, ++pairs) above += value(windows_[j]) > value(windows_[i]) ? 1U : 0U;
    }
    return 10 * above >= 9 * pairs;
  }
  static double ratio(double now, double before, double bar) {
    return now <= 0.2 * bar ? 0.0 : now / std::max(before, 0.2 * bar);
  }

  const StabilityCase& each_;
  StabilityResult& out_;
  double limit_n_, dt_s_, quantum_m_;
  std::uint64_t ticks_ = 0;
  double last_n_ = 0.0;
  Eigen::Vector3d last_tip_ = Eigen::Vector3d::Zero();
  double clamp_run_s_ = 0.0, deficit_run_s_ = 0.0, window_observed_j_ = 0.0, motion_observed_j_ = 0.0;
  rtbus::Histogram ages_ns_;
  Window window_;
  std::vector<Window> windows_;
  std::vector<double> windows_observed_j_;
};

}  // namespace tools
