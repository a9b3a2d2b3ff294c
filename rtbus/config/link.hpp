#pragma once
/// @file link.hpp
/// How a haptic node and physics talk: keys of a haptic entry that both of them have to know.
#include <optional>

#include "rtbus/config/document.hpp"

namespace rtbus::config {

/// The paper's client sends so many packets per second (He & Choi 2013, section III.A).
inline constexpr double kPaperLinkRate_hz = 50.0;

/// `form`, `link_rate_hz` and `link` of a haptic entry.
struct LinkConfig {
  /// `form: paper`: each method as published. Explicit server spring, computed once per step and held; dampers on
  /// absolute velocities. Else the improved form.
  bool paper = false;
  std::optional<double> rate_hz;  ///< Packets per second to physics; none: every tick. Paper's form: 50 unless given.
  bool pipe = false;              ///< `link: pipe`: a duplex named pipe carries both directions, for comparison.
};

/// Reads the three keys; leaves the rest of the entry alone. Throws Error.
[[nodiscard]] LinkConfig read_link_config(Map& entry);

}  // namespace rtbus::config
