#pragma once
/// @file shared_keys.hpp
/// Keys of a session file that both nodes have to know: each is read here and nowhere else. The functions take what
/// they name and leave the rest of the map, and its finish(), to the node that owns it. All throw Error.
#include <algorithm>
#include <optional>

#include "rtbus/config/document.hpp"

namespace rtbus::config {

/// The paper's client sends so many packets per second (He & Choi 2013, section III.A).
inline constexpr double kPaperLinkRate_hz = 50.0;

/// `form`, `link_rate_hz`, `link` and `link_round_trip_ms` of a haptic entry: how a haptic node and physics talk.
struct LinkConfig {
  /// `form: paper`: each method as published. Explicit server spring, computed once per step and held; dampers on
  /// absolute velocities. Else the improved form.
  bool paper = false;
  std::optional<double> rate_hz;  ///< Packets per second to physics; none: every tick. Paper's form: 50 unless given.
  bool pipe = false;              ///< `link: pipe`: a duplex named pipe carries both directions, for comparison.
  bool dds = false;               ///< `link: dds`: physics may be on another machine; `rtbus link` carries both ways.
  /// `link_round_trip_ms` with `link: dds`: the largest round trip that the link is meant for [s]; else 0. All limits
  /// of age grow with it.
  double round_trip_s = 0.0;

  static constexpr double kLeastRoundTrip_s = 1e-3;  ///< That `link_round_trip_ms` takes.
  /// The two ends hear each other late, unevenly, and not of everything.
  [[nodiscard]] bool over_network() const noexcept { return round_trip_s >= kLeastRoundTrip_s; }
};
[[nodiscard]] LinkConfig read_link_config(Map& entry);

/// `rate_hz` and `throttle_hz` of the `physics` map.
struct StepRateConfig {
  double rate_hz = 1000.0;
  std::optional<double> throttle_hz;  ///< Imitates a machine that manages only so many steps per second.

  /// Rate of the steps [Hz].
  [[nodiscard]] double steps_per_s() const noexcept { return throttle_hz ? std::min(*throttle_hz, rate_hz) : rate_hz; }
};
[[nodiscard]] StepRateConfig read_step_rate(Map& physics);

/// `engine` of the `physics` map. @returns whether physics simulates the bodies of the scene file: false for a program
/// of the user's, which has bodies of its own.
[[nodiscard]] bool simulates_the_scene(Map& physics);

/// `coupling.stiffness_n_per_m` of a haptic entry [N/m at the device]. @param coupling The map `coupling`.
[[nodiscard]] double read_coupling_stiffness(Map& coupling);

/// `mass_kg` and `radius_m` of the map `proxy` of a haptic entry.
struct ProxyBodyConfig {
  double mass_kg = 0.1;   ///< In the world.
  double radius_m = 0.0;  ///< In the world; 0: a point.
};
[[nodiscard]] ProxyBodyConfig read_proxy_body(Map& proxy);

/// `core` of the map `realtime` of a haptic entry: number of a CPU, −1 for `auto`; none: neither of them.
[[nodiscard]] std::optional<int> read_core(Map& realtime);

}  // namespace rtbus::config
