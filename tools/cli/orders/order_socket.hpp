#pragma once
/// @file order_socket.hpp
/// The path of all orders to a running session: a Unix socket of `rtbus run` (SOCK_SEQPACKET, mode 0600). A client
/// sends one JSON document per packet and gets one back (docs/orders.md). Only the session's user and root may connect.
#include <cstddef>
#include <functional>
#include <memory>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "rtbus/order_client.hpp"
#include "rtbus/result.hpp"
#include "rtbus/segment.hpp"

namespace tools {

using rtbus::kLongestOrder;

/// The server's end. One thread.
class OrderSocket {
 public:
  /// Answers one order; must not throw.
  using Answer = std::function<nlohmann::json(const nlohmann::json& order)>;

  /// Makes the socket; replaces what a dead `rtbus run` left. The error is a sentence for the user.
  [[nodiscard]] static rtbus::Result<std::unique_ptr<OrderSocket>, std::string> open(const std::string& session,
                                                                                     Answer answer);
  ~OrderSocket();
  OrderSocket(const OrderSocket&) = delete;
  OrderSocket& operator=(const OrderSocket&) = delete;

  /// Takes and answers orders for `duration_ns`, or until a signal comes. @returns false when it was interrupted, also
  /// before the call.
  bool serve(std::uint64_t duration_ns);

  [[nodiscard]] const std::string& path() const noexcept { return path_; }

 private:
  OrderSocket(int listener, std::string path, Answer answer);
  void accept_clients();
  [[nodiscard]] bool answer_client(int client);

  static constexpr std::size_t kMostClients = 16;

  int listener_;
  std::string path_;
  Answer answer_;
  std::vector<int> clients_;
};

/// The client's end: sends `order` to the `rtbus run` of `session` and returns its answer. Waits at most `patience_s`.
/// The error is a sentence for the user.
[[nodiscard]] rtbus::Result<nlohmann::json, std::string> send_order(const std::string& session,
                                                                    const nlohmann::json& order,
                                                                    double patience_s = 1.0);

/// Removes the sockets that no process serves; of one session, or of all when `session` is empty. @returns their paths.
std::vector<std::string> remove_dead_order_sockets(const std::string& session, bool dry_run = false);

}  // namespace tools
