#include "drivers/haply/http_get.hpp"

#include <libwebsockets.h>

#include <array>

#include "rtbus/clock.hpp"

namespace drivers::haply {
namespace {

struct Request {
  bool done = false;
  unsigned status = 0;
  std::string body;
  lws_sorted_usec_list_t alarm{};  ///< Ends a wait of the library now and then.
};

constexpr std::size_t kLongestBody = 1 << 16;
constexpr lws_usec_t kLookEvery_us = 20'000;

Request& request_of(lws* socket) { return *static_cast<Request*>(lws_context_user(lws_get_context(socket))); }

int on_http_event(lws* socket, lws_callback_reasons reason, void*, void* in, std::size_t bytes) {
  switch (reason) {
    case LWS_CALLBACK_CLIENT_CONNECTION_ERROR:
    case LWS_CALLBACK_CLOSED_CLIENT_HTTP:
    case LWS_CALLBACK_COMPLETED_CLIENT_HTTP:
      request_of(socket).done = true;
      return 0;
    case LWS_CALLBACK_ESTABLISHED_CLIENT_HTTP:
      request_of(socket).status = lws_http_client_http_response(socket);
      return 0;
    case LWS_CALLBACK_RECEIVE_CLIENT_HTTP: {
      std::array<char, LWS_PRE + 4096> buffer{};
      char* at = buffer.data() + LWS_PRE;
      int room = static_cast<int>(buffer.size() - LWS_PRE);
      return lws_http_client_read(socket, &at, &room) < 0 ? -1 : 0;
    }
    case LWS_CALLBACK_RECEIVE_CLIENT_HTTP_READ: {
      Request& request = request_of(socket);
      if (request.body.size() + bytes > kLongestBody) return -1;
      request.body.append(static_cast<const char*>(in), bytes);
      return 0;
    }
    default:
      return 0;
  }
}

constexpr lws_protocols kHttpProtocols[] = {{"http", &on_http_event, 0, 4096, 0, nullptr, 0},
                                            {nullptr, nullptr, 0, 0, 0, nullptr, 0}};

void nothing(lws_sorted_usec_list_t*) {}

}  // namespace

std::string http_get(const std::string& address, int port, const std::string& path, std::uint64_t deadline_ns,
                     const io::StopFlag& stop) {
  lws_set_log_level(0, nullptr);
  Request request;
  lws_context_creation_info info{};
  info.port = CONTEXT_PORT_NO_LISTEN;
  info.protocols = kHttpProtocols;
  info.user = &request;
  info.options = LWS_SERVER_OPTION_DISABLE_IPV6;
  lws_context* const context = lws_create_context(&info);
  if (context == nullptr) return {};
  lws_client_connect_info to{};
  to.context = context;
  to.address = address.c_str();
  to.host = address.c_str();
  to.port = port;
  to.path = path.c_str();
  to.method = "GET";
  to.protocol = kHttpProtocols[0].name;  // without it the library keeps the body to itself
  to.alpn = "http/1.1";
  if (lws_client_connect_via_info(&to) == nullptr) request.done = true;
  while (!request.done && rtbus::monotonic_ns() < deadline_ns && !stop.raised()) {
    lws_sul_schedule(context, 0, &request.alarm, &nothing, kLookEvery_us);
    if (lws_service(context, 0) < 0) break;
  }
  lws_sul_schedule(context, 0, &request.alarm, &nothing, LWS_SET_TIMER_USEC_CANCEL);
  lws_context_destroy(context);
  return request.status == HTTP_STATUS_OK ? request.body : std::string();
}

}  // namespace drivers::haply
