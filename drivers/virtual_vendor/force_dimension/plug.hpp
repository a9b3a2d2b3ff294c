#pragma once
/// @file plug.hpp
/// The stand-in for libdrd/libdhd, libstand_in_force_dimension.so: which units it shows.
#include <cstddef>

#include "drivers/virtual_vendor/stand_in.hpp"

namespace drivers::virtual_vendor::force_dimension {

struct Settings {
  UnitSettings unit;
  int type = 33;  ///< As dhdGetSystemType() gives it.
  const char* name = "omega.3";
  bool calibrated = true;         ///< Its position is known. Otherwise it is wrong, and forces are refused.
  double auto_init_s = 1.0;       ///< How long drdAutoInit() moves the arm [s].
  double wrist_rad = 0.0;         ///< Turn of the wrist about the vertical, where one is sensed [rad].
  double gripper_m = 0.0;         ///< Opening of the gripper, where there is one [m].
  double brake_speed_m_s = 3.0;   ///< A faster tip puts the brakes on: forces off until the user acts.
  double force_button_at_s = -1;  ///< Then the button turns acting forces off; on again 0.5 s after that was told. [s]
  double lose_calibration_at_s = -1;  ///< [s]
  double time_guard_us = 700.0;       ///< A state asked for sooner than this after the last one is the old one [us].
  double block_at_s = -1;             ///< One call blocks for block_s then [s].
  double block_s = 0.3;               ///< [s]
  bool has_watchdog = true;           ///< Its controller has one (firmware 3.0 and later).
};

/// Makes this unit known; it replaces the one with the same serial number. Call it while nobody has that one open.
/// `bytes`: sizeof(Settings), to catch a library of another build. Returns false then.
using PlugFunction = Plugged (*)(const Settings& settings, std::size_t bytes);
inline constexpr char kPlugSymbol[] = "rtbus_plug_force_dimension";
inline constexpr char kLibrary[] = "libstand_in_force_dimension.so";

/// Reads `virtual:` of a device file. finish() is the caller's. Throws rtbus::config::Error.
[[nodiscard]] Settings read(rtbus::config::Map& map, const DeviceInfo& info, int type, const char* name);

}  // namespace drivers::virtual_vendor::force_dimension
