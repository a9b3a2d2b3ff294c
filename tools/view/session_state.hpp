#pragma once
/// @file session_state.hpp
/// The state of a hand in one word that can be read across a room, with the reason in a sentence. Pure.
#include <cstdint>
#include <optional>
#include <string>

namespace view {

/// How loud the page says it.
enum class Level : std::uint8_t { kGood, kWarn, kBad };

struct HandState {
  std::string word;  ///< NORMAL, CLAMPED, FADING, RAMPING, OFF, CUT, LOST, E-STOP.
  std::string reason;
  Level level = Level::kGood;
};

struct HandSigns {
  std::string name;                  ///< "haptic0"
  bool writer_alive = false;         ///< Its process holds its topics.
  std::optional<double> tick_age_s;  ///< Since the newest tick; none: none came yet.
  std::uint32_t safety = 0;          ///< haptic::SafetyBit of the newest tick.
  std::uint32_t recent_safety = 0;   ///< Of all ticks of the last kShown_s.
  double gate = 1.0;                 ///< Of the newest tick, 0…1.
  double force_limit_n = 0.0;
  std::string estop;    ///< Why there is an E-stop: "rtbus top".
  std::string physics;  ///< What is known of physics: "stopped or starved", "its process has ended"; "": alive.
};

/// A clamp of one tick stays on the screen that long.
inline constexpr double kShown_s = 0.5;
/// Without a tick for so long a loop counts as silent.
inline constexpr double kSilent_s = 0.15;

[[nodiscard]] HandState judge(const HandSigns& signs);

/// "good", "warn", "bad".
[[nodiscard]] const char* to_string(Level level) noexcept;

}  // namespace view
