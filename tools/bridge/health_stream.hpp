#pragma once
/// @file health_stream.hpp
/// `/diagnostics`: how the nodes of the session are, and the bridge itself.
#include <cstdint>
#include <deque>
#include <optional>
#include <string>
#include <vector>

#include "rtbus/messages.hpp"
#include "rtbus/order_messages.hpp"
#include "rtbus/subscription.hpp"
#include "tools/bridge/config/bridge_config.hpp"
#include "tools/bridge/messages.hpp"
#include "tools/bridge/participant.hpp"

namespace bridge {

/// One node, as its own topics tell.
class NodeHealth {
 public:
  /// @param haptic Else it is the physics node.
  NodeHealth(const rtbus::Session& session, const std::string& node, bool haptic);
  void maintain() noexcept;
  /// Its row now; WARN when something happened since the row before.
  [[nodiscard]] Status row();

 private:
  void add_loop(Status& row);
  void add_steps(Status& row);
  void add_orders(Status& row);

  std::string name_;
  rtbus::Subscription<rtbus::Heartbeat> beats_;
  rtbus::Subscription<rtbus::NodeInfo> infos_;
  std::optional<rtbus::Subscription<rtbus::LoopStats>> loops_;
  std::optional<rtbus::Subscription<rtbus::Orders>> orders_;
  std::optional<rtbus::Subscription<rtbus::StepStats>> steps_;
  rtbus::Stamped<rtbus::Heartbeat> beat_{};
  rtbus::Stamped<rtbus::NodeInfo> info_{};
  rtbus::Stamped<rtbus::LoopStats> loop_{};
  rtbus::Stamped<rtbus::StepStats> step_{};
  rtbus::Stamped<rtbus::Orders> order_{};
};

/// One thread.
class HealthStream {
 public:
  HealthStream(const rtbus::Session& session, const std::vector<std::string>& haptic, bool physics);
  /// The error is a sentence for the user.
  [[nodiscard]] rtbus::Result<void, std::string> open(Participant& participant, const BridgeConfig& config);
  void maintain() noexcept;
  /// @param own The bridge's own row.
  void publish(Status own, RosClock& clock);

 private:
  std::deque<NodeHealth> nodes_;
  std::optional<DdsWriter> writer_;
  Diagnostics diagnostics_;
};

}  // namespace bridge
