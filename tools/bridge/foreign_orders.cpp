#include "tools/bridge/foreign_orders.hpp"

#include <cstdio>
#include <nlohmann/json.hpp>
#include <optional>
#include <utility>
#include <vector>

#include <ros2_messages.h>
#include "rtbus/clock.hpp"
#include "rtbus/realtime.hpp"
#include "tools/bridge/order_rules.hpp"
#include "tools/cli/orders/emergency_stop.hpp"
#include "tools/cli/orders/order_socket.hpp"

namespace bridge {

namespace {

constexpr std::uint64_t kLook_ns = 10 * rtbus::kNsPerMs;
constexpr double kPatience_s = 0.3;
constexpr double kAdjustments_per_s = 20.0;

template <class Rule>
struct Heard {
  DdsReader reader;
  Rule rule;
};

}  // namespace

struct ForeignOrders::Topics {
  struct Gain {
    AdjustOrder order;
    DdsReader reader;
    AdjustRule rule;
    Pace pace{kAdjustments_per_s};
  };
  std::optional<Heard<EstopRule>> estop;
  std::optional<Heard<EnableRule>> enable;
  std::optional<Heard<MarkRule>> mark;
  std::vector<Gain> gains;
};

rtbus::Result<std::unique_ptr<ForeignOrders>, std::string> ForeignOrders::open(Participant& participant,
                                                                               const BridgeConfig& config,
                                                                               const std::string& session) {
  if (!config.orders.any()) return std::unique_ptr<ForeignOrders>();
  auto topics = std::make_unique<Topics>();
  std::string problem;
  const auto reader = [&](const std::string& name, const MessageType& type) {
    auto made = participant.reader(config.order_topic(name), type);
    if (!made) problem = made.error();
    return made;
  };
  if (const auto timeout_s = config.orders.estop_timeout_s) {
    if (auto made = reader("estop", kBool)) topics->estop.emplace(Heard<EstopRule>{*made, EstopRule(*timeout_s)});
  }
  if (const auto timeout_s = config.orders.enable_timeout_s) {
    if (auto made = reader("enable", kBool)) topics->enable.emplace(Heard<EnableRule>{*made, EnableRule(*timeout_s)});
  }
  if (const auto per_s = config.orders.marks_per_s) {
    if (auto made = reader("mark", kString)) topics->mark.emplace(Heard<MarkRule>{*made, MarkRule(*per_s)});
  }
  for (const AdjustOrder& order : config.orders.adjust) {
    if (auto made = reader(order.topic, kFloat64)) {
      topics->gains.push_back({order, *made, AdjustRule(order.least, order.most, order.timeout_s)});
    }
  }
  if (!problem.empty()) return rtbus::Failure{problem};
  return std::unique_ptr<ForeignOrders>(new ForeignOrders(std::move(topics), session));
}

ForeignOrders::ForeignOrders(std::unique_ptr<Topics> topics, std::string session)
    : topics_(std::move(topics)), session_(std::move(session)) {}

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
  follow_estop(now_ns);
  follow_enable(now_ns);
  follow_adjustments(now_ns);
  follow_marks(now_ns);
}

void ForeignOrders::stop(const std::string& why) {
  const auto done = tools::emergency_stop(session_, why);
  std::fprintf(stderr, "rtbus bridge: %s: %s\n", why.c_str(), done ? done->c_str() : done.error().c_str());
  ++(done ? carried_out_ : refused_);
}

bool ForeignOrders::send(const std::string& what, const std::string& order) {
  const auto answer = tools::send_order(session_, nlohmann::json::parse(order), kPatience_s);
  const bool done = answer && answer->value("ok", false);
  if (!done) {
    const std::string why = answer ? answer->value("error", "refused") : answer.error();
    std::fprintf(stderr, "rtbus bridge: %s: %s\n", what.c_str(), why.c_str());
  }
  ++(done ? carried_out_ : refused_);
  return done;
}

void ForeignOrders::follow_estop(std::uint64_t now_ns) {
  if (!topics_->estop) return;
  auto& [reader, rule] = *topics_->estop;
  bool ordered = false;
  reader.drain<std_msgs_msg_dds__Bool_>([&, &judge = rule](const std_msgs_msg_dds__Bool_& message, Author author) {
    const Verdict verdict = judge.hears(message.data, author, now_ns);
    if (verdict == Verdict::kRefused) ++refused_;
    ordered = ordered || verdict == Verdict::kOrder;
  });
  if (ordered) stop("ROS 2 topic estop");
  if (rule.stops_by_silence(now_ns)) stop("ROS 2 topic estop: who sent false is silent");
}

void ForeignOrders::follow_enable(std::uint64_t now_ns) {
  if (!topics_->enable) return;
  auto& [reader, rule] = *topics_->enable;
  Verdict last = Verdict::kNothing;
  reader.drain<std_msgs_msg_dds__Bool_>([&, &judge = rule](const std_msgs_msg_dds__Bool_& message, Author author) {
    const Verdict verdict = judge.hears(message.data, author, now_ns);
    if (verdict == Verdict::kRefused) ++refused_;
    if (verdict == Verdict::kOrder || verdict == Verdict::kRearm) last = verdict;
  });
  if (last == Verdict::kOrder) stop("ROS 2 topic enable: false");
  if (last == Verdict::kRearm) (void)send("ROS 2 topic enable", R"({"order": "rearm"})");
  if (rule.stops_by_silence(now_ns)) stop("ROS 2 topic enable: its owner is silent");
}

void ForeignOrders::follow_marks(std::uint64_t now_ns) {
  if (!topics_->mark) return;
  auto& [reader, rule] = *topics_->mark;
  std::vector<std::string> texts;
  reader.drain<std_msgs_msg_dds__String_>([&, &judge = rule](const std_msgs_msg_dds__String_& message, Author author) {
    if (judge.hears(author, now_ns) == Verdict::kOrder) {
      texts.push_back(printable(message.data));
    } else {
      ++refused_;
    }
  });
  for (const std::string& text : texts) {
    (void)send("ROS 2 topic mark", nlohmann::json{{"order", "mark"}, {"text", text}}.dump());
  }
}

void ForeignOrders::follow_adjustments(std::uint64_t now_ns) {
  for (Topics::Gain& gain : topics_->gains) {
    std::optional<double> wanted;
    gain.reader.drain<std_msgs_msg_dds__Float64_>([&](const std_msgs_msg_dds__Float64_& message, Author author) {
      double value = message.data;
      const Verdict verdict = gain.rule.hears(value, author, now_ns);
      if (verdict == Verdict::kRefused) ++refused_;
      if (verdict == Verdict::kOrder) wanted = value;
      if (verdict == Verdict::kNothing) wanted.reset();
    });
    const auto adjust = [&](double value) {
      const nlohmann::json order{{"order", "adjust"}, {"key", gain.order.key}, {"value", value}};
      return send("ROS 2 topic " + gain.order.topic, order.dump());
    };
    if (wanted && gain.pace.allows(now_ns) && adjust(*wanted)) gain.rule.carried_out(*wanted);
    if (gain.rule.ends_by_silence(now_ns)) (void)adjust(gain.order.initial);
  }
}

}  // namespace bridge
