#pragma once
/// @file top_signal.hpp
/// What the last seconds of a haptic node looked like, from its full-rate telemetry, in bounded memory. Pure: no clock,
/// no shared memory.
#include <array>
#include <cstdint>
#include <deque>
#include <optional>
#include <vector>

#include "rtbus/messages.hpp"

namespace tools {

/// Upper edges of the bins of the wake-up histogram [us]; one more bin takes what is later.
inline constexpr std::array<double, 9> kJitterEdges_us = {5, 10, 20, 50, 100, 200, 500, 1000, 2000};
using JitterBins = std::array<std::uint64_t, kJitterEdges_us.size() + 1>;

/// Length of a vector; NaN when a part of it is. (libstdc++'s hypot of three may make a zero of that.)
[[nodiscard]] double norm_of(const rtbus::Vec3& v) noexcept;

/// Bits of Telemetry::safety that take the force away altogether, or fade it out.
[[nodiscard]] std::uint32_t cut_bits(std::uint32_t safety) noexcept;

/// A time in which the force was cut.
struct CutView {
  std::uint32_t bits = 0;    ///< haptic::SafetyBit, all that acted in it.
  double began_ago_s = 0.0;  ///< Since its first tick that was seen.
  double lasted_s = 0.0;
  bool ongoing = false;
};

/// The last seconds.
struct RecentView {
  JitterBins jitter{};                  ///< Wake-ups of the histogram's window.
  std::uint64_t ticks = 0;              ///< In that window.
  std::uint64_t missed = 0;             ///< Ticks that this monitor did not see, since it follows.
  double wakeup_max_us = 0.0;           ///< In that window.
  double compute_max_us = 0.0;          ///< Likewise.
  std::vector<double> force_n;          ///< Largest norm of each slot, oldest first; NaN: no tick fell into it.
  std::vector<rtbus::Vec3> position_m;  ///< p_DT at the end of each slot; NaN likewise.
  std::optional<CutView> cut;           ///< The last one seen.
};

/// One per haptic node. One thread.
class RecentSignals {
 public:
  static constexpr double kSlot_s = 0.1;      ///< Of the sparklines.
  static constexpr std::size_t kSlots = 300;  ///< That many are kept.
  static constexpr double kWindow_s = 10.0;   ///< Of the histogram.

  /// Takes in one tick; ticks come in the order of their stamps.
  void take(const rtbus::Telemetry& tick, std::uint64_t stamp_ns);

  /// The state at `now_ns`; none before the first tick.
  [[nodiscard]] std::optional<RecentView> view(std::uint64_t now_ns, std::uint64_t missed) const;

 private:
  struct Slot {
    std::uint64_t index = 0;
    double force_n = 0.0;
    rtbus::Vec3 position_m{};
  };
  struct Second {
    std::uint64_t index = 0;
    JitterBins jitter{};
    std::uint64_t ticks = 0;
    double wakeup_max_us = 0.0, compute_max_us = 0.0;
  };
  void watch_cuts(const rtbus::Telemetry& tick, std::uint64_t stamp_ns);

  std::deque<Slot> slots_;
  std::deque<Second> seconds_;
  std::uint64_t last_tick_ = 0;
  std::uint64_t cut_began_ns_ = 0, cut_ended_ns_ = 0;
  std::uint32_t cut_bits_ = 0;  ///< Of the last cut; 0: none seen.
  bool cutting_ = false;
};

}  // namespace tools
