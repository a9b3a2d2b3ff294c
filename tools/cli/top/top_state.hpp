#pragma once
/// @file top_state.hpp
/// What `rtbus top` knows at one instant, and what its user has chosen to look at. Plain data: the collector fills it
/// in, the view and the JSON read it.
#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "rtbus/link_messages.hpp"
#include "rtbus/messages.hpp"
#include "rtbus/topic_directory.hpp"
#include "tools/cli/top/top_signal.hpp"

namespace tools {

/// Signs of life of a node.
struct NodeLife {
  bool writer_alive = false;              ///< Its process holds its topics.
  std::optional<double> heartbeat_age_s;  ///< Since the newest heartbeat; none before the first.
  std::uint32_t pid = 0;
  std::uint32_t restarts = 0;  ///< Processes that took the topics over from a dead one.
  double process_age_s = 0.0;  ///< Since the present or last process took the topics.
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
  std::optional<rtbus::LinkStats> link;  ///< Of a device over USB.
  std::optional<std::string> estop;      ///< An E-stop holds the force at zero: its reason.
  std::optional<double> force_n;         ///< RMS of the force over the last fraction of a second.
  std::optional<double> loss_age_s;      ///< Since physics was last declared lost.
  std::optional<RecentView> recent;      ///< From the telemetry; none when it is not followed or nothing came.
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

/// One field of the sample that the topic page shows.
struct FieldView {
  std::string name;
  std::string unit;
  std::vector<rtbus::FieldValue> values;
};

/// The topic that the topic page shows.
struct SampleView {
  std::string topic;
  std::string type_name;
  std::string problem;  ///< Why there is no sample; empty when there is.
  std::uint64_t sequence = 0;
  double age_s = 0.0;
  std::vector<FieldView> fields;
};

struct TopSnapshot {
  std::string session;                ///< Empty: none is shown.
  std::string message;                ///< What to do when there is none, or several.
  std::vector<std::string> sessions;  ///< The live ones, sorted.
  double uptime_s = 0.0;              ///< Since the oldest live writer took its topic.
  std::vector<HapticView> haptic;
  std::vector<PhysicsView> physics;
  std::vector<TopicView> topics;
};

enum class TopPage : std::uint8_t { kOverview, kTopics, kHelp };

/// What the user has chosen. Nodes and topics by name, so that the choice survives their coming and going.
struct TopChoice {
  TopPage page = TopPage::kOverview;
  bool paused = false;
  bool si = false;         ///< Metres and seconds instead of mm, ms and us.
  bool utf8 = false;       ///< The terminal shows block characters.
  std::string node;        ///< Empty or gone: the first.
  std::string topic;       ///< Likewise.
  std::size_t scroll = 0;  ///< First field shown on the topic page.
  std::string session;     ///< Picked from several live ones; empty: none yet.
  std::string notice;      ///< What an order of the user's led to; in place of the keys for a while.
};

}  // namespace tools
