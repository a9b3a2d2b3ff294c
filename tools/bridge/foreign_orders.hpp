#pragma once
/// @file foreign_orders.hpp
/// Orders from ROS 2: read by a thread of its own, judged (order_rules.hpp), and sent to `rtbus run` like any other
/// order (docs/orders.md). Whatever comes, the safety ladder of the loop is behind it.
#include <atomic>
#include <cstdint>
#include <memory>
#include <string>
#include <thread>

#include "tools/bridge/config/bridge_config.hpp"
#include "tools/bridge/participant.hpp"

namespace bridge {

/// Takes orders from start() to destruction. Counters: any thread.
class ForeignOrders {
 public:
  /// @returns null when the session names no order. The error is a sentence for the user. The participant outlives it.
  [[nodiscard]] static rtbus::Result<std::unique_ptr<ForeignOrders>, std::string> open(Participant& participant,
                                                                                       const BridgeConfig& config,
                                                                                       const std::string& session);
  ~ForeignOrders();
  /// From here on a thread of its own looks at what has come.
  void start();
  /// Takes what has come, at that time. By that thread; without it, by one other.
  void look(std::uint64_t now_ns);
  ForeignOrders(const ForeignOrders&) = delete;
  ForeignOrders& operator=(const ForeignOrders&) = delete;

  [[nodiscard]] std::uint64_t carried_out() const noexcept { return carried_out_; }
  [[nodiscard]] std::uint64_t refused() const noexcept { return refused_; }

 private:
  struct Topics;
  ForeignOrders(std::unique_ptr<Topics> topics, std::string session);
  void work();
  void follow_estop(std::uint64_t now_ns);
  void follow_enable(std::uint64_t now_ns);
  void follow_marks(std::uint64_t now_ns);
  void follow_adjustments(std::uint64_t now_ns);
  void stop(const std::string& why);
  bool send(const std::string& what, const std::string& order);

  std::unique_ptr<Topics> topics_;
  std::string session_;
  std::atomic<std::uint64_t> carried_out_{0}, refused_{0};
  std::atomic<bool> ends_{false};
  std::thread thread_;
};

}  // namespace bridge
