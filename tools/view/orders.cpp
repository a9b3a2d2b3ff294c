#include "tools/view/orders.hpp"

#include <algorithm>
#include <filesystem>
#include <utility>

#include "rtbus/clock.hpp"
#include "rtbus/topic_directory.hpp"
#include "tools/cli/common/choose.hpp"
#include "tools/cli/common/utc_now.hpp"
#include "tools/cli/orders/emergency_stop.hpp"
#include "tools/cli/orders/order_socket.hpp"

namespace view {

namespace {

using nlohmann::json;

constexpr std::uint64_t kAsk_ns = rtbus::kNsPerS;
constexpr double kStatePatience_s = 0.05, kOrderPatience_s = 0.3;

std::string text_of(const json& object, const char* key) {
  const auto found = object.find(key);
  return found != object.end() && found->is_string() ? found->get<std::string>() : std::string();
}

/// "trial_20261122_184501.h5"
std::string new_file(const std::string& session) {
  std::string stamp;
  for (const char c : tools::utc_now()) {
    if (c >= '0' && c <= '9') stamp += c;
    if (c == 'T') stamp += '_';
  }
  return session + "_" + stamp + ".h5";
}

}  // namespace

void SessionOrders::ask(const std::string& session, std::uint64_t now_ns) {
  asked_ns_ = now_ns;
  session_ = session;
  auto answer = tools::send_order(session, {{"order", "state"}}, kStatePatience_s);
  if (answer && answer->value("ok", false)) {
    session_state_ = std::move(*answer);
    why_.clear();
  } else {
    session_state_ = nullptr;
    why_ = answer ? text_of(*answer, "error") : answer.error();
  }
  tell();
}

void SessionOrders::tell() {
  nlohmann::ordered_json out{{"type", "orders"}, {"session", session_}, {"live", options_.live}};
  out["read_only"] = options_.read_only;
  out["answers"] = session_state_.is_object();
  out["why"] = why_;
  const bool known = session_state_.is_object();
  out["estop"] = known && session_state_.value("estop", false);
  out["adjustable"] = known ? session_state_.value("adjustable", json::array()) : json::array();
  out["records"] = known && session_state_.value("records", false);
  const std::string file = known ? text_of(session_state_, "recording") : std::string();
  out["recording"] = file.empty() ? json(nullptr) : json(file);
  out["recorded"] = known ? text_of(session_state_, "recorded") : std::string();
  state_.set(std::move(out));
}

void SessionOrders::follow(const std::string& session, std::uint64_t now_ns) {
  if (!options_.live) {
    if (state_.number == 0) tell();
    return;
  }
  if (session.empty() || (session == session_ && now_ns < asked_ns_ + kAsk_ns)) return;
  ask(session, now_ns);
}

OrderAnswer SessionOrders::pass_on(const std::string& session, const json& order) {
  const auto answer = tools::send_order(session, order, kOrderPatience_s);
  if (!answer) return {false, answer.error()};
  if (!answer->value("ok", false)) return {false, text_of(*answer, "error")};
  const std::string name = text_of(order, "order");
  if (name == "rearm") return {true, "re-armed: force ramps up"};
  if (name == "record") return {true, "recording into " + text_of(order, "file")};
  if (name == "end_recording") return {true, "the recording ends"};
  if (name == "mark") return {true, "marked: " + text_of(order, "text")};
  return {true, text_of(order, "key") + " = " + order["value"].dump()};
}

OrderAnswer SessionOrders::record(const std::string& session) {
  std::error_code error;
  const std::string file =
      (std::filesystem::absolute(options_.record_to, error) / new_file(session)).lexically_normal().string();
  return pass_on(session, {{"order", "record"}, {"file", file}, {"bodies", true}});
}

OrderAnswer SessionOrders::take(const json& order, std::uint64_t now_ns) {
  if (!order.is_object()) return {false, "an order is an object"};
  const std::string name = text_of(order, "order"), shown = text_of(order, "session");
  if (!options_.live) return {false, "this is a recording: there is no session to order"};
  if (options_.read_only && name != "estop") return {false, "this viewer was started with --read-only: E-stop alone"};
  if (options_.session && !shown.empty() && shown != *options_.session) {
    return {false, "this viewer was started for session " + *options_.session};
  }
  const auto session =
      tools::choose_session(rtbus::list_topics(), shown.empty() ? options_.session : std::optional<std::string>(shown));
  if (!session) return {false, session.error().message};

  OrderAnswer out{false, "'" + name.substr(0, 40) + "' is no order of this viewer"};
  if (name == "estop") {
    const auto done = tools::emergency_stop(*session, "rtbus view");
    out = {done.has_value(), done ? *done : done.error()};
  } else if (name == "rearm") {
    out = pass_on(*session, {{"order", "rearm"}});
  } else if (name == "mark") {
    out = pass_on(*session, {{"order", "mark"}, {"text", text_of(order, "text")}});
  } else if (name == "adjust") {
    out =
        pass_on(*session,
                {{"order", "adjust"}, {"key", text_of(order, "key")}, {"value", order.value("value", json(nullptr))}});
  } else if (name == "record") {
    out = record(*session);
  } else if (name == "end_record") {
    out = pass_on(*session, {{"order", "end_recording"}});
  }
  ask(*session, now_ns);
  return out;
}

}  // namespace view
