#pragma once
/// @file order_line.hpp
/// From the bridge to the order socket of `rtbus run` (docs/orders.md), counted.
#include <atomic>
#include <cstdint>
#include <cstdio>
#include <nlohmann/json.hpp>
#include <string>

#include "rtbus/clock.hpp"
#include "tools/cli/orders/order_socket.hpp"

namespace bridge {

/// Messages of ROS 2 are looked for so often, and what `rtbus run` holds for the bridge is renewed so often.
inline constexpr std::uint64_t kLook_ns = 10 * rtbus::kNsPerMs;
inline constexpr std::uint64_t kRenew_ns = 100 * rtbus::kNsPerMs;
/// So much longer than the time-out does `rtbus run` wait: the silence of an owner is the bridge's affair, this is for
/// the bridge's own.
inline constexpr double kLeaseMargin_s = 0.5;

struct OrderCounts {
  std::atomic<std::uint64_t> carried_out{0}, refused{0};
};

/// One thread.
class OrderLine {
 public:
  /// `counts` outlive it.
  OrderLine(std::string session, OrderCounts& counts) : session_(std::move(session)), counts_(counts) {}

  /// @param what Names the topic for the user. @returns whether it was carried out; says why not, but not twice the
  /// same.
  bool send(const std::string& what, const nlohmann::json& order) {
    const auto answer = tools::send_order(session_, order, kPatience_s);
    const bool done = answer && answer->value("ok", false);
    const std::string why = done ? "" : what + ": " + (answer ? answer->value("error", "refused") : answer.error());
    if (!done && why != said_) std::fprintf(stderr, "rtbus bridge: %s\n", why.c_str());
    said_ = why;
    ++(done ? counts_.carried_out : counts_.refused);
    return done;
  }
  [[nodiscard]] const std::string& session() const noexcept { return session_; }
  [[nodiscard]] OrderCounts& counts() const noexcept { return counts_; }

 private:
  static constexpr double kPatience_s = 0.3;
  std::string session_, said_;
  OrderCounts& counts_;
};

}  // namespace bridge
