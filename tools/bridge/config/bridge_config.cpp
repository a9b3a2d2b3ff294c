#include "tools/bridge/config/bridge_config.hpp"

#include <algorithm>
#include <cctype>

namespace bridge {

namespace {

using rtbus::config::Map;

constexpr rtbus::config::Range kHoldTimeout_s{0.05, 1.0};  // a node holds neither for longer
constexpr std::size_t kLongestName = 200;                  // ROS 2 allows 247, with our prefixes

/// A name by ROS 2's rules: tokens of letters, digits and '_', none beginning with a digit, joined by single slashes.
bool valid_name(std::string_view name) {
  if (name.empty() || name.size() > kLongestName) return false;
  bool begins = true;
  for (const char c : name) {
    const auto letter = static_cast<unsigned char>(c);
    if (c == '/') {
      if (begins) return false;
      begins = true;
      continue;
    }
    if (std::isalnum(letter) == 0 && c != '_') return false;
    if (begins && std::isdigit(letter) != 0) return false;
    begins = false;
  }
  return !begins;
}

std::string read_namespace(Map& map) {
  const std::string space = map.text("namespace", "");
  if (space.empty()) return "";
  if (space.front() != '/' || !valid_name(std::string_view(space).substr(1))) {
    map.fail("namespace", "is not a ROS 2 namespace; write it like /lab: letters, digits and '_' behind each slash");
  }
  return space;
}

std::array<StreamConfig, kStreams> read_streams(Map& map) {
  std::array<StreamConfig, kStreams> out;
  std::optional<Map> publish = map.optional_map("publish");
  for (std::size_t i = 0; i < kStreams; ++i) {
    const StreamRow& row = kStreamRows[i];
    StreamConfig& stream = out[i];
    stream = {!publish, row.rate_hz, true, std::string(row.topic)};
    if (!publish) continue;
    std::optional<Map> entry = publish->optional_map(row.key);
    if (!entry) continue;
    stream.on = true;
    stream.rate_hz = entry->number("rate_hz", {0.1, 1000.0}, row.rate_hz);
    stream.reliable = entry->boolean("reliable", true);
    if (!row.topic.starts_with('/')) {
      stream.topic = entry->text("topic", row.topic);
      if (!valid_name(stream.topic)) {
        entry->fail("topic", "is not a ROS 2 name; use letters, digits and '_', for example hand/pose");
      }
    }
    entry->finish();
  }
  if (publish) {
    publish->finish();
    for (std::size_t i = 0; i < kStreams; ++i) {
      for (std::size_t k = 0; k < i; ++k) {
        if (out[i].on && out[k].on && out[i].topic == out[k].topic) {
          publish->fail(kStreamRows[i].key,
                        "has the topic of " + std::string(kStreamRows[k].key) + "; give one of them another `topic`");
        }
      }
    }
  }
  return out;
}

AdjustOrder read_adjust(Map& map, const std::vector<haptic::HapticConfig>& haptic) {
  AdjustOrder out;
  out.key = map.text("key");
  double most = 0.0, least = 0.0;
  bool found = false;
  std::string known;
  for (const haptic::HapticConfig& node : haptic) {
    const auto offer = [&](bool adjustable, const char* gain, double now, double lower, double upper) {
      const std::string key = node.name + gain;
      if (!adjustable) return;
      known += (known.empty() ? "" : ", ") + key;
      if (key != out.key) return;
      found = true;
      out.initial = now;
      least = lower;
      most = upper;
    };
    offer(node.adjustable_stiffness, ".coupling.stiffness_n_per_m", node.stiffness_n_per_m, 1.0,
          node.gain_limits.stiffness_max_n_per_m);
    offer(node.adjustable_damping, ".coupling.damping_n_s_per_m", node.damping_n_s_per_m, 0.0,
          node.gain_limits.damping_max_n_s_per_m);
  }
  if (!found) {
    map.fail("key", known.empty() ? "may not be adjusted; name the gain in `adjustable` of its haptic entry first"
                                  : "may not be adjusted; choose one of " + known);
  }
  out.least = map.number("least", {least, most}, least);
  out.most = map.number("most", {out.least, most}, most);
  out.timeout_s = map.number("timeout_s", {0.1, 60.0}, out.timeout_s);
  map.finish();
  out.topic = "adjust/" + out.key;
  std::replace(out.topic.begin(), out.topic.end(), '.', '/');
  return out;
}

OrdersConfig read_orders(Map& map, const std::vector<haptic::HapticConfig>& haptic, const rtbus::config::Scene& scene) {
  OrdersConfig out;
  std::optional<Map> orders = map.optional_map("orders");
  if (!orders) return out;
  if (std::optional<Map> estop = orders->optional_map("estop")) {
    out.estop_timeout_s = estop->number("timeout_s", {0.1, 60.0}, 1.0);
    estop->finish();
  }
  if (std::optional<Map> enable = orders->optional_map("enable")) {
    out.enable_timeout_s = enable->number("timeout_s", {0.1, 60.0}, 0.5);
    enable->finish();
  }
  if (std::optional<Map> mark = orders->optional_map("mark")) {
    out.marks_per_s = mark->number("per_s", {0.1, 100.0}, 5.0);
    mark->finish();
  }
  if (std::optional<Map> clutch = orders->optional_map("clutch")) {
    out.clutch_timeout_s = clutch->number("timeout_s", kHoldTimeout_s, 0.5);
    for (const haptic::HapticConfig& node : haptic) out.clutch.push_back(node.name);
    clutch->finish();
  }
  if (std::optional<Map> wrench = orders->optional_map("extra_wrench")) {
    out.extra_wrench_timeout_s = wrench->number("timeout_s", kHoldTimeout_s, 0.2);
    for (const haptic::HapticConfig& node : haptic) {
      if (node.extra_force_max_n > 0.0) out.takes_extra_force.push_back(node.name);
    }
    if (out.takes_extra_force.empty()) {
      orders->fail("extra_wrench", "needs a haptic entry that allows it; write extra_force_max_n: 1 there");
    }
    wrench->finish();
  }
  for (Map& entry : orders->list_of_maps("adjust")) {
    AdjustOrder order = read_adjust(entry, haptic);
    for (const AdjustOrder& other : out.adjust) {
      if (other.key == order.key) entry.fail("key", "stands in `adjust` twice; leave one");
    }
    out.adjust.push_back(std::move(order));
  }
  for (Map& entry : orders->list_of_maps("target")) {
    TargetOrder target{entry.text("body"), entry.number("timeout_s", kHoldTimeout_s, 0.5)};
    std::string known;
    bool found = false;
    for (const std::size_t index : rtbus::config::bodies_that_orders_move(scene)) {
      const std::string& name = scene.bodies[index].name;
      known += (known.empty() ? "" : ", ") + name;
      found = found || name == target.body;
    }
    if (!found) {
      entry.fail("body", known.empty()
                             ? "is no body that orders move; give one type: kinematic and motion: {target: {}}"
                             : "is no body that orders move; choose one of " + known);
    }
    if (!valid_name(target.body)) entry.fail("body", "has no name that ROS 2 takes; use letters, digits and '_'");
    entry.finish();
    out.targets.push_back(std::move(target));
  }
  orders->finish();
  return out;
}

}  // namespace

std::string BridgeConfig::topic(Stream stream, const std::string& node) const {
  const std::string& name = of(stream).topic;
  return name.starts_with('/') ? name : space + "/" + node + "/" + name;
}

BridgeConfig read_bridge_config(rtbus::config::SessionConfig& session,
                                const std::vector<haptic::HapticConfig>& haptic) {
  BridgeConfig out;
  if (!session.bridge) {
    for (std::size_t i = 0; i < kStreams; ++i) {
      out.streams[i] = {true, kStreamRows[i].rate_hz, true, std::string(kStreamRows[i].topic)};
    }
    return out;
  }
  Map& map = *session.bridge;
  out.domain = static_cast<int>(map.integer("domain", 0, 232, out.domain));
  out.network = map.text("network", out.network);
  const bool plain = std::all_of(out.network.begin(), out.network.end(), [](char c) {
    return std::isalnum(static_cast<unsigned char>(c)) != 0 || c == '_' || c == '-' || c == '.';
  });
  if (out.network.empty() || out.network.size() > 15 || !plain) {
    map.fail("network", "is no name of a network interface; `ip link` lists them; lo: this machine alone");
  }
  out.peers = map.texts("peers");
  for (const std::string& peer : out.peers) {
    const bool host = !peer.empty() && peer.size() <= 253 && std::all_of(peer.begin(), peer.end(), [](char c) {
      return std::isalnum(static_cast<unsigned char>(c)) != 0 || c == '-' || c == '.' || c == ':';
    });
    if (!host) map.fail("peers", "holds '" + peer + "', which is no host; write names or addresses: [192.168.7.2]");
  }
  out.space = read_namespace(map);
  out.streams = read_streams(map);
  out.orders = read_orders(map, haptic, session.scene);
  map.finish();
  return out;
}

}  // namespace bridge
