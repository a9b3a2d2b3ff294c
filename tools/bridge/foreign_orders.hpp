#pragma once
/// @file foreign_orders.hpp
/// Gains, marks, clutch, extra force and targets of bodies from ROS 2: read by a thread of its own, judged
/// (order_rules.hpp), and sent to `rtbus run` like any other order (docs/orders.md). Whatever comes, the safety ladder
/// of the loop is behind it.
#include <atomic>
#include <memory>
#include <string>
#include <thread>

#include "tools/bridge/config/bridge_config.hpp"
#include "tools/bridge/order_line.hpp"
#include "tools/bridge/participant.hpp"

namespace bridge {

/// Takes orders from start() to destruction.
class ForeignOrders {
 public:
  /// @returns null when the session names none of them. The error is a sentence for the user. The others outlive it.
  [[nodiscard]] static rtbus::Result<std::unique_ptr<ForeignOrders>, std::string> open(Participant& participant,
                                                                                       const BridgeConfig& config,
                                                                                       const std::string& session,
                                                                                       OrderCounts& counts);
  ~ForeignOrders();
  /// From here on a thread of its own looks at what has come.
  void start();
  /// Takes what has come, at that time. By that thread; without it, by one other.
  void look(std::uint64_t now_ns);
  ForeignOrders(const ForeignOrders&) = delete;
  ForeignOrders& operator=(const ForeignOrders&) = delete;

 private:
  struct Topics;
  ForeignOrders(std::unique_ptr<Topics> topics, const std::string& session, OrderCounts& counts);
  void work();
  void follow_marks(std::uint64_t now_ns);
  void follow_adjustments(std::uint64_t now_ns);
  void follow_clutches(std::uint64_t now_ns);
  void follow_extra_forces(std::uint64_t now_ns);
  void follow_targets(std::uint64_t now_ns);
  void count(bool refused);

  std::unique_ptr<Topics> topics_;
  OrderLine line_;
  std::atomic<bool> ends_{false};
  std::thread thread_;
};

}  // namespace bridge
