#pragma once
/// @file set_hand.hpp
/// Assignments as for --set.
#include <cstdio>
#include <string>

namespace tools {

/// A key of the first hand: set_hand("link_rate_hz", 50) is "haptic.0.link_rate_hz=50".
[[nodiscard]] inline std::string set_hand(const char* key, double value) {
  char text[120];
  std::snprintf(text, sizeof text, "haptic.0.%s=%.9g", key, value);
  return text;
}

}  // namespace tools
