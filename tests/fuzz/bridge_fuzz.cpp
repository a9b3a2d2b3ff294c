// What others on DDS may send to the bridge: bytes that Cyclone DDS decodes and the bridge's rules judge. Records of a
// topic and an author, of the time since the one before, of a length, and of so many bytes of CDR with their header.
#include <unistd.h>

#include <algorithm>
#include <cstdint>
#include <cstdlib>
#include <span>
#include <string>

#include <ros2_messages.h>
#include "rtbus/clock.hpp"
#include "tests/fuzz/bridge_cdr.h"
#include "tools/bridge/foreign_orders.hpp"

namespace {

void require(bool condition) {
  if (!condition) std::abort();
}

constexpr int kTopics = 4;
constexpr std::uint64_t kGap_ns = 20 * rtbus::kNsPerMs;

bridge::BridgeConfig config() {
  bridge::BridgeConfig out;
  out.domain = 97;
  // Nobody else on this domain has these topics, also not the same fuzzer beside this one.
  out.space = "/fuzz" + std::to_string(::getpid());
  out.orders.estop_timeout_s = 0.5;
  out.orders.enable_timeout_s = 0.5;
  out.orders.marks_per_s = 10.0;
  out.orders.adjust.push_back({"haptic0.coupling.stiffness_n_per_m", "adjust/stiffness", 50.0, 400.0, 200.0, 1.0});
  return out;
}

/// No session has that name: an order ends at its socket, which is not there.
struct Bridge {
  bridge::BridgeConfig settings = config();
  rtbus::Result<bridge::Participant, std::string> participant =
      bridge::Participant::open(settings.domain, settings.network);
  std::unique_ptr<bridge::ForeignOrders> orders;
  foreign_topic topics[kTopics]{};

  Bridge() {
    require(static_cast<bool>(participant));
    const std_msgs_msg_dds__Bool_ no{false};
    const std_msgs_msg_dds__Float64_ number{100.0};
    char text[] = "text";
    const std_msgs_msg_dds__String_ words{text};
    const auto open = [&](int topic, const char* name, const dds_topic_descriptor_t& type, const void* example) {
      const std::string full = "rt" + settings.order_topic(name);
      require(foreign_topic_open(participant->entity(), full.c_str(), &type, example, &topics[topic]) == 1);
    };
    open(0, "estop", std_msgs_msg_dds__Bool__desc, &no);
    open(1, "enable", std_msgs_msg_dds__Bool__desc, &no);
    open(2, "mark", std_msgs_msg_dds__String__desc, &words);
    open(3, "adjust/stiffness", std_msgs_msg_dds__Float64__desc, &number);
    auto made = bridge::ForeignOrders::open(*participant, settings, "fuzz-none");
    require(static_cast<bool>(made));
    orders = std::move(*made);
  }
};

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static Bridge all;
  static std::uint64_t now_ns = 1000 * rtbus::kNsPerS;
  std::span<const std::uint8_t> rest(data, size);
  for (int records = 0; rest.size() >= 3 && records < 64; ++records) {
    const int topic = rest[0] % kTopics, author = rest[0] >> 7;
    now_ns += kGap_ns * rest[1];
    const std::size_t length = std::min<std::size_t>(rest[2], rest.size() - 3);
    (void)foreign_topic_write(&all.topics[topic], author, rest.data() + 3, length);
    all.orders->look(now_ns);
    rest = rest.subspan(3 + length);
  }
  require(all.orders->carried_out() == 0);
  // Whatever came before, an E-stop is heard.
  now_ns += 10 * rtbus::kNsPerS;
  all.orders->look(now_ns);
  const std::uint64_t before = all.orders->refused();
  const std::uint8_t stop[] = {0, 1, 0, 0, 1};
  require(foreign_topic_write(&all.topics[0], 1, stop, sizeof stop) == 1);
  all.orders->look(now_ns);
  require(all.orders->refused() == before + 1);
  return 0;
}
