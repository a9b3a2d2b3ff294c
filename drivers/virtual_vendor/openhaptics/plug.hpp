#pragma once
/// @file plug.hpp
/// The stand-in for libHD, libstand_in_openhaptics.so: which unit it shows.
#include <cstddef>
#include <string>

#include "drivers/virtual_vendor/stand_in.hpp"

namespace drivers::virtual_vendor::openhaptics {

/// What hdInitDevice() does.
enum class Init { kWorks, kFails, kFailsSilently, kBusy };

enum class Calibration { kDone, kNeedsUpdate, kNeedsInkwell };

struct Settings {
  UnitSettings unit;
  std::string name;  ///< Of its configuration; empty: the default device alone.
  std::string model_type = "Touch";
  Init init = Init::kWorks;
  double init_s = 0.2;  ///< How long it takes [s].
  Calibration calibration = Calibration::kDone;
  double docked_at_s = -1.0;       ///< The stylus is put into the inkwell, so long after the start [s]; < 0: never.
  double ramp_s = 0.1;             ///< Forces rise so long after the start and after an error [s].
  int wrong_ticks = 50;            ///< So many ticks after the start with a wrong position.
  double jitter_us = 30.0;         ///< A tick comes up to so late [us].
  double late_tick = 0.0;          ///< Share of ticks that come 3 ms late.
  double stop_ticks_at_s = -1;     ///< The servo thread ends [s]; < 0: never.
  double warm_at_s = -1.0;         ///< [s]
  double too_fast_m_s = 3.0;       ///< Faster: EXCEEDED_MAX_VELOCITY, force zero for 0.1 s [m/s].
  double uncalibrate_at_s = -1.0;  ///< [s]
  double wrist_rad = 0.0;          ///< Turn of the stylus about the vertical [rad].
};

/// Makes this unit the one that the library shows. Call it while nothing is initialised. `bytes`: sizeof(Settings).
using PlugFunction = Plugged (*)(const Settings& settings, std::size_t bytes);
inline constexpr char kPlugSymbol[] = "rtbus_plug_openhaptics";
inline constexpr char kLibrary[] = "libstand_in_openhaptics.so";

/// Reads `virtual:` of a device file. finish() is the caller's. Throws rtbus::config::Error.
[[nodiscard]] Settings read(rtbus::config::Map& map, const DeviceInfo& info, std::string_view model_type);

}  // namespace drivers::virtual_vendor::openhaptics
