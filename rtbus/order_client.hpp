#pragma once
/// @file order_client.hpp
/// The client's end of the order socket of `rtbus run` (docs/orders.md): JSON goes there and comes back as text.
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "rtbus/result.hpp"

namespace rtbus {

/// An order or an answer is at most this long [bytes].
inline constexpr std::size_t kLongestOrder = 4096;

/// Why an order has no answer.
struct OrderFault {
  enum class Kind : std::uint8_t { kNobodyServes, kNoAnswer };
  Kind kind = Kind::kNobodyServes;
  std::string sentence;  ///< For the user.
};

/// Paths that the socket of a session may have, for the user that its topics belong to.
[[nodiscard]] std::vector<std::string> order_socket_paths(const std::string& session);

/// Sends `order` to the `rtbus run` of `session` and returns its answer. Waits at most `patience_s`. @realtime No.
[[nodiscard]] Result<std::string, OrderFault> send_order_text(const std::string& session, const std::string& order,
                                                              double patience_s);

}  // namespace rtbus
