#include "drivers/virtual_vendor/openhaptics/plug.hpp"

namespace drivers::virtual_vendor::openhaptics {

Settings read(rtbus::config::Map& map, const DeviceInfo& info, std::string_view model_type) {
  Settings out;
  out.unit = default_unit(info);
  out.unit.call_us = 0.0;
  read_unit(map, out.unit);
  out.name = map.text("name", out.name);
  out.model_type = map.text("model_type", model_type);
  const std::string init = map.choice("init", {"works", "fails", "fails_silently", "busy"}, "works");
  out.init = init == "fails"            ? Init::kFails
             : init == "fails_silently" ? Init::kFailsSilently
             : init == "busy"           ? Init::kBusy
                                        : Init::kWorks;
  if (out.unit.in_use) out.init = Init::kBusy;
  out.init_s = map.number("init_s", {0.0, 60.0}, out.init_s);
  const std::string calibration = map.choice("calibration", {"done", "needs_update", "needs_inkwell"}, "done");
  out.calibration = calibration == "needs_update"    ? Calibration::kNeedsUpdate
                    : calibration == "needs_inkwell" ? Calibration::kNeedsInkwell
                                                     : Calibration::kDone;
  out.docked_at_s = map.number("docked_at_s", {-1.0, 1e6}, out.docked_at_s);
  out.ramp_s = map.number("ramp_s", {0.0, 10.0}, out.ramp_s);
  out.wrong_ticks = static_cast<int>(map.integer("wrong_ticks", 0, 100, out.wrong_ticks));
  out.jitter_us = map.number("jitter_us", {0.0, 900.0}, out.jitter_us);
  out.late_tick = map.number("late_tick", {0.0, 1.0}, out.late_tick);
  out.stop_ticks_at_s = map.number("stop_ticks_at_s", {-1.0, 1e6}, out.stop_ticks_at_s);
  out.warm_at_s = map.number("warm_at_s", {-1.0, 1e6}, out.warm_at_s);
  out.too_fast_m_s = map.number("too_fast_m_s", {0.01, 100.0}, out.too_fast_m_s);
  out.uncalibrate_at_s = map.number("uncalibrate_at_s", {-1.0, 1e6}, out.uncalibrate_at_s);
  out.wrist_rad = map.number("wrist_rad", {-3.2, 3.2}, out.wrist_rad);
  return out;
}

}  // namespace drivers::virtual_vendor::openhaptics
