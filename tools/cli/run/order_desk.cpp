#include "tools/cli/run/order_desk.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <nlohmann/json.hpp>
#include <optional>
#include <utility>

#include "haptic_node/rendering/registry.hpp"
#include "rtbus/clock.hpp"
#include "rtbus/eigen.hpp"
#include "tools/cli/common/formatted.hpp"
#include "tools/cli/orders/marks.hpp"

namespace tools {

namespace {

using nlohmann::json;

constexpr std::uint64_t kRepeat_ns = rtbus::kNsPerS;      // the topic of a node that starts anew
constexpr std::uint64_t kRearmTaken_ns = 2 * kRepeat_ns;  // every node has heard of it by then
constexpr std::uint64_t kSlice_ns = 20 * rtbus::kNsPerMs;
constexpr std::size_t kLongestReason = 95;
constexpr double kLongestHold_s = static_cast<double>(rtbus::Orders::kLongestHold_ns) * 1e-9;
constexpr double kAbsurd = 1e6;  // a sample with such a number would be refused as a whole
constexpr double kLongestWatch_s = 120.0;
constexpr const char* kNeedsForS = " needs for_s, 0 to 1 s; whoever wants it longer repeats it";

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

/// `for_s` of an order. None: no number from 0 to `most_s`.
std::optional<double> seconds_of(const json& order, double most_s) {
  const auto held = order.find("for_s");
  if (held == order.end() || !held->is_number()) return std::nullopt;
  const double for_s = held->get<double>();
  return for_s >= 0.0 && for_s <= most_s ? std::optional(for_s) : std::nullopt;
}

/// Until when an order holds. None: it does not say so.
std::optional<std::uint64_t> until_of(const json& order, std::uint64_t now_ns) {
  const auto for_s = seconds_of(order, kLongestHold_s);
  return for_s ? std::optional(now_ns + rtbus::ns_of(*for_s)) : std::nullopt;
}

/// So many numbers of the order; none where they are not there, or absurd.
template <std::size_t N>
std::optional<std::array<double, N>> numbers_of(const json& order, const char* key) {
  const auto found = order.find(key);
  if (found == order.end() || !found->is_array() || found->size() != N) return std::nullopt;
  std::array<double, N> out;
  for (std::size_t i = 0; i < N; ++i) {
    if (!(*found)[i].is_number() || !(std::abs((*found)[i].get<double>()) < kAbsurd)) return std::nullopt;
    out[i] = (*found)[i].get<double>();
  }
  return out;
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
  if (const auto moved = rtbus::config::bodies_that_orders_move(plan.world); !moved.empty()) {
    auto writer = rtbus::Publication<rtbus::BodyOrders>::create(plan.session, "physics.body_orders", {.capacity = 4});
    if (!writer) {
      return rtbus::Failure{"session " + plan.session.name +
                            ": topic physics.body_orders: " + rtbus::to_string(writer.error())};
    }
    desk->bodies_topic_.emplace(std::move(*writer));
    desk->bodies_.count = static_cast<std::uint32_t>(std::min(moved.size(), rtbus::BodyOrders::kBodies));
    for (std::size_t i = 0; i < desk->bodies_.count; ++i) desk->bodies_.body[i] = static_cast<std::uint32_t>(moved[i]);
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
  if (bodies_topic_) bodies_topic_->publish(bodies_, published_ns_);
}

bool OrderDesk::serve(std::uint64_t duration_ns) {
  const std::uint64_t end_ns = rtbus::monotonic_ns() + duration_ns;
  bool go_on = true;
  for (std::uint64_t now_ns = rtbus::monotonic_ns(); go_on && now_ns < end_ns; now_ns = rtbus::monotonic_ns()) {
    go_on = socket_->serve(std::min(kSlice_ns, end_ns - now_ns));
    for (Node& node : nodes_) node.topic.maintain();
    if (bodies_topic_) bodies_topic_->maintain();
    end_leases(now_ns);
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
  out["held_by"] = holders_.all();
  out["recorded"] = recording_.said();
  out["estops"] = counts_.estops;
  out["rearms"] = counts_.rearms;
  return out;
}

void OrderDesk::stop(const std::string& source, const std::string& reason) {
  holders_.hold(source);
  ++counts_.estops;
  for (Node& node : nodes_) {
    ++node.orders.estops;
    node.orders.estop = 1;
    rtbus::set_text(node.orders.reason, plain(reason));
  }
  publish();
}

json OrderDesk::estop(const json& order) {
  const std::string reason = text_of(order, "reason");
  stop(text_of(order, "source"), reason.empty() ? "ordered" : reason);
  return state();
}

void OrderDesk::heed_device(const haptic::HapticConfig& haptic, std::uint64_t pressed_ns, std::uint64_t stopped_ns) {
  const std::string source = "button of " + haptic.name;
  if (nodes_.empty() || holders_.holds(source)) return;
  // The stage itself tells of a press whose ticks were lost. It goes on for a little after a re-arm was published.
  const bool pressed = pressed_ns > rearmed_ns_;
  const bool stopped = !holders_.any() && stopped_ns > rearmed_ns_ + (rearmed_ns_ == 0 ? 0 : kRearmTaken_ns);
  if (pressed || stopped) stop(source, source);
}

json OrderDesk::rearm(const json& order) {
  if (order.contains("source")) {
    // A program takes back its own E-stop, nobody else's.
    const std::string source = text_of(order, "source");
    if (!holders_.holds(source)) return refusal("'" + source + "' holds no E-stop");
    holders_.let_go(source);
    if (holders_.any()) {
      const std::string& other = holders_.all().front();
      return refusal("the E-stop of " + (other.empty() ? "the user" : "'" + other + "'") +
                     " still holds; `rtbus estop --rearm` ends all");
    }
  }
  holders_.clear();
  ++counts_.rearms;
  rearmed_ns_ = rtbus::monotonic_ns();
  for (Node& node : nodes_) {
    ++node.orders.rearms;
    node.orders.estop = 0;
    node.orders.reason = {};
  }
  publish();
  return state();
}

json OrderDesk::watch(const json& order) {
  const std::string source = text_of(order, "source");
  if (source.empty()) return refusal("watch needs a source, the name of who watches");
  const auto for_s = seconds_of(order, kLongestWatch_s);
  if (!for_s) return refusal("watch needs for_s, 0 to 120 s; whoever watches renews it, 0 ends it");
  if (*for_s > 0.0) {
    watches_.renew(source, rtbus::monotonic_ns() + rtbus::ns_of(*for_s));
  } else {
    watches_.end(source);
  }
  return state();
}

void OrderDesk::end_leases(std::uint64_t now_ns) {
  for (const std::string& source : watches_.take_expired(now_ns)) stop(source, source + " has ended or hangs");
  const std::vector<std::string> ended = gains_.take_expired(now_ns);
  for (const Adjustable& each : adjustables()) {
    if (std::find(ended.begin(), ended.end(), each.key) == ended.end()) continue;
    rtbus::Orders& orders = nodes_[each.node].orders;
    if (each.stiffness) {
      orders.stiffness_n_per_m = 0.0;
    } else {
      orders.damping_n_s_per_m = -1.0;
    }
  }
  if (!ended.empty()) publish();
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
  if (order.contains("for_s")) {
    const auto for_s = seconds_of(order, kLongestWatch_s);
    if (!for_s) return refusal(key + ": for_s is 0 to 120 s, after which the gain of the session file acts again");
    gains_.renew(key, rtbus::monotonic_ns() + rtbus::ns_of(*for_s));
  } else {
    gains_.end(key);
  }
  rtbus::Orders& orders = nodes_[found->node].orders;
  (found->stiffness ? orders.stiffness_n_per_m : orders.damping_n_s_per_m) = number;
  ++counts_.adjustments;
  publish();
  return state();
}

rtbus::Result<OrderDesk::Node*, std::string> OrderDesk::node_of(const json& order) {
  const std::string name = text_of(order, "node");
  std::string names;
  for (Node& node : nodes_) {
    if (node.config == nullptr) continue;  // ordered where it runs
    if (node.config->name == name) return &node;
    names += (names.empty() ? "" : ", ") + node.config->name;
  }
  return rtbus::Failure{"'" + name + "' is no haptic node of this session; `node` may be " + names};
}

json OrderDesk::clutch(const json& order) {
  const auto node = node_of(order);
  if (!node) return refusal(node.error());
  const auto until_ns = until_of(order, rtbus::monotonic_ns());
  if (!until_ns) return refusal(std::string("clutch") + kNeedsForS);
  (*node)->orders.clutched_until_ns = *until_ns;
  publish();
  return state();
}

json OrderDesk::extra_force(const json& order) {
  const auto node = node_of(order);
  if (!node) return refusal(node.error());
  const std::string& name = (*node)->config->name;
  if ((*node)->config->extra_force_max_n <= 0.0) {
    return refusal(name + " takes no force from orders; set extra_force_max_n in its haptic entry");
  }
  const auto force_n = numbers_of<3>(order, "force_n");
  if (!force_n) return refusal("extra_force needs force_n, three numbers in N along the axes of the device");
  const auto until_ns = until_of(order, rtbus::monotonic_ns());
  if (!until_ns) return refusal(std::string("extra_force") + kNeedsForS);
  const double most_n = (*node)->config->extra_force_max_n, norm_n = rtbus::vector_of(*force_n).norm();
  (*node)->orders.extra_force_n =
      norm_n <= most_n ? *force_n : rtbus::array_of(rtbus::vector_of(*force_n) * (most_n / norm_n));
  (*node)->orders.extra_force_until_ns = *until_ns;
  publish();
  return state();
}

json OrderDesk::move_body(const json& order) {
  const std::string name = text_of(order, "body");
  std::string names;
  std::size_t row = bodies_.count;
  for (std::size_t i = 0; i < bodies_.count; ++i) {
    const std::string& each = plan_.world.bodies[bodies_.body[i]].name;
    names += (names.empty() ? "" : ", ") + each;
    if (each == name) row = i;
  }
  if (row == bodies_.count) {
    return refusal("'" + name + "' is no body that orders move; " +
                   (names.empty() ? "give one `type: kinematic` and `motion: {target: {}}`" : "those are " + names));
  }
  const auto until_ns = until_of(order, rtbus::monotonic_ns());
  if (!until_ns) return refusal(std::string("target") + kNeedsForS);
  if (const auto position_m = numbers_of<3>(order, "position_m")) {
    const auto& q_WB = plan_.world.bodies[bodies_.body[row]].q_WB;
    bodies_.orientation_wxyz[row] = {q_WB.w(), q_WB.x(), q_WB.y(), q_WB.z()};
    if (order.contains("orientation_wxyz")) {
      const auto q = numbers_of<4>(order, "orientation_wxyz");
      const double norm = q ? std::hypot(std::hypot((*q)[0], (*q)[1]), std::hypot((*q)[2], (*q)[3])) : 0.0;
      if (std::abs(norm - 1.0) > 0.01) return refusal("orientation_wxyz is no unit quaternion of four numbers");
      bodies_.orientation_wxyz[row] = *q;
    }
    bodies_.position_m[row] = *position_m;
    bodies_.order[row] = static_cast<std::uint32_t>(rtbus::BodyOrder::kPose);
  } else if (const auto velocity_m_s = numbers_of<3>(order, "velocity_m_s")) {
    bodies_.velocity_m_s[row] = *velocity_m_s;
    bodies_.angular_velocity_rad_s[row] = numbers_of<3>(order, "angular_velocity_rad_s").value_or(rtbus::Vec3{});
    bodies_.order[row] = static_cast<std::uint32_t>(rtbus::BodyOrder::kTwist);
  } else {
    return refusal("target needs position_m or velocity_m_s, three numbers in the frame of the world");
  }
  bodies_.until_ns[row] = *until_ns;
  ++bodies_.orders;
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
  if (name == "rearm") return rearm(order);
  if (name == "watch") return watch(order);
  if (name == "adjust") return adjust(order);
  if (name == "clutch") return clutch(order);
  if (name == "extra_force") return extra_force(order);
  if (name == "target") return move_body(order);
  if (name == "mark") return mark(order);
  if (name == "record") return record(order);
  if (name == "end_recording") return recording_.stop() ? state() : refusal("this session is not being recorded");
  if (name == "state") return state();
  return refusal("'" + name +
                 "' is no order; there are estop, rearm, watch, adjust, clutch, extra_force, target, mark, record, "
                 "end_recording and state");
}

}  // namespace tools
