#pragma once
/// @file stop_orders.hpp
/// The topics `estop` and `enable` of ROS 2. They have a thread of their own, so that no other order holds them up.
///
/// Who sends `estop: false` or `enable: true` watches over the session: his silence stops it. `rtbus run` holds a lease
/// of that watch, which is renewed here: a bridge that dies or hangs stops the session too.
#include <atomic>
#include <memory>
#include <optional>
#include <string>
#include <thread>

#include "tools/bridge/config/bridge_config.hpp"
#include "tools/bridge/order_line.hpp"
#include "tools/bridge/order_rules.hpp"
#include "tools/bridge/participant.hpp"

namespace bridge {

/// An E-stop that is wanted until it has been ordered, and the lease of a watch.
class StopWish {
 public:
  explicit StopWish(std::string source) : source_(std::move(source)) {}
  void want(const std::string& why) { why_ = why; }
  void drop() { why_.clear(); }
  /// Orders the E-stop if one is wanted; once more after a while when that failed.
  void follow(OrderLine& line, std::uint64_t now_ns);
  /// Renews the lease for somebody who may be silent for so long yet; 0: ends it. Rarely.
  void watch(OrderLine& line, double for_s, std::uint64_t now_ns);
  [[nodiscard]] const std::string& source() const noexcept { return source_; }

 private:
  static constexpr double kTries_per_s = 5.0;
  std::string source_, why_;
  Pace tries_{kTries_per_s};
  std::uint64_t renewed_ns_ = 0;
  bool watched_ = false;
};

/// Takes orders from start() to destruction.
class StopOrders {
 public:
  /// @returns null when the session names none of them. The error is a sentence for the user. The others outlive it.
  [[nodiscard]] static rtbus::Result<std::unique_ptr<StopOrders>, std::string> open(Participant& participant,
                                                                                    const BridgeConfig& config,
                                                                                    const std::string& session,
                                                                                    OrderCounts& counts);
  ~StopOrders();
  /// From here on a thread of its own looks at what has come.
  void start();
  /// Takes what has come, at that time. By that thread; without it, by one other.
  void look(std::uint64_t now_ns);
  StopOrders(const StopOrders&) = delete;
  StopOrders& operator=(const StopOrders&) = delete;

 private:
  StopOrders(const std::string& session, OrderCounts& counts) : line_(session, counts) {}
  void work();
  void follow_estop(std::uint64_t now_ns);
  void follow_enable(std::uint64_t now_ns);

  OrderLine line_;
  std::optional<DdsReader> estop_topic_, enable_topic_;
  std::optional<EstopRule> estop_;
  std::optional<EnableRule> enable_;
  StopWish estop_wish_{"ROS 2 topic estop"}, enable_wish_{"ROS 2 topic enable"};
  std::atomic<bool> ends_{false};
  std::thread thread_;
};

}  // namespace bridge
