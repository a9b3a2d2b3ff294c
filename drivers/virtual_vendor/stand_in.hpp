#pragma once
/// @file stand_in.hpp
/// What the stand-ins for vendors' devices have in common: the mechanics and the hand of the simulated device in real
/// time, and the keys of `virtual:` in a device file that describe them.
///
/// A stand-in for a vendor's library is a shared library of ours with the vendor's symbols. One more symbol, `plug`,
/// hands it the unit that it is to show. It was written from public descriptions; nothing of a vendor is in it.
#include <cstdint>
#include <random>
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
  double late_reply = 0.0;       ///< Share of exchanges that take late_ms longer.
  double late_ms = 15.0;         ///< [ms]
  double garbage = 0.0;          ///< Share of samples that are wrong, 0…1 (Unit::spoil).
  double split_reply = 0.0;      ///< Share of answers that come in two frames, 0…1.
  double for_s = -1.0;           ///< These three end so long after the trigger [s]; < 0: never.
  /// Faults act while this file exists, and times count from its coming. It may come again. Empty: from the first
  /// force.
  std::string trigger;
  bool publish_state = false;  ///< `<node>.plant_state` shows what the hand feels (witness.hpp).
  rtbus::Session session;      ///< For that topic, as `node`. Not of the file.
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
/// `frames`: its answers come in frames, which faults can split.
void read_unit(rtbus::config::Map& map, UnitSettings& unit, bool frames = false);

/// The mechanics of a unit, in real time. One thread at a time.
class Unit {
 public:
  explicit Unit(const UnitSettings& settings) : settings_(settings), mechanics_(settings.mechanics, settings.hand) {}

  /// The unit takes forces from now on: the hand's script begins, and the faults' times without a trigger.
  void begin(std::uint64_t now_ns);
  [[nodiscard]] bool begun() const noexcept { return begin_ns_ != 0; }
  /// Seconds since begin(), or since the trigger; negative: that was not yet.
  [[nodiscard]] double age_s(std::uint64_t now_ns) const noexcept;
  /// How much longer the exchange that begins now takes [us].
  [[nodiscard]] double late_us(std::uint64_t now_ns) noexcept;
  /// Whether the sample of this exchange is wrong.
  [[nodiscard]] bool garbles(std::uint64_t now_ns) noexcept;
  /// Whether the answer that goes out now comes in two frames.
  [[nodiscard]] bool splits(std::uint64_t now_ns) noexcept;
  /// A wrong sample: a coordinate in turn no number, 10³⁰, and 0.4 m away. In units of `metre`.
  void spoil(double* position, std::uint64_t now_ns, double metre = 1.0) noexcept;
  /// Below `below`, from the unit's own sequence.
  [[nodiscard]] std::uint64_t draw(std::uint64_t below) noexcept { return random_() % below; }
  /// Asked in each exchange. It is plugged in again so long after the first answer that it is not.
  [[nodiscard]] bool plugged_in(std::uint64_t now_ns) noexcept;
  [[nodiscard]] simulated::Mechanics& mechanics() noexcept { return mechanics_; }
  [[nodiscard]] const UnitSettings& settings() const noexcept { return settings_; }
  /// Lets the time pass.
  void advance_to(std::uint64_t now_ns);

 private:
  [[nodiscard]] bool happens(double share, std::uint64_t now_ns) noexcept;

  UnitSettings settings_;
  simulated::Mechanics mechanics_;
  std::mt19937_64 random_{1};
  std::uint64_t spoilt_ = 0;  ///< Samples so far.
  bool running_ = false;
  std::uint64_t begin_ns_ = 0;
  std::uint64_t triggered_ns_ = 0;
  std::uint64_t missed_ns_ = 0;  ///< When somebody first found it unplugged.
};

/// Blocks the caller as an exchange with the device would.
void block_for_us(double us);

}  // namespace drivers::virtual_vendor
