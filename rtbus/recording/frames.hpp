#pragma once
/// @file frames.hpp
/// In which frame the fields of the project's messages are given (rtbus/messages.hpp), for the attributes of a
/// recording.
#include <string_view>

namespace rtbus::recording {

/// "D" (device base), "W" (world), or empty where a frame has no meaning or the message is not ours.
[[nodiscard]] constexpr std::string_view frame_of(std::string_view type, std::string_view field) noexcept {
  const bool vector = field.find("position_m") != field.npos || field.find("velocity_m_s") != field.npos ||
                      field.find("force_n") != field.npos || field.find("orientation_wxyz") != field.npos ||
                      field.find("angular_velocity_rad_s") != field.npos;
  if (!vector || field.find("peak") != field.npos || field.find("rms") != field.npos) return "";
  if (type == "rtbus/DeviceState") return field.starts_with("target_") ? "W" : "D";
  if (type == "rtbus/Telemetry" || type == "rtbus/PlantState" || type == "rtbus/PlantCommand") return "D";
  if (type == "rtbus/ProxyState") return "W";
  return "";
}

}  // namespace rtbus::recording
