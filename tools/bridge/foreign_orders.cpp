#include "tools/bridge/foreign_orders.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <nlohmann/json.hpp>
#include <optional>
#include <utility>
#include <vector>

#include <ros2_messages.h>
#include "rtbus/clock.hpp"
#include "rtbus/realtime.hpp"
#include "tools/bridge/frames.hpp"
#include "tools/bridge/messages.hpp"
#include "tools/bridge/order_rules.hpp"

namespace bridge {

namespace {

constexpr double kOrders_per_s = 50.0;  // of one topic

using Force = std::array<double, 3>;

}  // namespace

struct ForeignOrders::Topics {
  struct Gain {
    AdjustOrder order;
    DdsReader reader;
    AdjustRule rule;
    Pace pace{kOrders_per_s};
    std::optional<double> carried_out{};
    std::uint64_t renewed_ns = 0;
  };
  struct Marks {
    DdsReader reader;
    MarkRule rule;
  };
  template <class Value>
  struct Held {
    std::string node;
    DdsReader reader;
    HeldRule<Value> rule;
    Pace pace{kOrders_per_s};
  };
  std::optional<Marks> marks;
  std::vector<Gain> gains;
  std::vector<Held<bool>> clutches;
  std::vector<Held<Force>> extra_forces;
  struct Target {
    std::string body;
    DdsReader pose, twist;
    HeldRule<nlohmann::json> rule;  ///< Of both topics: the newest counts.
    Pace pace{kOrders_per_s};
  };
  std::vector<Target> targets;
};

rtbus::Result<std::unique_ptr<ForeignOrders>, std::string> ForeignOrders::open(Participant& participant,
                                                                               const BridgeConfig& config,
                                                                               const std::string& session,
                                                                               OrderCounts& counts) {
  auto topics = std::make_unique<Topics>();
  std::string problem;
  bool any = false;
  const auto reader = [&](const std::string& name, const MessageType& type) {
    auto made = participant.reader(config.order_topic(name), type);
    if (!made) problem = made.error();
    any = true;
    return made;
  };
  if (const auto per_s = config.orders.marks_per_s) {
    if (auto made = reader("mark", kString)) topics->marks.emplace(Topics::Marks{*made, MarkRule(*per_s)});
  }
  for (const AdjustOrder& order : config.orders.adjust) {
    if (auto made = reader(order.topic, kFloat64)) {
      topics->gains.push_back({order, *made, AdjustRule(order.least, order.most, order.timeout_s)});
    }
  }
  for (const std::string& node : config.orders.clutch) {
    if (auto made = reader(node + "/clutch", kBool)) {
      topics->clutches.push_back({node, *made, HeldRule<bool>(*config.orders.clutch_timeout_s)});
    }
  }
  for (const std::string& node : config.orders.takes_extra_force) {
    if (auto made = reader(node + "/extra_wrench", kWrenchStamped)) {
      topics->extra_forces.push_back({node, *made, HeldRule<Force>(*config.orders.extra_wrench_timeout_s)});
    }
  }
  for (const TargetOrder& order : config.orders.targets) {
    auto pose = reader("body/" + order.body + "/target_pose", kPoseStamped);
    auto twist = reader("body/" + order.body + "/target_twist", kTwistStamped);
    if (pose && twist) {
      topics->targets.push_back({order.body, *pose, *twist, HeldRule<nlohmann::json>(order.timeout_s)});
    }
  }
  if (!problem.empty()) return rtbus::Failure{problem};
  if (!any) return std::unique_ptr<ForeignOrders>();
  return std::unique_ptr<ForeignOrders>(new ForeignOrders(std::move(topics), session, counts));
}

ForeignOrders::ForeignOrders(std::unique_ptr<Topics> topics, const std::string& session, OrderCounts& counts)
    : topics_(std::move(topics)), line_(session, counts) {}

void ForeignOrders::start() {
  thread_ = std::thread([this] { work(); });
}

ForeignOrders::~ForeignOrders() {
  ends_ = true;
  if (thread_.joinable()) thread_.join();
}

void ForeignOrders::work() {
  rtbus::name_this_thread("orders");
  while (!ends_) {
    const std::uint64_t now_ns = rtbus::monotonic_ns();
    look(now_ns);
    rtbus::sleep_until(now_ns + kLook_ns);
  }
}

void ForeignOrders::look(std::uint64_t now_ns) {
  follow_clutches(now_ns);
  follow_extra_forces(now_ns);
  follow_targets(now_ns);
  follow_adjustments(now_ns);
  follow_marks(now_ns);
}

void ForeignOrders::count(bool refused) {
  if (refused) ++line_.counts().refused;
}

void ForeignOrders::follow_marks(std::uint64_t now_ns) {
  if (!topics_->marks) return;
  auto& [reader, rule] = *topics_->marks;
  std::vector<std::string> texts;
  reader.drain<std_msgs_msg_dds__String_>([&, &judge = rule](const std_msgs_msg_dds__String_& message, Author author) {
    const bool taken = judge.hears(author, now_ns) == Verdict::kOrder;
    if (taken) texts.push_back(printable(message.data));
    count(!taken);
  });
  for (const std::string& text : texts) (void)line_.send("ROS 2 topic mark", {{"order", "mark"}, {"text", text}});
}

void ForeignOrders::follow_adjustments(std::uint64_t now_ns) {
  for (Topics::Gain& gain : topics_->gains) {
    gain.reader.drain<std_msgs_msg_dds__Float64_>([&](const std_msgs_msg_dds__Float64_& message, Author author) {
      count(gain.rule.hears(message.data, author, now_ns) == Verdict::kRefused);
    });
    gain.rule.end_by_silence(now_ns);
    const std::optional<double> wanted = gain.rule.wanted();
    const bool renews = wanted && now_ns >= gain.renewed_ns + kRenew_ns;
    if ((wanted == gain.carried_out && !renews) || !gain.pace.allows(now_ns)) continue;
    nlohmann::json order{{"order", "adjust"}, {"key", gain.order.key}, {"value", wanted.value_or(gain.order.initial)}};
    if (wanted) order["for_s"] = gain.order.timeout_s + kLeaseMargin_s;
    if (!line_.send("ROS 2 topic " + gain.order.topic, order)) continue;
    gain.carried_out = wanted;
    gain.renewed_ns = now_ns;
  }
}

void ForeignOrders::follow_clutches(std::uint64_t now_ns) {
  for (auto& each : topics_->clutches) {
    each.reader.drain<std_msgs_msg_dds__Bool_>([&](const std_msgs_msg_dds__Bool_& message, Author author) {
      count(each.rule.hears(message.data, author, now_ns) == Verdict::kRefused);
    });
    each.rule.end_by_silence(now_ns);
    if (!each.pace.allows(now_ns)) continue;
    if (const auto pressed = each.rule.take()) {
      const double for_s = *pressed ? each.rule.holds_for_s(now_ns) : 0.0;
      (void)line_.send("ROS 2 topic " + each.node + "/clutch",
                       {{"order", "clutch"}, {"node", each.node}, {"for_s", for_s}});
    }
  }
}

void ForeignOrders::follow_extra_forces(std::uint64_t now_ns) {
  for (auto& each : topics_->extra_forces) {
    each.reader.drain<WrenchStamped>([&](const WrenchStamped& message, Author author) {
      const std::string_view frame = message.header.frame_id != nullptr ? message.header.frame_id : "";
      const auto& force = message.wrench.force;
      const bool sane = std::isfinite(force.x) && std::isfinite(force.y) && std::isfinite(force.z);
      // In another frame it would push elsewhere.
      const bool taken = sane && frame == base_frame(each.node) &&
                         each.rule.hears({force.x, force.y, force.z}, author, now_ns) == Verdict::kOrder;
      count(!taken);
    });
    each.rule.end_by_silence(now_ns);
    if (!each.pace.allows(now_ns)) continue;
    if (const auto force_n = each.rule.take()) {
      (void)line_.send("ROS 2 topic " + each.node + "/extra_wrench", {{"order", "extra_force"},
                                                                      {"node", each.node},
                                                                      {"force_n", *force_n},
                                                                      {"for_s", each.rule.holds_for_s(now_ns)}});
    }
  }
}

void ForeignOrders::follow_targets(std::uint64_t now_ns) {
  for (auto& each : topics_->targets) {
    const auto take = [&](const Header& header, const nlohmann::json& order, Author author) {
      const std::string_view frame = header.frame_id != nullptr ? header.frame_id : "";
      // Our own frame: numbers in that of REP 103 would go elsewhere.
      const bool taken = frame == kWorld && each.rule.hears(order, author, now_ns) == Verdict::kOrder;
      count(!taken);
    };
    each.pose.drain<PoseStamped>([&](const PoseStamped& message, Author author) {
      const auto& [p, q] = message.pose;
      take(message.header, {{"position_m", {p.x, p.y, p.z}}, {"orientation_wxyz", {q.w, q.x, q.y, q.z}}}, author);
    });
    each.twist.drain<TwistStamped>([&](const TwistStamped& message, Author author) {
      const auto& [v, w] = message.twist;
      take(message.header, {{"velocity_m_s", {v.x, v.y, v.z}}, {"angular_velocity_rad_s", {w.x, w.y, w.z}}}, author);
    });
    each.rule.end_by_silence(now_ns);
    if (!each.pace.allows(now_ns)) continue;
    if (auto order = each.rule.take()) {
      (*order)["order"] = "target";
      (*order)["body"] = each.body;
      (*order)["for_s"] = each.rule.holds_for_s(now_ns);
      (void)line_.send("ROS 2 topics body/" + each.body + "/target_…", *order);
    }
  }
}

}  // namespace bridge
