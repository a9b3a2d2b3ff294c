#pragma once
/// @file orders.hpp
/// Orders of a page to the session that it shows. They go the way of all orders, the socket of `rtbus run`
/// (docs/orders.md).
#include <cstdint>
#include <optional>
#include <string>

#include <nlohmann/json.hpp>

#include "tools/view/frame_source.hpp"

namespace view {

struct OrderOptions {
  std::optional<std::string> session;  ///< Orders go to no other; none: to the one that the page shows.
  bool read_only = false;              ///< E-stop alone.
  bool live = true;                    ///< False: a recording is shown, there is nothing to order.
  std::string record_to = ".";         ///< Folder of new recordings.
};

struct OrderAnswer {
  bool taken = false;
  std::string text;  ///< For the user: what happened, or why not.
};

/// One per server; one thread.
class SessionOrders {
 public:
  explicit SessionOrders(OrderOptions options) : options_(std::move(options)) {}

  /// Asks the session for its state, at most once a second; a session that does not answer delays the frames by 50 ms.
  void follow(const std::string& session, std::uint64_t now_ns);

  /// @param order The `order` object of the page's message; the page has presented its token. An E-stop takes at most
  /// 1 s, another order 0.3 s: only a session whose `rtbus run` hangs takes that long.
  [[nodiscard]] OrderAnswer take(const nlohmann::json& order, std::uint64_t now_ns);

  /// docs/viewer-protocol.md, message `orders`.
  [[nodiscard]] const Document& state() const noexcept { return state_; }

 private:
  [[nodiscard]] OrderAnswer pass_on(const std::string& session, const nlohmann::json& order);
  [[nodiscard]] OrderAnswer record(const std::string& session);
  void ask(const std::string& session, std::uint64_t now_ns);
  void tell();

  OrderOptions options_;
  std::string session_;           ///< Of the last state.
  nlohmann::json session_state_;  ///< Its answer to `state`; null: none.
  std::string why_;               ///< Why there is none.
  std::uint64_t asked_ns_ = 0;
  Document state_;
};

}  // namespace view
