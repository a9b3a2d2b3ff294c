// What others on DDS may send to the bridge: bytes that Cyclone DDS decodes and the bridge's rules judge. Records of a
// topic and an author, of the time since the one before, of a length, and of so many bytes of CDR with their header.
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <memory>
#include <nlohmann/json.hpp>
#include <span>
#include <string>
#include <thread>
#include <vector>

#include <ros2_messages.h>
#include "rtbus/clock.hpp"
#include "tests/fuzz/bridge_cdr.h"
#include "tools/bridge/foreign_orders.hpp"
#include "tools/bridge/frames.hpp"
#include "tools/bridge/messages.hpp"
#include "tools/bridge/stop_orders.hpp"
#include "tools/cli/orders/order_socket.hpp"

namespace {

void require(bool condition) {
  if (!condition) std::abort();
}

constexpr std::uint64_t kGap_ns = 20 * rtbus::kNsPerMs;
constexpr const char* kSession = "fuzz-bridge";

bridge::BridgeConfig config() {
  bridge::BridgeConfig out;
  out.domain = 97;
  // Nobody else on this domain has these topics, also not the same fuzzer beside this one.
  out.space = "/fuzz" + std::to_string(::getpid());
  out.orders.estop_timeout_s = 0.5;
  out.orders.enable_timeout_s = 0.5;
  out.orders.marks_per_s = 10.0;
  out.orders.clutch_timeout_s = out.orders.extra_wrench_timeout_s = 0.5;
  out.orders.clutch = out.orders.takes_extra_force = {"haptic0"};
  out.orders.targets.push_back({"plate", 0.5});
  out.orders.adjust.push_back({"haptic0.coupling.stiffness_n_per_m", "adjust/stiffness", 50.0, 400.0, 200.0, 1.0});
  return out;
}

/// In place of `rtbus run`: takes every order, and holds each against what the bridge promises.
class Desk {
 public:
  Desk() {
    auto opened = tools::OrderSocket::open(kSession, [this](const nlohmann::json& order) { return answer(order); });
    require(static_cast<bool>(opened));
    socket_ = std::move(*opened);
    std::thread([this] {
      while (socket_->serve(rtbus::kNsPerS)) {
      }
    }).detach();
  }
  [[nodiscard]] int estops() const { return estops_; }

 private:
  nlohmann::json answer(const nlohmann::json& order) {
    const std::string name = order.at("order");
    if (name == "estop") ++estops_;
    if (name == "adjust") {
      const double value = order.at("value");
      require(value >= 50.0 && value <= 400.0);
    }
    if (order.contains("for_s")) {
      const double for_s = order.at("for_s");
      require(for_s >= 0.0 && for_s <= 2.0);
    }
    if (name == "extra_force") {
      for (const double each : order.at("force_n")) require(std::isfinite(each));
    }
    if (name == "rearm") require(order.contains("source"));
    return {{"ok", true}};
  }
  std::unique_ptr<tools::OrderSocket> socket_;
  std::atomic<int> estops_{0};
};

struct Bridge {
  bridge::BridgeConfig settings = config();
  Desk desk;
  bridge::OrderCounts counts;
  rtbus::Result<bridge::Participant, std::string> participant =
      bridge::Participant::open(settings.domain, settings.network);
  std::unique_ptr<bridge::StopOrders> stops;
  std::unique_ptr<bridge::ForeignOrders> orders;
  std::vector<foreign_topic> topics;  ///< The first is `estop`.

  Bridge() {
    require(static_cast<bool>(participant));
    const std_msgs_msg_dds__Bool_ no{false};
    const std_msgs_msg_dds__Float64_ number{100.0};
    char text[] = "text";
    const std_msgs_msg_dds__String_ words{text};
    const std::string base = bridge::base_frame("haptic0"), world = bridge::kWorld;
    const bridge::WrenchStamped wrench = bridge::wrench_of(bridge::header_of({}, base), {});
    const bridge::PoseStamped pose = bridge::pose_of(bridge::header_of({}, world), {}, {1, 0, 0, 0});
    const bridge::TwistStamped twist = bridge::twist_of(bridge::header_of({}, world), {}, {});
    const auto open = [&](const char* name, const bridge::MessageType& type, const void* example) {
      const std::string full = "rt" + settings.order_topic(name);
      topics.emplace_back();
      require(foreign_topic_open(participant->entity(), full.c_str(), type.descriptor, example, &topics.back()) == 1);
    };
    open("estop", bridge::kBool, &no);
    open("enable", bridge::kBool, &no);
    open("mark", bridge::kString, &words);
    open("adjust/stiffness", bridge::kFloat64, &number);
    open("haptic0/clutch", bridge::kBool, &no);
    open("haptic0/extra_wrench", bridge::kWrenchStamped, &wrench);
    open("body/plate/target_pose", bridge::kPoseStamped, &pose);
    open("body/plate/target_twist", bridge::kTwistStamped, &twist);
    auto stopping = bridge::StopOrders::open(*participant, settings, kSession, counts);
    auto others = bridge::ForeignOrders::open(*participant, settings, kSession, counts);
    require(stopping && others);
    stops = std::move(*stopping);
    orders = std::move(*others);
  }
  void look(std::uint64_t now_ns) {
    stops->look(now_ns);
    orders->look(now_ns);
  }
};

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static Bridge& all = *new Bridge;  // its desk has a thread to the end
  static std::uint64_t now_ns = 1000 * rtbus::kNsPerS;
  std::span<const std::uint8_t> rest(data, size);
  for (int records = 0; rest.size() >= 3 && records < 64; ++records) {
    const std::size_t topic = (rest[0] & 0x7f) % all.topics.size();
    const int author = rest[0] >> 7;
    now_ns += kGap_ns * rest[1];
    const std::size_t length = std::min<std::size_t>(rest[2], rest.size() - 3);
    (void)foreign_topic_write(&all.topics[topic], author, rest.data() + 3, length);
    all.look(now_ns);
    rest = rest.subspan(3 + length);
  }
  // Whatever came before: an E-stop is heard, and ordered.
  now_ns += 10 * rtbus::kNsPerS;
  all.look(now_ns);
  const int before = all.desk.estops();
  now_ns += 10 * rtbus::kNsPerS;
  const std::uint8_t stop[] = {0, 1, 0, 0, 1};
  require(foreign_topic_write(&all.topics[0], 1, stop, sizeof stop) == 1);
  all.look(now_ns);
  require(all.desk.estops() == before + 1);
  return 0;
}
