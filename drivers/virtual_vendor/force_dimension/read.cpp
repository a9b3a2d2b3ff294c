#include "drivers/virtual_vendor/force_dimension/plug.hpp"

namespace drivers::virtual_vendor::force_dimension {

Settings read(rtbus::config::Map& map, const DeviceInfo& info, int type, const char* name) {
  Settings out;
  out.unit = default_unit(info);
  out.type = static_cast<int>(map.integer("system_type", 0, 255, type));
  out.name = name;
  read_unit(map, out.unit);
  out.calibrated = map.boolean("calibrated", out.calibrated);
  out.auto_init_s = map.number("auto_init_s", {0.0, 60.0}, out.auto_init_s);
  out.wrist_rad = map.number("wrist_rad", {-3.2, 3.2}, out.wrist_rad);
  out.gripper_m = map.number("gripper_m", {0.0, 0.1}, out.gripper_m);
  out.brake_speed_m_s = map.number("brake_speed_m_s", {0.01, 100.0}, out.brake_speed_m_s);
  out.force_button_at_s = map.number("force_button_at_s", {-1.0, 1e6}, out.force_button_at_s);
  out.lose_calibration_at_s = map.number("lose_calibration_at_s", {-1.0, 1e6}, out.lose_calibration_at_s);
  out.time_guard_us = map.number("time_guard_us", {0.0, 1e5}, out.time_guard_us);
  out.block_at_s = map.number("block_at_s", {-1.0, 1e6}, out.block_at_s);
  out.block_s = map.number("block_s", {0.0, 60.0}, out.block_s);
  out.has_watchdog = map.boolean("has_watchdog", out.has_watchdog);
  return out;
}

}  // namespace drivers::virtual_vendor::force_dimension
