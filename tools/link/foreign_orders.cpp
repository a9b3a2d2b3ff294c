// Orders of the other machine: `rtbus run` of this one gets them as if they had been given here.
#include <algorithm>
#include <nlohmann/json.hpp>
#include <utility>

#include "rtbus/order_client.hpp"
#include "rtbus/sane_sample.hpp"
#include "tools/link/link_node_impl.hpp"

namespace link_dds {

namespace {

/// `rtbus run` of this machine answers an order within so long.
constexpr double kOrderPatience_s = 0.5;
/// Two samples tell the same order when their ends differ by less: a packet may come that much later than the one
/// before it.
constexpr std::uint64_t kSameEnd_ns = 50 * rtbus::kNsPerMs;

}  // namespace

bool LinkNode::Impl::take_body_orders(rtbus::BodyOrders orders, std::uint64_t now_ns) {
  for (std::uint64_t& until_ns : orders.until_ns) {
    if (until_ns > rtbus::Orders::kLongestHold_ns) return false;
    if (until_ns > 0) until_ns += now_ns;
  }
  if (!rtbus::SampleTraits<rtbus::BodyOrders>::sane(orders, now_ns)) return false;
  const std::lock_guard lock(peers_guard);
  for (std::size_t i = 0; i < orders.count; ++i) {
    const auto same = [&](const auto& rows) { return (orders.*rows)[i] == (body_orders.*rows)[i]; };
    using B = rtbus::BodyOrders;
    const std::uint64_t until_ns = orders.until_ns[i], before_ns = std::max(body_orders.until_ns[i], now_ns);
    const bool ends = until_ns == 0 && before_ns > now_ns + kSameEnd_ns;
    const bool news = until_ns > before_ns + kSameEnd_ns || !same(&B::body) || !same(&B::order) ||
                      !same(&B::position_m) || !same(&B::orientation_wxyz) || !same(&B::velocity_m_s) ||
                      !same(&B::angular_velocity_rad_s);
    if (!ends && (until_ns == 0 || !news)) continue;
    waiting_orders.body[i] = orders.body[i];
    waiting_orders.order[i] = orders.order[i];
    waiting_orders.until_ns[i] = std::max<std::uint64_t>(until_ns, 1);  // 0: nothing waits
    waiting_orders.position_m[i] = orders.position_m[i];
    waiting_orders.orientation_wxyz[i] = orders.orientation_wxyz[i];
    waiting_orders.velocity_m_s[i] = orders.velocity_m_s[i];
    waiting_orders.angular_velocity_rad_s[i] = orders.angular_velocity_rad_s[i];
  }
  body_orders = orders;
  return true;
}

void LinkNode::Impl::pass_on(const std::vector<std::string>& reasons,
                             const std::function<void(const std::string&)>& tell) {
  for (const std::string& reason : reasons) {
    const nlohmann::json order{{"order", "estop"}, {"reason", "other machine: " + reason}};
    const auto answer = rtbus::send_order_text(plan.session.name, order.dump(), kOrderPatience_s);
    tell(answer ? "E-stop ordered on the other machine is passed on: " + reason
                : "E-stop ordered on the other machine has no taker here: " + answer.error().sentence);
  }
}

void LinkNode::Impl::pass_on_bodies(const std::function<void(const std::string&)>& tell) {
  rtbus::BodyOrders orders;
  {
    const std::lock_guard lock(peers_guard);
    orders = std::exchange(waiting_orders, {});
  }
  for (std::size_t i = 0; i < rtbus::BodyOrders::kBodies; ++i) {
    if (orders.until_ns[i] == 0 || orders.body[i] >= plan.bodies.size()) continue;
    const std::uint64_t now_ns = rtbus::monotonic_ns();
    const double left_s = orders.until_ns[i] > now_ns ? rtbus::seconds_between(now_ns, orders.until_ns[i]) : 0.0;
    nlohmann::json order{{"order", "target"}, {"body", plan.bodies[orders.body[i]]}, {"for_s", left_s}};
    if (orders.order[i] == static_cast<std::uint32_t>(rtbus::BodyOrder::kTwist)) {
      order["velocity_m_s"] = orders.velocity_m_s[i];
      order["angular_velocity_rad_s"] = orders.angular_velocity_rad_s[i];
    } else {
      order["position_m"] = orders.position_m[i];
      order["orientation_wxyz"] = orders.orientation_wxyz[i];
    }
    const auto answer = rtbus::send_order_text(plan.session.name, order.dump(), kOrderPatience_s);
    std::string refusal = answer ? "" : answer.error().sentence;
    if (answer) {
      const nlohmann::json said = nlohmann::json::parse(*answer, nullptr, false);
      if (said.is_object() && !said.value("ok", false)) refusal = said.value("error", "refused");
    }
    if (!refusal.empty() && refusal != told_refusal) {
      tell("an order of the other machine for " + plan.bodies[orders.body[i]] + " is not followed: " + refusal);
    }
    told_refusal = refusal;
  }
}

}  // namespace link_dds
