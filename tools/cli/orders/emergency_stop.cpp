#include "tools/cli/orders/emergency_stop.hpp"

#include <signal.h>

#include <fstream>
#include <nlohmann/json.hpp>

#include "rtbus/realtime.hpp"
#include "rtbus/topic_directory.hpp"
#include "tools/cli/orders/order_socket.hpp"

namespace tools {

namespace {

/// The calling thread comes before ordinary programs while this lives, where the user has the right.
class OnTime {
 public:
  OnTime() { (void)rtbus::prefer_on_time(); }
  ~OnTime() { before_.restore(); }
  OnTime(const OnTime&) = delete;
  OnTime& operator=(const OnTime&) = delete;

 private:
  rtbus::ThreadScheduling before_;
};

/// @returns how many got the signal.
int end_haptic_nodes(const std::string& session) {
  int ended = 0;
  for (const rtbus::TopicInfo& topic : rtbus::list_topics(session)) {
    if (!topic.writer_alive || !topic.topic.ends_with(".device_state") || topic.writer_pid <= 1) continue;
    std::string name;
    std::getline(std::ifstream("/proc/" + std::to_string(topic.writer_pid) + "/comm") >> std::ws, name);
    if (name == "haptic_node" && ::kill(static_cast<pid_t>(topic.writer_pid), SIGTERM) == 0) ++ended;
  }
  return ended;
}

}  // namespace

rtbus::Result<std::string, std::string> emergency_stop(const std::string& session, const std::string& reason,
                                                       const std::string& source) {
  const OnTime on_time;
  nlohmann::json order{{"order", "estop"}};
  if (!reason.empty()) order["reason"] = reason;
  if (!source.empty()) order["source"] = source;
  const auto reply = send_order(session, order);
  if (reply && reply->value("ok", false)) {
    return std::string("E-stop: zero force until it is re-armed (`rtbus estop --rearm`)");
  }
  const std::string why = reply ? reply->value("error", "refused") : reply.error();
  const int ended = end_haptic_nodes(session);
  if (ended == 0) return rtbus::Failure{why};
  return why + "; ended " + std::to_string(ended) + " haptic node" + (ended == 1 ? "" : "s") + " of session " +
         session + " at zero force instead";
}

}  // namespace tools
