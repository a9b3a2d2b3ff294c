#pragma once
/// @file top_view.hpp
/// The screen of `rtbus top` as plain lines, made from a snapshot. Pure: no terminal, no clock, no shared memory.
/// ASCII only, so that it looks the same on any terminal.
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "rtbus/messages.hpp"

namespace tools {

/// Signs of life of a node.
struct NodeLife {
  bool writer_alive = false;              ///< Its process holds its topics.
  std::optional<double> heartbeat_age_s;  ///< Since the newest heartbeat; none before the first.
  std::uint32_t pid = 0;
};

/// "alive"; "STALE 0.34 s" when the heartbeat is older than 60 ms (process stopped or starved); "GONE" when the process
/// has ended without cleaning up; "starting" before the first heartbeat.
[[nodiscard]] std::string life_text(const NodeLife& life);

struct HapticView {
  std::string name;
  NodeLife life;
  std::optional<rtbus::NodeInfo> info;
  std::optional<rtbus::LoopStats> stats;
  std::optional<rtbus::DeviceState> device;
  std::optional<double> force_n;     ///< RMS of the force over the last fraction of a second.
  std::optional<double> loss_age_s;  ///< Since physics was last declared lost.
};

struct PhysicsView {
  std::string name;
  NodeLife life;
  std::optional<rtbus::NodeInfo> info;
  std::optional<rtbus::StepStats> stats;
};

struct TopicView {
  std::string name;
  std::optional<double> rate_hz;
  std::uint64_t published = 0;
  std::uint32_t writer_pid = 0;
  bool writer_alive = false;
  std::string problem;  ///< Why it cannot be read; empty when it can.
};

struct TopSnapshot {
  std::string session;    ///< Empty: none is running.
  std::string message;    ///< What to do when there is none, or several.
  double uptime_s = 0.0;  ///< Since the oldest live writer took its topic.
  bool paused = false;
  std::vector<HapticView> haptic;
  std::vector<PhysicsView> physics;
  std::vector<TopicView> topics;
};

enum class Tone : std::uint8_t { kPlain, kHeading, kWarn, kBad, kDim };

struct ViewLine {
  std::string text;
  Tone tone = Tone::kPlain;
};

/// Exactly `height` lines of at most `width` characters. What does not fit is shortened in this order: topics, then the
/// details of the haptic nodes; what was left out is counted. With `height` 0 (for scripts) nothing is left out.
[[nodiscard]] std::vector<ViewLine> top_lines(const TopSnapshot& snapshot, int width, int height);

/// The help page, same shape.
[[nodiscard]] std::vector<ViewLine> help_lines(int width, int height);

/// RMS of the force between two LoopStats of one node [N]: their RMS values go over everything since start, so the
/// difference of the square sums is what happened in between. None when no tick lies between them.
[[nodiscard]] std::optional<double> force_between(const rtbus::LoopStats& before, const rtbus::LoopStats& now);

/// The text of a fixed-size field, up to its first zero.
template <std::size_t N>
[[nodiscard]] std::string text_of(const rtbus::Text<N>& text) {
  std::string out;
  for (const char c : text) {
    if (c == '\0') break;
    out += c >= 0x20 && c < 0x7f ? c : '?';
  }
  return out;
}

}  // namespace tools
