#pragma once
/// @file link_json.hpp
/// The link to a USB device as `rtbus top --json` and reports print it.
#include <nlohmann/json.hpp>

#include "rtbus/link_messages.hpp"

namespace tools {

/// Counts since the device was opened, times in microseconds; null where there is no number.
[[nodiscard]] nlohmann::ordered_json link_json(const rtbus::LinkStats& link);

}  // namespace tools
