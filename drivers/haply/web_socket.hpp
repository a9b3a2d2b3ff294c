#pragma once
/// @file web_socket.hpp
/// One WebSocket to a service on this machine, used by one thread: it sends a text and waits for the next one, each
/// until a deadline. A second, read-only one may be served along with it. Over libwebsockets; no thread of its own.
#include <cstdint>
#include <memory>
#include <string>
#include <string_view>

#include "drivers/io/line.hpp"

namespace drivers::haply {

enum class WireStatus : std::uint8_t { kOk, kTimeout, kClosed };

class WebSocket {
 public:
  WebSocket();
  ~WebSocket();
  WebSocket(const WebSocket&) = delete;
  WebSocket& operator=(const WebSocket&) = delete;

  /// Connects to ws://`address`:`port`/. Empty: it did; else why not, in the library's words.
  [[nodiscard]] std::string connect(const std::string& address, int port, io::StopFlag& stop);
  /// The first message, for which it waits as long as for a connection. `out` as of receive().
  [[nodiscard]] WireStatus receive_first(std::string_view& out, const io::StopFlag& stop);
  /// One text frame.
  [[nodiscard]] WireStatus send(std::string_view text, std::uint64_t deadline_ns);
  /// The next whole message, text alone: who sends binary frames is no Inverse Service, and gets a close. `out` is
  /// valid until the next call.
  [[nodiscard]] WireStatus receive(std::string_view& out, std::uint64_t deadline_ns);
  /// " (code 1011: restarting)", as the other end gave it, or why this end has closed; empty: nobody said.
  [[nodiscard]] std::string why_closed() const;
  /// Drops what has arrived and was not received. @returns how many messages.
  std::size_t discard();

  /// Connects to a second port, whose messages take_event() gives. Nobody there: no events.
  void follow_events(const std::string& address, int port, io::StopFlag& stop);
  /// The oldest event that nobody has taken, out of what came while the first connection was served; empty: none.
  [[nodiscard]] std::string take_event();

  void close();

  struct State;

 private:
  std::unique_ptr<State> state_;
};

}  // namespace drivers::haply
