#include "drivers/haply/web_socket.hpp"

#include <libwebsockets.h>

#include <algorithm>
#include <deque>

#include "rtbus/clock.hpp"

namespace drivers::haply {

/// A timer of the library's; of standard layout, since it is found from its first member.
struct Alarm {
  lws_sorted_usec_list_t timer{};
  lws_context* context = nullptr;
  bool rang = false;
};

struct Connection {
  lws* socket = nullptr;
  bool connected = false;
  bool closed = false;
  std::string problem;
  std::string why_closed;
  std::string partial;               ///< Fragments of a message so far.
  std::deque<std::string> messages;  ///< Whole ones that nobody has taken.
};

struct WebSocket::State {
  lws_context* context = nullptr;
  Connection main, events;
  std::string outgoing;  ///< LWS_PRE bytes of room, then the text.
  bool written = true;
  std::string taken;
  Alarm alarm;

  [[nodiscard]] Connection& of(const lws* socket) noexcept { return socket == events.socket ? events : main; }
  /// Serves both sockets until `done`, the deadline, or the end of the first one.
  template <class Done>
  void serve_until(std::uint64_t deadline_ns, Done done);
  /// The same with the patience of a beginning, until `stop`.
  template <class Done>
  void serve_patiently(const io::StopFlag& stop, Done done);
  void open(Connection& connection, const std::string& address, int port, io::StopFlag& stop);
};

namespace {

/// What comes at the beginning is awaited for so many slices, in which both ends have run: a machine that stands still
/// for a while uses up one of them.
constexpr int kPatienceSlices = 60;
constexpr std::uint64_t kSliceNs = 50 * rtbus::kNsPerMs;
constexpr std::size_t kLongestMessage = 1 << 20;
/// Events that nobody takes: the oldest ones go.
constexpr std::size_t kMostEvents = 64;

WebSocket::State& state_of(lws* socket) {
  return *static_cast<WebSocket::State*>(lws_context_user(lws_get_context(socket)));
}

int write_pending(WebSocket::State& state, lws* socket) {
  if (state.written) return 0;
  auto* const text = reinterpret_cast<unsigned char*>(state.outgoing.data()) + LWS_PRE;
  const std::size_t bytes = state.outgoing.size() - LWS_PRE;
  state.written = true;
  return lws_write(socket, text, bytes, LWS_WRITE_TEXT) < static_cast<int>(bytes) ? -1 : 0;
}

int take(WebSocket::State& state, lws* socket, const void* in, std::size_t bytes) {
  Connection& from = state.of(socket);
  const auto refuse = [&](lws_close_status code, const char* reason) {
    from.why_closed = std::string(" (") + reason + ")";
    std::string copy(reason);
    lws_close_reason(socket, code, reinterpret_cast<unsigned char*>(copy.data()), copy.size());
    return -1;
  };
  if (lws_frame_is_binary(socket) != 0) return refuse(LWS_CLOSE_STATUS_UNACCEPTABLE_OPCODE, "it sent a binary frame");
  if (from.partial.size() + bytes > kLongestMessage) {
    return refuse(LWS_CLOSE_STATUS_MESSAGE_TOO_LARGE, "it sent more than 1 MiB at once");
  }
  from.partial.append(static_cast<const char*>(in), bytes);
  // A message may come in fragments, and a frame in pieces.
  if (lws_is_final_fragment(socket) == 0 || lws_remaining_packet_payload(socket) != 0) return 0;
  from.messages.push_back(std::move(from.partial));
  from.partial.clear();
  if (&from == &state.events && from.messages.size() > kMostEvents) from.messages.pop_front();
  return 0;
}

int on_event(lws* socket, lws_callback_reasons reason, void*, void* in, std::size_t bytes) {
  switch (reason) {
    case LWS_CALLBACK_CLIENT_ESTABLISHED:
      state_of(socket).of(socket).connected = true;
      return 0;
    case LWS_CALLBACK_CLIENT_CONNECTION_ERROR: {
      Connection& failed = state_of(socket).of(socket);
      failed.problem = in == nullptr ? "it refuses the connection" : std::string(static_cast<const char*>(in), bytes);
      failed.closed = true;
      failed.socket = nullptr;
      return 0;
    }
    case LWS_CALLBACK_CLIENT_CLOSED: {
      Connection& ended = state_of(socket).of(socket);
      ended.closed = true;
      ended.socket = nullptr;
      return 0;
    }
    case LWS_CALLBACK_WS_PEER_INITIATED_CLOSE: {
      // Two bytes of code, most significant first, then words.
      const auto* const text = static_cast<const unsigned char*>(in);
      if (bytes < 2 || !state_of(socket).of(socket).why_closed.empty()) return 0;
      const std::string words(reinterpret_cast<const char*>(text) + 2, bytes - 2);
      state_of(socket).of(socket).why_closed =
          " (code " + std::to_string(text[0] << 8 | text[1]) + (words.empty() ? "" : ": " + words) + ")";
      return 0;
    }
    case LWS_CALLBACK_CLIENT_WRITEABLE:
      return write_pending(state_of(socket), socket);
    case LWS_CALLBACK_CLIENT_RECEIVE:
      return take(state_of(socket), socket, in, bytes);
    default:
      return 0;
  }
}

constexpr lws_protocols kProtocols[] = {{"", &on_event, 0, 65536, 0, nullptr, 0},
                                        {nullptr, nullptr, 0, 0, 0, nullptr, 0}};

// The library calls it, and then waits for the next timer: so it is due at once again, until it is cancelled.
void ring(lws_sorted_usec_list_t* timer) {
  auto* const alarm = lws_container_of(timer, Alarm, timer);
  alarm->rang = true;
  lws_sul_schedule(alarm->context, 0, timer, &ring, 1);
}

}  // namespace

template <class Done>
void WebSocket::State::serve_until(std::uint64_t deadline_ns, Done done) {
  const std::uint64_t now_ns = rtbus::monotonic_ns();
  alarm.rang = false;
  alarm.context = context;
  const auto left_us = static_cast<lws_usec_t>(deadline_ns > now_ns ? (deadline_ns - now_ns) / 1000 : 0);
  lws_sul_schedule(context, 0, &alarm.timer, &ring, std::max<lws_usec_t>(1, left_us));
  while (!done() && !main.closed && !alarm.rang) {
    if (lws_service(context, 0) < 0) main.closed = true;
  }
  lws_sul_schedule(context, 0, &alarm.timer, &ring, LWS_SET_TIMER_USEC_CANCEL);
}

template <class Done>
void WebSocket::State::serve_patiently(const io::StopFlag& stop, Done done) {
  for (int slice = 0; slice < kPatienceSlices && !done() && !main.closed && !stop.raised(); ++slice) {
    serve_until(rtbus::monotonic_ns() + kSliceNs, done);
  }
}

void WebSocket::State::open(Connection& connection, const std::string& address, int port, io::StopFlag& stop) {
  lws_client_connect_info to{};
  to.context = context;
  to.address = address.c_str();
  to.host = address.c_str();
  to.port = port;
  to.path = "/";
  to.pwsi = &connection.socket;
  if (lws_client_connect_via_info(&to) == nullptr && connection.problem.empty()) {
    connection.problem = "it refuses the connection";
  }
  if (connection.problem.empty()) {
    serve_patiently(stop, [&] { return connection.connected || connection.closed; });
  }
  if (connection.connected || !connection.problem.empty()) return;
  connection.problem = connection.closed ? "it closes the connection" : "it does not answer";
}

WebSocket::WebSocket() : state_(std::make_unique<State>()) { lws_set_log_level(0, nullptr); }

WebSocket::~WebSocket() { close(); }

void WebSocket::close() {
  if (state_->context != nullptr) lws_context_destroy(state_->context);
  state_ = std::make_unique<State>();
}

std::string WebSocket::connect(const std::string& address, int port, io::StopFlag& stop) {
  close();
  lws_context_creation_info info{};
  info.port = CONTEXT_PORT_NO_LISTEN;
  info.protocols = kProtocols;
  info.user = state_.get();
  info.options = LWS_SERVER_OPTION_DISABLE_IPV6;
  state_->context = lws_create_context(&info);
  if (state_->context == nullptr) return "no WebSocket context can be made";
  state_->open(state_->main, address, port, stop);
  return state_->main.connected ? "" : state_->main.problem;
}

void WebSocket::follow_events(const std::string& address, int port, io::StopFlag& stop) {
  if (state_->context != nullptr) state_->open(state_->events, address, port, stop);
}

std::string WebSocket::take_event() {
  auto& messages = state_->events.messages;
  if (messages.empty()) return {};
  std::string out = std::move(messages.front());
  messages.pop_front();
  return out;
}

std::string WebSocket::why_closed() const { return state_->main.why_closed; }

std::size_t WebSocket::discard() {
  if (state_->context == nullptr) return 0;
  state_->serve_until(rtbus::monotonic_ns(), [] { return false; });
  const std::size_t out = state_->main.messages.size();
  state_->main.messages.clear();
  return out;
}

WireStatus WebSocket::send(std::string_view text, std::uint64_t deadline_ns) {
  if (state_->main.socket == nullptr || state_->main.closed) return WireStatus::kClosed;
  state_->outgoing.assign(LWS_PRE, '\0');
  state_->outgoing.append(text);
  state_->written = false;
  lws_callback_on_writable(state_->main.socket);
  state_->serve_until(deadline_ns, [&] { return state_->written; });
  return state_->written ? WireStatus::kOk : state_->main.closed ? WireStatus::kClosed : WireStatus::kTimeout;
}

WireStatus WebSocket::receive_first(std::string_view& out, const io::StopFlag& stop) {
  if (state_->context == nullptr) return WireStatus::kClosed;
  state_->serve_patiently(stop, [&] { return !state_->main.messages.empty(); });
  return receive(out, 0);
}

WireStatus WebSocket::receive(std::string_view& out, std::uint64_t deadline_ns) {
  if (state_->context == nullptr) return WireStatus::kClosed;
  auto& messages = state_->main.messages;
  if (messages.empty()) state_->serve_until(deadline_ns, [&] { return !messages.empty(); });
  if (messages.empty()) return state_->main.closed ? WireStatus::kClosed : WireStatus::kTimeout;
  state_->taken = std::move(messages.front());
  messages.pop_front();
  out = state_->taken;
  return WireStatus::kOk;
}

}  // namespace drivers::haply
