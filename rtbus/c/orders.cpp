// The orders of the C interface: JSON to the socket of `rtbus run`, and back.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <string>
#include <string_view>

#include "rtbus/c/detail/boundary.hpp"
#include "rtbus/order_client.hpp"

using rtbus::capi::fail;
using rtbus::capi::guarded;

namespace {

constexpr double kPatience_s = 1.0;

/// A text as JSON has it, with its quotes.
std::string quoted(std::string_view text) {
  std::string out = "\"";
  for (const char c : text) {
    if (c == '"' || c == '\\') {
      out += '\\';
      out += c;
    } else if (static_cast<unsigned char>(c) < 0x20) {
      char escaped[8];
      std::snprintf(escaped, sizeof escaped, "\\u%04x", static_cast<unsigned>(static_cast<unsigned char>(c)));
      out += escaped;
    } else {
      out += c;
    }
  }
  return out + "\"";
}

/// What a refusal says: the value of "error". The answers come from `rtbus run`, one flat object.
std::string error_in(const std::string& answer) {
  constexpr std::string_view kKey = "\"error\":\"";
  const std::size_t at = answer.find(kKey);
  if (at == std::string::npos) return answer;
  std::string out;
  for (std::size_t i = at + kKey.size(); i < answer.size() && answer[i] != '"'; ++i) {
    if (answer[i] == '\\' && i + 1 < answer.size()) ++i;
    out += answer[i];
  }
  return out;
}

int order(const char* session, const std::string& text, std::string& answer, double patience_s) {
  auto reply = rtbus::send_order_text(session, text, patience_s);
  if (!reply) {
    const bool nobody = reply.error().kind == rtbus::OrderFault::Kind::kNobodyServes;
    return fail(nobody ? RTBUS_E_NOT_FOUND : RTBUS_E_TIMEOUT, reply.error().sentence);
  }
  answer = std::move(*reply);
  if (answer.find("\"ok\":false") != std::string::npos) return fail(RTBUS_E_ORDER, error_in(answer));
  return RTBUS_OK;
}

int order(const char* session, const std::string& text) {
  std::string answer;
  return order(session, text, answer, kPatience_s);
}

}  // namespace

int rtbus_order(const char* session, const char* text, char* answer, size_t answer_bytes, double patience_s) {
  return guarded([&]() -> int {
    if (session == nullptr || text == nullptr || (answer == nullptr && answer_bytes != 0)) {
      return fail(RTBUS_E_ARGUMENT, "session, order and answer must not be null");
    }
    if (!std::isfinite(patience_s) || patience_s <= 0.0 || patience_s > 3600.0) {
      return fail(RTBUS_E_ARGUMENT, "patience_s must be above 0 and at most 3600");
    }
    std::string reply;
    const int status = order(session, text, reply, patience_s);
    if (answer_bytes > 0) {
      const size_t length = std::min(reply.size(), answer_bytes - 1);
      std::memcpy(answer, reply.data(), length);
      answer[length] = '\0';
      if (status >= 0 && length < reply.size()) {
        return fail(RTBUS_E_ARGUMENT, "the answer has " + std::to_string(reply.size()) + " bytes and no room for them");
      }
    }
    return status;
  });
}

int rtbus_estop(const char* session, const char* reason) {
  return guarded([&]() -> int {
    if (session == nullptr) return fail(RTBUS_E_ARGUMENT, "session must not be null");
    return order(session, R"({"order":"estop","reason":)" + quoted(reason == nullptr ? "" : reason) + "}");
  });
}

int rtbus_rearm(const char* session) {
  return guarded([&]() -> int {
    if (session == nullptr) return fail(RTBUS_E_ARGUMENT, "session must not be null");
    return order(session, R"({"order":"rearm"})");
  });
}

int rtbus_adjust(const char* session, const char* key, double value) {
  return guarded([&]() -> int {
    if (session == nullptr || key == nullptr) return fail(RTBUS_E_ARGUMENT, "session and key must not be null");
    if (!std::isfinite(value)) return fail(RTBUS_E_VALUE, std::string(key) + ": the value is not finite");
    char number[40];
    std::snprintf(number, sizeof number, "%.17g", value);
    return order(session, R"({"order":"adjust","key":)" + quoted(key) + ",\"value\":" + number + "}");
  });
}

int rtbus_mark(const char* session, const char* text) {
  return guarded([&]() -> int {
    if (session == nullptr || text == nullptr) return fail(RTBUS_E_ARGUMENT, "session and text must not be null");
    return order(session, R"({"order":"mark","text":)" + quoted(text) + "}");
  });
}
