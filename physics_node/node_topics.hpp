#pragma once
/// @file node_topics.hpp
/// Private to the physics node: its ends of its topics.
#include <memory>
#include <vector>

#include "physics_node/node.hpp"
#include "rtbus/order_messages.hpp"
#include "rtbus/packet_pipe.hpp"
#include "rtbus/publication.hpp"
#include "rtbus/subscription.hpp"

namespace physics {

struct Node::Topics {
  rtbus::Publication<rtbus::Heartbeat> heartbeat;
  rtbus::Publication<rtbus::StepStats> step_stats;
  rtbus::Publication<rtbus::NodeInfo> node_info;
  std::vector<rtbus::Publication<rtbus::ProxyState>> proxy_states;                        // one per haptic node
  std::vector<std::unique_ptr<rtbus::Subscription<rtbus::DeviceState>>> device_states{};  // likewise
  std::unique_ptr<rtbus::Subscription<rtbus::BodyOrders>> body_orders{};  ///< Null where orders move no body.
  std::vector<rtbus::PacketPipe> pipes{};                                 // likewise with `link: pipe`, else empty

  /// Finds the haptic nodes, and makes anew what somebody has deleted.
  void maintain() noexcept {
    heartbeat.maintain();
    for (auto& proxy : proxy_states) proxy.maintain();
    for (const auto& subscription : device_states) subscription->maintain();
    if (body_orders) body_orders->maintain();
    step_stats.maintain();
    node_info.maintain();
  }
  /// How often that was needed, and whether it fails.
  [[nodiscard]] rtbus::RenewalCount renewals() const noexcept {
    rtbus::RenewalCount count = rtbus::count_renewals(heartbeat, step_stats, node_info);
    for (const auto& proxy : proxy_states) count += rtbus::count_renewals(proxy);
    return count;
  }
};

}  // namespace physics
