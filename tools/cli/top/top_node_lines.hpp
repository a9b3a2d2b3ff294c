#pragma once
/// @file top_node_lines.hpp
/// The lines of one node on the screen of `rtbus top`. Pure.
#include "tools/cli/top/top_line.hpp"
#include "tools/cli/top/top_state.hpp"

namespace tools {

/// How much room a node gets.
enum class Detail : std::uint8_t {
  kTight,     ///< What tells whether all is well.
  kFigures,   ///< All figures.
  kSketched,  ///< With histogram and sparklines, one line each.
  kDrawn,     ///< With what was left out.
  kRoomy,     ///< With tall drawings.
};

/// What all lines of a screen have in common.
struct LineStyle {
  int width = 80;  ///< Cells; lines may be longer, the caller leaves out what does not fit.
  bool utf8 = false;
  Units units;
};

/// Older than this a heartbeat (every 20 ms) counts as lost, as the haptic node judges it.
inline constexpr double kHeartbeatLost_s = 0.06;

[[nodiscard]] Tone tone_of(const NodeLife& life);

/// @param chosen Marks it as the one that the keys have chosen.
[[nodiscard]] Lines haptic_lines(const HapticView& view, Detail detail, bool chosen, const LineStyle& style);
[[nodiscard]] Lines physics_lines(const PhysicsView& view, Detail detail, const LineStyle& style);

/// "physics lost, overspeed": what the bits of a cut mean.
[[nodiscard]] std::string cut_text(std::uint32_t bits);

}  // namespace tools
