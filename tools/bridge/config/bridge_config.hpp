#pragma once
/// @file bridge_config.hpp
/// The keys of `bridge:` in a session file: what goes to ROS 2, how often, under which names, and which orders may come
/// back. config/README.md lists every key. Knows no DDS: `rtbus run` checks the keys too.
#include <array>
#include <cstddef>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "haptic_node/node_config.hpp"
#include "rtbus/config/session.hpp"

namespace bridge {

/// What can be published. The first eight exist once per haptic node.
enum class Stream : std::size_t {
  kPose,
  kTwist,
  kWrench,
  kJoy,
  kJointStates,
  kProxyPose,
  kProxyTwist,
  kProxyWrench,
  kTf,
  kDiagnostics,
};
inline constexpr std::size_t kStreams = 10;

/// A row of the table of streams.
struct StreamRow {
  std::string_view key;    ///< In `publish`.
  std::string_view topic;  ///< Without the node; absolute where it begins with a slash.
  double rate_hz;          ///< Unless the file says otherwise.
};
inline constexpr std::array<StreamRow, kStreams> kStreamRows{{{"pose", "pose", 100.0},
                                                              {"twist", "twist", 100.0},
                                                              {"wrench", "wrench", 100.0},
                                                              {"joy", "joy", 100.0},
                                                              {"joint_states", "joint_states", 100.0},
                                                              {"proxy_pose", "proxy/pose", 100.0},
                                                              {"proxy_twist", "proxy/twist", 100.0},
                                                              {"proxy_wrench", "proxy/wrench", 100.0},
                                                              {"tf", "/tf", 30.0},
                                                              {"diagnostics", "/diagnostics", 1.0}}};

struct StreamConfig {
  bool on = true;
  double rate_hz = 0.0;
  bool reliable = true;  ///< Else best effort: only readers that ask for no more receive it.
  std::string topic;     ///< As in StreamRow.
};

/// A gain that ROS 2 may set.
struct AdjustOrder {
  std::string key;                 ///< "haptic0.coupling.stiffness_n_per_m"
  std::string topic;               ///< "adjust/haptic0/coupling/stiffness_n_per_m"
  double least = 0.0, most = 0.0;  ///< What comes is clamped to these.
  double initial = 0.0;            ///< By the session file: taken again when the owner falls silent.
  double timeout_s = 1.0;
};

/// A body that ROS 2 may move.
struct TargetOrder {
  std::string body;
  double timeout_s = 0.5;
};

struct OrdersConfig {
  std::optional<double> estop_timeout_s;               ///< None: no topic.
  std::optional<double> enable_timeout_s;              ///< Likewise.
  std::optional<double> marks_per_s;                   ///< Likewise.
  std::optional<double> clutch_timeout_s;              ///< Likewise; of all haptic nodes.
  std::optional<double> extra_wrench_timeout_s;        ///< Likewise …
  std::vector<std::string> clutch, takes_extra_force;  ///< … of these haptic nodes.
  std::vector<AdjustOrder> adjust;
  std::vector<TargetOrder> targets;

  [[nodiscard]] bool any() const noexcept {
    return estop_timeout_s || enable_timeout_s || marks_per_s || clutch_timeout_s || extra_wrench_timeout_s ||
           !adjust.empty() || !targets.empty();
  }
};

struct BridgeConfig {
  int domain = 0;                  ///< ROS_DOMAIN_ID.
  std::string network = "lo";      ///< Interface; "auto": Cyclone DDS chooses.
  std::vector<std::string> peers;  ///< Hosts that are asked one by one, where there is no multicast.
  std::string space;               ///< "/lab", before all names that are not absolute; or empty.
  std::array<StreamConfig, kStreams> streams;
  OrdersConfig orders;

  [[nodiscard]] const StreamConfig& of(Stream stream) const noexcept {
    return streams[static_cast<std::size_t>(stream)];
  }
  /// "/lab/haptic0/pose": name in ROS 2 of a stream of a node.
  [[nodiscard]] std::string topic(Stream stream, const std::string& node) const;
  /// "/lab/estop".
  [[nodiscard]] std::string order_topic(const std::string& name) const { return space + "/" + name; }
};

/// Reads the map `bridge`; without one: all streams, no orders. Throws rtbus::config::Error.
/// @param haptic The nodes of the session, for the gains that may be adjusted.
[[nodiscard]] BridgeConfig read_bridge_config(rtbus::config::SessionConfig& session,
                                              const std::vector<haptic::HapticConfig>& haptic);

}  // namespace bridge
