#pragma once
/// @file utc_now.hpp
/// The time of day for reports.
#include <ctime>
#include <string>

namespace tools {

/// "2024-05-17T09:30:00Z".
[[nodiscard]] inline std::string utc_now() {
  const std::time_t now = std::time(nullptr);
  std::tm utc{};
  ::gmtime_r(&now, &utc);
  char text[32];
  std::strftime(text, sizeof text, "%Y-%m-%dT%H:%M:%SZ", &utc);
  return text;
}

}  // namespace tools
