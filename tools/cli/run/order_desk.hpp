#pragma once
/// @file order_desk.hpp
/// Takes the orders of a session (docs/orders.md) and passes them to its nodes: the only writer of `<haptic>.orders`.
#include <cstdint>
#include <memory>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <vector>

#include "rtbus/order_messages.hpp"
#include "rtbus/publication.hpp"
#include "rtbus/result.hpp"
#include "tools/cli/orders/order_socket.hpp"
#include "tools/cli/run/leases.hpp"
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

  /// What the telemetry of a node told of E-stops, however old it is: a node that crashes forgets its button, the
  /// orders do not. Call it again and again. @param pressed_ns When its E-stop button was last down; 0: never. @param
  /// stopped_ns When an E-stop last acted on its force; 0: never.
  void heed_device(const haptic::HapticConfig& haptic, std::uint64_t pressed_ns, std::uint64_t stopped_ns);

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
  [[nodiscard]] nlohmann::json rearm(const nlohmann::json& order);
  [[nodiscard]] nlohmann::json watch(const nlohmann::json& order);
  [[nodiscard]] nlohmann::json adjust(const nlohmann::json& order);
  [[nodiscard]] nlohmann::json clutch(const nlohmann::json& order);
  [[nodiscard]] nlohmann::json extra_force(const nlohmann::json& order);
  [[nodiscard]] nlohmann::json move_body(const nlohmann::json& order);
  [[nodiscard]] nlohmann::json record(const nlohmann::json& order);
  [[nodiscard]] nlohmann::json mark(const nlohmann::json& order);
  [[nodiscard]] nlohmann::json state() const;
  [[nodiscard]] std::vector<Adjustable> adjustables() const;
  /// The haptic node that the order names. The error is a sentence for the user.
  [[nodiscard]] rtbus::Result<Node*, std::string> node_of(const nlohmann::json& order);
  void stop(const std::string& source, const std::string& reason);
  void end_leases(std::uint64_t now_ns);
  void publish();

  const RunPlan& plan_;
  RunRecording& recording_;
  std::vector<Node> nodes_;
  std::optional<rtbus::Publication<rtbus::BodyOrders>> bodies_topic_;  ///< None where orders move no body.
  rtbus::BodyOrders bodies_;
  std::unique_ptr<OrderSocket> socket_;
  Counts counts_;
  Holders holders_;         ///< Of the E-stop.
  Leases watches_, gains_;  ///< By source; by key.
  std::uint64_t published_ns_ = 0;
  std::uint64_t rearmed_ns_ = 0;  ///< 0: never.
};

}  // namespace tools
