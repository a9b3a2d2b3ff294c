#include "tools/cli/host/loop_cores.hpp"

#include <string_view>

#include "rtbus/messages.hpp"
#include "rtbus/realtime.hpp"

namespace tools {

namespace {
constexpr std::uint32_t kNotPinned = 0xffffffff;
}  // namespace

std::vector<int> loop_cores(const std::vector<rtbus::TopicInfo>& topics) {
  std::vector<int> cores;
  for (const rtbus::TopicInfo& info : topics) {
    if (!info.writer_alive || !info.topic.ends_with(".node_info")) continue;
    rtbus::Session session;
    session.name = info.session;
    auto reader = rtbus::Reader<rtbus::NodeInfo>::open(
        session, info.topic, {.presence = false, .from_oldest = true, .trust = rtbus::OwnerTrust::kAnyone});
    rtbus::Stamped<rtbus::NodeInfo> latest;
    if (!reader || reader->read_latest(latest) != rtbus::ReadStatus::kFresh) continue;
    if (std::string_view(latest.value.role.data()) == "haptic" && latest.value.core != kNotPinned)
      cores.push_back(static_cast<int>(latest.value.core));
  }
  return cores;
}

void keep_off_loops(const std::vector<rtbus::TopicInfo>& topics) { (void)rtbus::stay_off_cores(loop_cores(topics)); }

}  // namespace tools
