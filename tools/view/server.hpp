#pragma once
/// @file server.hpp
/// The server of `rtbus view`: its page over HTTP, and frames over a WebSocket. docs/viewer-protocol.md.
///
/// Nothing is queued for a page: a message is made when it can be sent, from the newest of what its page has not got.
/// At most two frames are under way that the page has not acknowledged. A page that does not read, or that is hidden,
/// holds nothing and costs nothing.
#include <functional>
#include <memory>
#include <string>

#include "rtbus/result.hpp"
#include "tools/view/frame_source.hpp"
#include "tools/view/orders.hpp"

namespace view {

struct ServerOptions {
  std::string address = "127.0.0.1";  ///< Numeric, IPv4 or IPv6.
  int port = 0;                       ///< 0: any that is free.
  std::string token;
};

struct ServerLimits {
  static constexpr int kFrames_hz = 60;
  static constexpr std::size_t kPages = 8;            ///< With a WebSocket.
  static constexpr unsigned kConnections = 40;        ///< Of any kind.
  static constexpr std::size_t kMessageBytes = 4096;  ///< From a page.
  static constexpr int kMessages_per_s = 240;         ///< Likewise.
  static constexpr int kUnacknowledged = 2;           ///< Frames under way to one page.
  static constexpr std::uint64_t kPatience_s = 10;    ///< For a request, and for the token.
  static constexpr std::uint64_t kLooking_s = 5;      ///< A page that acknowledges nothing for so long does not look.
};

/// Gives the source when somebody looks; the server lets it go when nobody does any more.
using MakeSource = std::function<std::shared_ptr<FrameSource>()>;

/// One per process; one thread.
class Server {
 public:
  /// @returns why not: "127.0.0.1:7125 is in use".
  [[nodiscard]] static rtbus::Result<std::unique_ptr<Server>, std::string> open(const ServerOptions& options,
                                                                                OrderOptions orders,
                                                                                MakeSource make_source);
  ~Server();
  Server(const Server&) = delete;
  Server& operator=(const Server&) = delete;

  /// "http://127.0.0.1:7125/#k=…"
  [[nodiscard]] std::string url() const;

  /// Serves until `ends()`, which is asked at least ten times a second.
  void serve(const std::function<bool()>& ends);

 private:
  Server();
  struct Core;
  std::unique_ptr<Core> core_;
};

}  // namespace view
