#pragma once
/// @file three_digits.hpp
/// Numbers in sentences for people.
#include <cstdio>
#include <string>

namespace rtbus {

/// Three significant digits: "0.0123", "1.23", "123", "1.23e+04". @realtime No: it allocates.
[[nodiscard]] inline std::string three_digits(double value) {
  char text[32];
  std::snprintf(text, sizeof text, "%.3g", value);
  return text;
}

}  // namespace rtbus
