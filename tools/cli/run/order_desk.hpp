#pragma once
/// @file order_desk.hpp
/// Takes the orders of a session (docs/orders.md) and passes them to its nodes: the only writer of `<haptic>.orders`.
#include <cstdint>
#include <memory>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "rtbus/order_messages.hpp"
#include "rtbus/publication.hpp"
#include "rtbus/result.hpp"
#include "tools/cli/orders/order_socket.hpp"
#include "tools/cli/run/run_plan.hpp"
#include "tools/cli/run/run_recording.hpp"

namespace tools {

/// Part of `rtbus run`. One thread.
class OrderDesk {
 public:
  /// Plan and recording outlive the desk. The error is a sentence for the user.
  [[nodiscard]] static rtbus::Result<std::unique_ptr<OrderDesk>, std::string> open(const RunPlan& plan,
                                                                                   RunRecording& recording);

  /// Takes orders for `duration_ns`, or until a signal comes; keeps the topics alive. @returns false when interrupted.
  bool serve(std::uint64_t duration_ns);

  struct Counts {
    std::uint64_t estops = 0, rearms = 0, adjustments = 0, marks = 0;
  };
  [[nodiscard]] const Counts& counts() const noexcept { return counts_; }

 private:
  struct Node {
    const haptic::HapticConfig* config;  ///< Null: it runs on another machine.
    rtbus::Publication<rtbus::Orders> topic;
    rtbus::Orders orders{};
  };
  struct Adjustable;  ///< A gain that the session lets orders change.

  OrderDesk(const RunPlan& plan, RunRecording& recording);
  [[nodiscard]] nlohmann::json answer(const nlohmann::json& order);
  [[nodiscard]] nlohmann::json estop(const nlohmann::json& order);
  [[nodiscard]] nlohmann::json rearm();
  [[nodiscard]] nlohmann::json adjust(const nlohmann::json& order);
  [[nodiscard]] nlohmann::json record(const nlohmann::json& order);
  [[nodiscard]] nlohmann::json mark(const nlohmann::json& order);
  [[nodiscard]] nlohmann::json state() const;
  [[nodiscard]] std::vector<Adjustable> adjustables() const;
  void publish();

  const RunPlan& plan_;
  RunRecording& recording_;
  std::vector<Node> nodes_;
  std::unique_ptr<OrderSocket> socket_;
  Counts counts_;
  std::uint64_t published_ns_ = 0;
};

}  // namespace tools
