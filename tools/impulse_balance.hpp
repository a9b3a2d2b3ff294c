#pragma once
/// @file impulse_balance.hpp
/// Newton's third law in a running session: what the hand felt in a second against what the world received in it.
#include <algorithm>
#include <cstdint>
#include <map>

#include <Eigen/Core>

#include "rtbus/clock.hpp"

namespace tools {

/// Sums impulses in windows of one second, both in the device's frame D. The two ends of a coupling that is at work differ
/// by what their springs hold and by the age of the proxy; over a second of a push these vanish beside the push. One thread.
class ImpulseBalance {
 public:
  /// Windows in which the world received less than this say nothing about a ratio [N·s].
  static constexpr double kWorthComparing_n_s = 0.1;

  /// The hand felt `force_n` from `time_ns` on for `dt_s`.
  void add_felt(std::uint64_t time_ns, const Eigen::Vector3d& force_n, double dt_s) {
    if (start_ns_ == 0) start_ns_ = time_ns;
    window_of(time_ns).felt_n_s += force_n * dt_s;
  }

  /// The world received −`contact_force_n` (the proxy's contact force, mapped to D) during `step_s`. Before the first
  /// add_felt() it is ignored.
  void add_given(std::uint64_t time_ns, const Eigen::Vector3d& contact_force_n, double step_s) {
    if (start_ns_ != 0 && time_ns >= start_ns_) window_of(time_ns).given_n_s += contact_force_n * step_s;
  }

  struct Figures {
    double felt_n_s = 0.0, given_n_s = 0.0;  ///< Norms of the sums over the windows compared.
    double worst = 0.0;                      ///< Largest |felt − given| / |given| of a window.
    std::size_t windows = 0;                 ///< Compared: whole seconds with a push worth the name.
  };

  /// Without the last window, which may not be whole.
  [[nodiscard]] Figures figures() const {
    Figures out;
    Window sum;
    for (auto it = windows_.begin(); it != windows_.end() && std::next(it) != windows_.end(); ++it) {
      const Window& window = it->second;
      const double given = window.given_n_s.norm();
      if (given < kWorthComparing_n_s) continue;
      ++out.windows;
      out.worst = std::max(out.worst, (window.felt_n_s - window.given_n_s).norm() / given);
      sum.felt_n_s += window.felt_n_s;
      sum.given_n_s += window.given_n_s;
    }
    out.felt_n_s = sum.felt_n_s.norm();
    out.given_n_s = sum.given_n_s.norm();
    return out;
  }

 private:
  struct Window {
    Eigen::Vector3d felt_n_s = Eigen::Vector3d::Zero();
    Eigen::Vector3d given_n_s = Eigen::Vector3d::Zero();
  };
  Window& window_of(std::uint64_t time_ns) { return windows_[(time_ns - start_ns_) / rtbus::kNsPerS]; }

  std::uint64_t start_ns_ = 0;
  std::map<std::uint64_t, Window> windows_;  // by the second; an hour is 3600
};

}  // namespace tools
