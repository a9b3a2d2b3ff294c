#include "tools/bridge/stop_orders.hpp"

#include <cstdio>

#include <ros2_messages.h>
#include "rtbus/clock.hpp"
#include "rtbus/realtime.hpp"
#include "tools/cli/orders/emergency_stop.hpp"

namespace bridge {

namespace {

constexpr int kStopDepth = 1000;  // a beat at 1 kHz overwrites no E-stop of somebody else for a second

}  // namespace

void StopWish::follow(OrderLine& line, std::uint64_t now_ns) {
  if (why_.empty() || !tries_.allows(now_ns)) return;
  const auto done = tools::emergency_stop(line.session(), why_, source_);
  std::fprintf(stderr, "rtbus bridge: %s: %s\n", why_.c_str(), done ? done->c_str() : done.error().c_str());
  ++(done ? line.counts().carried_out : line.counts().refused);
  if (done) why_.clear();
}

void StopWish::watch(OrderLine& line, double for_s, std::uint64_t now_ns) {
  if (for_s <= 0.0 && !watched_) return;
  if (for_s > 0.0 && watched_ && now_ns < renewed_ns_ + kRenew_ns) return;
  const double lease_s = for_s > 0.0 ? for_s + kLeaseMargin_s : 0.0;
  if (!line.send(source_, {{"order", "watch"}, {"source", source_}, {"for_s", lease_s}})) return;
  watched_ = for_s > 0.0;
  renewed_ns_ = now_ns;
}

rtbus::Result<std::unique_ptr<StopOrders>, std::string> StopOrders::open(Participant& participant,
                                                                         const BridgeConfig& config,
                                                                         const std::string& session,
                                                                         OrderCounts& counts) {
  std::unique_ptr<StopOrders> out(new StopOrders(session, counts));
  if (const auto timeout_s = config.orders.estop_timeout_s) {
    auto made = participant.reader(config.order_topic("estop"), kBool, true, kStopDepth);
    if (!made) return rtbus::Failure{made.error()};
    out->estop_topic_ = *made;
    out->estop_.emplace(*timeout_s);
  }
  if (const auto timeout_s = config.orders.enable_timeout_s) {
    auto made = participant.reader(config.order_topic("enable"), kBool, true, kStopDepth);
    if (!made) return rtbus::Failure{made.error()};
    out->enable_topic_ = *made;
    out->enable_.emplace(*timeout_s);
  }
  if (!out->estop_ && !out->enable_) return std::unique_ptr<StopOrders>();
  return out;
}

void StopOrders::start() {
  thread_ = std::thread([this] { work(); });
}

StopOrders::~StopOrders() {
  ends_ = true;
  if (thread_.joinable()) thread_.join();
}

void StopOrders::work() {
  rtbus::name_this_thread("stop_orders");
  (void)rtbus::prefer_on_time();
  while (!ends_) {
    const std::uint64_t now_ns = rtbus::monotonic_ns();
    look(now_ns);
    rtbus::sleep_until(now_ns + kLook_ns);
  }
}

void StopOrders::look(std::uint64_t now_ns) {
  if (estop_) follow_estop(now_ns);
  if (enable_) follow_enable(now_ns);
}

void StopOrders::follow_estop(std::uint64_t now_ns) {
  estop_topic_->drain<std_msgs_msg_dds__Bool_>([&](const std_msgs_msg_dds__Bool_& message, Author author) {
    const Verdict verdict = estop_->hears(message.data, author, now_ns);
    if (verdict == Verdict::kRefused) ++line_.counts().refused;
    if (verdict == Verdict::kOrder) estop_wish_.want(estop_wish_.source());
  });
  if (estop_->stops_by_silence(now_ns)) estop_wish_.want(estop_wish_.source() + ": who sent false is silent");
  estop_wish_.follow(line_, now_ns);
  estop_wish_.watch(line_, estop_->watched_for_s(now_ns), now_ns);
}

void StopOrders::follow_enable(std::uint64_t now_ns) {
  bool rearm = false;
  enable_topic_->drain<std_msgs_msg_dds__Bool_>([&](const std_msgs_msg_dds__Bool_& message, Author author) {
    const Verdict verdict = enable_->hears(message.data, author, now_ns);
    if (verdict == Verdict::kRefused) ++line_.counts().refused;
    if (verdict == Verdict::kOrder) enable_wish_.want(enable_wish_.source() + ": false");
    if (verdict == Verdict::kOrder || verdict == Verdict::kRearm) rearm = verdict == Verdict::kRearm;
  });
  if (enable_->stops_by_silence(now_ns)) {
    rearm = false;
    enable_wish_.want(enable_wish_.source() + ": its owner is silent");
  }
  if (rearm) {
    enable_wish_.drop();
    (void)line_.send(enable_wish_.source(), {{"order", "rearm"}, {"source", enable_wish_.source()}});
  }
  enable_wish_.follow(line_, now_ns);
  enable_wish_.watch(line_, enable_->watched_for_s(now_ns), now_ns);
}

}  // namespace bridge
