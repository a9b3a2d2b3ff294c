#pragma once
/// @file stand_in.hpp
/// What the stand-ins for vendors' devices have in common: the mechanics and the hand of the simulated device in real
/// time, and the keys of `virtual:` in a device file that describe them.
///
/// A stand-in for a vendor's library is a shared library of ours with the vendor's symbols. One more symbol, `plug`,
/// hands it the unit that it is to show. It was written from public descriptions; nothing of a vendor is in it.
#include <cstdint>
#include <string>

#include "drivers/device.hpp"
#include "drivers/device_config.hpp"
#include "drivers/simulated/hand.hpp"
#include "drivers/simulated/mechanics.hpp"
#include "rtbus/config/document.hpp"
#include "rtbus/segment.hpp"

namespace drivers::virtual_vendor {

/// A unit without hardware. Times of faults count from the moment the unit first takes forces, or from a signal.
struct UnitSettings {
  std::string serial = "1";
  simulated::MechanicsParameters mechanics;  ///< Frame D.
  simulated::Hand hand;
  double call_us = 100.0;        ///< How long a call that exchanges with the device blocks [us].
  double unplug_at_s = -1.0;     ///< < 0: never.
  double replug_after_s = -1.0;  ///< < 0: never.
  bool in_use = false;           ///< Another process has it.
  bool one_session = false;      ///< One session at a time may have the unit of this serial, as with hardware.
  std::string trigger;           ///< Times of faults count from when this file exists; empty: from the first force.
  bool publish_state = false;    ///< `<node>.plant_state` shows what the hand feels (witness.hpp).
  rtbus::Session session;        ///< For that topic, as `node`. Not of the file.
  std::string node;
};

/// What came of plugging a unit into a stand-in's library.
enum class Plugged : std::uint8_t {
  kYes,
  kOtherBuild,  ///< The library's settings are not those of this program.
  kInUse,       ///< A unit that is open would be replaced.
};

/// What the user is told; empty: it worked.
[[nodiscard]] std::string explain(Plugged outcome, const char* library);

/// Defaults that follow the device's limits: its mass, force and workspace, own choice of friction.
[[nodiscard]] UnitSettings default_unit(const DeviceInfo& info);

/// A stand-in's settings, for the node that opens it.
template <class Settings>
[[nodiscard]] Settings seen_by(Settings settings, const OpenContext& context) {
  settings.unit.session = context.session;
  settings.unit.node = context.node_name;
  return settings;
}

/// Reads what all stand-ins have in common out of `virtual:`. finish() is the caller's. Throws rtbus::config::Error.
void read_unit(rtbus::config::Map& map, UnitSettings& unit);

/// The mechanics of a unit, in real time. One thread at a time.
class Unit {
 public:
  explicit Unit(const UnitSettings& settings) : settings_(settings), mechanics_(settings.mechanics, settings.hand) {}

  /// The unit takes forces from now on: the hand's script begins, and the faults' times without a trigger.
  void begin(std::uint64_t now_ns);
  [[nodiscard]] bool begun() const noexcept { return begin_ns_ != 0; }
  /// Seconds since begin(), or since the trigger; negative: that was not yet.
  [[nodiscard]] double age_s(std::uint64_t now_ns) const noexcept;
  /// Asked in each exchange. It is plugged in again so long after the first answer that it is not.
  [[nodiscard]] bool plugged_in(std::uint64_t now_ns) noexcept;
  [[nodiscard]] simulated::Mechanics& mechanics() noexcept { return mechanics_; }
  [[nodiscard]] const UnitSettings& settings() const noexcept { return settings_; }
  /// Lets the time pass.
  void advance_to(std::uint64_t now_ns);

 private:
  UnitSettings settings_;
  simulated::Mechanics mechanics_;
  bool running_ = false;
  std::uint64_t begin_ns_ = 0;
  std::uint64_t triggered_ns_ = 0;
  std::uint64_t missed_ns_ = 0;  ///< When somebody first found it unplugged.
};

/// Blocks the caller as an exchange with the device would.
void block_for_us(double us);

}  // namespace drivers::virtual_vendor
