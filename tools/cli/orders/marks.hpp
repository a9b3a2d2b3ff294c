#pragma once
/// @file marks.hpp
/// Marks on their way from `rtbus mark` to the recorders of a session: one datagram each, to an abstract Unix socket
/// per recorder, so that nothing is left behind when either end dies. A mark carries the time at which it was made.
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

namespace tools {

struct Mark {
  std::uint64_t stamp_ns = 0;  ///< CLOCK_MONOTONIC.
  std::string text;            ///< At most 255 bytes.
};

/// The recorder's end.
class MarkInbox {
 public:
  /// @param session Whose marks. Without a socket (no permission) the inbox stays empty.
  explicit MarkInbox(const std::string& session);
  ~MarkInbox();
  MarkInbox(const MarkInbox&) = delete;
  MarkInbox& operator=(const MarkInbox&) = delete;

  /// The next mark of this user or of root; others are not listened to. Does not block.
  [[nodiscard]] std::optional<Mark> take();

 private:
  int socket_ = -1;
};

/// Sends to every recorder of `session`. @returns how many took it.
int send_mark(const std::string& session, const Mark& mark);

}  // namespace tools
