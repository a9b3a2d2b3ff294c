#include "tools/cli/run/order_desk.hpp"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <optional>
#include <utility>

#include "haptic_node/rendering/registry.hpp"
#include "rtbus/clock.hpp"
#include "tools/cli/common/formatted.hpp"
#include "tools/cli/orders/marks.hpp"

namespace tools {

namespace {

using nlohmann::json;

constexpr std::uint64_t kRepeat_ns = rtbus::kNsPerS;  // the topic of a node that starts anew
constexpr std::uint64_t kSlice_ns = 20 * rtbus::kNsPerMs;
constexpr std::size_t kLongestReason = 95;

json refusal(const std::string& why) { return {{"ok", false}, {"error", why}}; }

/// A text of the order; empty when it is not there or no text.
std::string text_of(const json& order, const char* key) {
  const auto found = order.find(key);
  return found != order.end() && found->is_string() ? found->get<std::string>() : std::string();
}

/// What a reader of the topic accepts: printable, at most kLongestReason bytes.
std::string plain(std::string text) {
  text.resize(std::min(text.size(), kLongestReason));
  std::replace_if(
      text.begin(), text.end(), [](unsigned char c) { return c < 0x20 || c == 0x7f; }, ' ');
  return text;
}

}  // namespace

struct OrderDesk::Adjustable {
  std::string key;  ///< "haptic0.coupling.stiffness_n_per_m"
  const char* unit;
  std::size_t node;
  bool stiffness;
  double now, most;
};

OrderDesk::OrderDesk(const RunPlan& plan, RunRecording& recording) : plan_(plan), recording_(recording) {}

rtbus::Result<std::unique_ptr<OrderDesk>, std::string> OrderDesk::open(const RunPlan& plan, RunRecording& recording) {
  std::unique_ptr<OrderDesk> desk(new OrderDesk(plan, recording));
  std::vector<std::pair<std::string, const haptic::HapticConfig*>> nodes;
  for (const haptic::HapticConfig& config : plan.haptic) nodes.emplace_back(config.name, &config);
  // An E-stop reaches the hands of other machines too: the link carries it.
  for (const std::string& name : plan.far_haptic) nodes.emplace_back(name, nullptr);
  for (const auto& [name, config] : nodes) {
    const std::string topic = name + ".orders";
    auto writer = rtbus::Publication<rtbus::Orders>::create(plan.session, topic, {.capacity = 4});
    if (!writer) {
      return rtbus::Failure{"session " + plan.session.name + ": topic " + topic + ": " +
                            rtbus::to_string(writer.error())};
    }
    desk->nodes_.push_back({config, std::move(*writer), {}});
  }
  auto socket =
      OrderSocket::open(plan.session.name, [self = desk.get()](const json& order) { return self->answer(order); });
  if (!socket) return rtbus::Failure{socket.error()};
  desk->socket_ = std::move(*socket);
  desk->publish();
  return desk;
}

void OrderDesk::publish() {
  published_ns_ = rtbus::monotonic_ns();
  for (Node& node : nodes_) node.topic.publish(node.orders, published_ns_);
}

bool OrderDesk::serve(std::uint64_t duration_ns) {
  const std::uint64_t end_ns = rtbus::monotonic_ns() + duration_ns;
  bool go_on = true;
  for (std::uint64_t now_ns = rtbus::monotonic_ns(); go_on && now_ns < end_ns; now_ns = rtbus::monotonic_ns()) {
    go_on = socket_->serve(std::min(kSlice_ns, end_ns - now_ns));
    for (Node& node : nodes_) node.topic.maintain();
    if (now_ns >= published_ns_ + kRepeat_ns) publish();
  }
  return go_on;
}

std::vector<OrderDesk::Adjustable> OrderDesk::adjustables() const {
  std::vector<Adjustable> out;
  for (std::size_t i = 0; i < nodes_.size(); ++i) {
    if (nodes_[i].config == nullptr) continue;  // adjusted where it runs
    const haptic::HapticConfig& config = *nodes_[i].config;
    const rtbus::Orders& orders = nodes_[i].orders;
    if (config.adjustable_stiffness) {
      out.push_back({config.name + ".coupling.stiffness_n_per_m", "N/m", i, true,
                     orders.stiffness_n_per_m > 0.0 ? orders.stiffness_n_per_m : config.stiffness_n_per_m,
                     config.gain_limits.stiffness_max_n_per_m});
    }
    if (config.adjustable_damping) {
      out.push_back({config.name + ".coupling.damping_n_s_per_m", "N.s/m", i, false,
                     orders.damping_n_s_per_m >= 0.0 ? orders.damping_n_s_per_m : config.damping_n_s_per_m,
                     config.gain_limits.damping_max_n_s_per_m});
    }
  }
  return out;
}

json OrderDesk::state() const {
  json out{{"ok", true}, {"schema", "rtbus-orders/1"}, {"session", plan_.session.name}};
  out["estop"] = !nodes_.empty() && nodes_.front().orders.estop != 0;
  out["reason"] = nodes_.empty() ? std::string() : std::string(rtbus::text_of(nodes_.front().orders.reason));
  out["adjustable"] = json::array();
  for (const Adjustable& each : adjustables()) {
    out["adjustable"].push_back({{"key", each.key}, {"unit", each.unit}, {"value", each.now}, {"most", each.most}});
  }
  out["records"] = static_cast<bool>(RTBUS_WITH_HDF5);
  out["recording"] = recording_.path();
  out["recorded"] = recording_.said();
  out["estops"] = counts_.estops;
  out["rearms"] = counts_.rearms;
  return out;
}

json OrderDesk::estop(const json& order) {
  const std::string reason = text_of(order, "reason");
  ++counts_.estops;
  for (Node& node : nodes_) {
    ++node.orders.estops;
    node.orders.estop = 1;
    rtbus::set_text(node.orders.reason, plain(reason.empty() ? "ordered" : reason));
  }
  publish();
  return state();
}

json OrderDesk::rearm() {
  ++counts_.rearms;
  for (Node& node : nodes_) {
    ++node.orders.rearms;
    node.orders.estop = 0;
    node.orders.reason = {};
  }
  publish();
  return state();
}

json OrderDesk::adjust(const json& order) {
  const std::string key = text_of(order, "key");
  const auto value = order.find("value");
  const std::vector<Adjustable> all = adjustables();
  const auto found = std::find_if(all.begin(), all.end(), [&](const Adjustable& each) { return each.key == key; });
  if (found == all.end()) {
    std::string names;
    for (const Adjustable& each : all) names += (names.empty() ? "" : ", ") + each.key;
    return refusal("'" + key + "' may not be adjusted in this session; " +
                   (names.empty() ? "it names no key in `adjustable` of a haptic entry" : "adjustable are: " + names));
  }
  if (value == order.end() || !value->is_number() || !std::isfinite(value->get<double>())) {
    return refusal(key + " needs a value, a number in " + found->unit);
  }
  const double number = value->get<double>();
  const double least = found->stiffness ? 1.0 : 0.0;  // a coupling without a spring is not what `adjust` is for
  if (number < least || number > found->most) {
    return refusal(key + " = " + formatted("%g", number) + " " + found->unit + " is outside " + formatted("%g", least) +
                   " to " + formatted("%g", found->most) + " " + found->unit + ", what the device bears at this rate");
  }
  rtbus::Orders& orders = nodes_[found->node].orders;
  (found->stiffness ? orders.stiffness_n_per_m : orders.damping_n_s_per_m) = number;
  ++counts_.adjustments;
  publish();
  return state();
}

json OrderDesk::record(const json& order) {
  std::vector<std::string> with;
  for (const char* each : {"bodies", "contacts"}) {
    if (order.value(each, json(false)) == json(true)) with.emplace_back(each);
  }
  const std::string file = text_of(order, "file");
  if (auto started = recording_.start(file.empty() ? recording_.free_name() : file, with); !started) {
    return refusal(started.error());
  }
  return state();
}

json OrderDesk::mark(const json& order) {
  const std::uint64_t now_ns = rtbus::monotonic_ns();
  const std::string text = text_of(order, "text");
  if (text.empty()) return refusal("a mark needs a text");
  const int taken = send_mark(plan_.session.name, {now_ns, text});
  if (taken == 0) return refusal("nobody records this session; start `rtbus record FILE.h5` first");
  ++counts_.marks;
  return {{"ok", true}, {"recordings", taken}};
}

json OrderDesk::answer(const json& order) {
  const std::string name = text_of(order, "order");
  if (name == "estop") return estop(order);
  if (name == "rearm") return rearm();
  if (name == "adjust") return adjust(order);
  if (name == "mark") return mark(order);
  if (name == "record") return record(order);
  if (name == "end_recording") return recording_.stop() ? state() : refusal("this session is not being recorded");
  if (name == "state") return state();
  return refusal("'" + name + "' is no order; there are estop, rearm, adjust, mark, record, end_recording and state");
}

}  // namespace tools
