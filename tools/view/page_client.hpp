#pragma once
/// @file page_client.hpp
/// One page at the other end of a WebSocket: what it has got, and what it gets next. Knows no sockets.
#include <cstdint>
#include <deque>
#include <optional>
#include <string>
#include <string_view>

#include "tools/view/frame_source.hpp"
#include "tools/view/orders.hpp"
#include "tools/view/protocol.hpp"

namespace view {

/// Why a page is turned away, as a WebSocket's close code; 4000 and above are ours.
enum class Refusal : std::uint16_t {
  kNone = 0,
  kBadMessage = 1007,
  kTooMany = 1008,  ///< Messages in one second.
  kTooLong = 1009,
  kTooManyPages = 1013,
  kWrongToken = 4401,
  kNoToken = 4408,  ///< In time.
};
[[nodiscard]] const char* to_string(Refusal refusal) noexcept;

/// One per WebSocket; one thread.
class PageClient {
 public:
  /// @param orders Outlives the client.
  PageClient(std::string token, SessionOrders& orders, std::uint64_t now_ns)
      : token_(std::move(token)), orders_(&orders), came_ns_(now_ns) {}

  /// Takes in a message of the page. @param source Whose playback it may change; null: none.
  void receive(std::string_view text, FrameSource* source, std::uint64_t now_ns);
  /// From now on: this page is turned away. The first reason stays.
  void refuse(Refusal why) noexcept {
    if (refusal_ == Refusal::kNone) refusal_ = why;
  }
  /// Checks the time that it has for its token.
  void check_patience(std::uint64_t now_ns) noexcept;

  struct Outgoing {
    Message bytes;  ///< After kMessageRoom.
    bool binary = false;
  };
  /// The next message. Nothing: there is nothing new, or the page has not acknowledged enough.
  [[nodiscard]] std::optional<Outgoing> next(const FrameSource* source, std::uint64_t now_ns);
  /// next() has one, or the page is to be turned away.
  [[nodiscard]] bool wants(const FrameSource* source) const;

  [[nodiscard]] Refusal refusal() const noexcept { return refusal_; }
  /// It has its token and acknowledged something lately.
  [[nodiscard]] bool looks(std::uint64_t now_ns) const noexcept;
  [[nodiscard]] std::uint64_t frames_sent() const noexcept { return sent_; }

 private:
  [[nodiscard]] bool has_credit() const noexcept;
  [[nodiscard]] std::optional<Outgoing> next_document(const FrameSource& source);
  [[nodiscard]] bool frame_due(const FrameSource& source) const;

  std::string token_;
  SessionOrders* orders_;
  std::uint64_t came_ns_;
  bool welcome_ = false;  ///< The token was right.
  Refusal refusal_ = Refusal::kNone;
  std::uint64_t second_ns_ = 0;  ///< Messages are counted since.
  int messages_ = 0;

  bool greeted_ = false;
  std::deque<std::string> answers_;  ///< To orders, that are due.
  std::uint64_t orders_state_ = 0;   ///< Number of the one it has.
  std::uint64_t source_ = 0;         ///< FrameSource::id() of what follows.
  std::uint32_t scene_ = 0;          ///< Number of the one it has.
  std::size_t meshes_ = 0;           ///< Of that scene.
  std::uint64_t state_ = 0, figures_ = 0, playback_ = 0;
  FrameCursor cursor_;
  std::uint64_t sent_ = 0, acknowledged_ = 0;  ///< Frames.
  std::uint64_t heard_ns_ = 0;                 ///< Of the last acknowledgement.
};

}  // namespace view
