#include "tools/cli/orders/marks.hpp"

#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <array>
#include <charconv>
#include <cstddef>
#include <cstring>
#include <fstream>
#include <string_view>

namespace tools {
namespace {

constexpr std::size_t kMaxText = 255;

/// "@rtbus.mark.<session>." as /proc/net/unix prints the beginning of an abstract name.
std::string prefix(const std::string& session) { return "@rtbus.mark." + session + "."; }

/// @param name With '@' for the zero byte of an abstract address.
socklen_t address(const std::string& name, sockaddr_un& out) {
  out = {};
  out.sun_family = AF_UNIX;
  const std::size_t length = std::min(name.size(), sizeof out.sun_path);
  std::memcpy(out.sun_path + 1, name.data() + 1, length - 1);
  return static_cast<socklen_t>(offsetof(sockaddr_un, sun_path) + length);
}

}  // namespace

MarkInbox::MarkInbox(const std::string& session) {
  socket_ = ::socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
  sockaddr_un self{};
  const socklen_t length = address(prefix(session) + std::to_string(::getpid()), self);
  const int on = 1;
  if (socket_ < 0 || ::setsockopt(socket_, SOL_SOCKET, SO_PASSCRED, &on, sizeof on) != 0 ||
      ::bind(socket_, reinterpret_cast<const sockaddr*>(&self), length) != 0) {
    if (socket_ >= 0) ::close(socket_);
    socket_ = -1;
  }
}

MarkInbox::~MarkInbox() {
  if (socket_ >= 0) ::close(socket_);
}

std::optional<Mark> MarkInbox::take() {
  for (int i = 0; socket_ >= 0 && i < 64; ++i) {  // bounded: a flood of foreign datagrams may not hold us here
    std::array<char, 512> text;
    alignas(cmsghdr) std::array<char, CMSG_SPACE(sizeof(ucred))> control{};
    iovec part{text.data(), text.size()};
    msghdr message{};
    message.msg_iov = &part;
    message.msg_iovlen = 1;
    message.msg_control = control.data();
    message.msg_controllen = control.size();
    const ssize_t got = ::recvmsg(socket_, &message, 0);
    if (got < 0) return std::nullopt;
    const cmsghdr* const head = CMSG_FIRSTHDR(&message);
    if (head == nullptr || head->cmsg_type != SCM_CREDENTIALS) continue;
    ucred sender{};
    std::memcpy(&sender, CMSG_DATA(head), sizeof sender);
    if (sender.uid != ::geteuid() && sender.uid != 0) continue;
    const std::string_view whole(text.data(), static_cast<std::size_t>(got));
    const std::size_t space = whole.find(' ');
    Mark mark;
    if (space == whole.npos ||
        std::from_chars(whole.data(), whole.data() + space, mark.stamp_ns).ptr != whole.data() + space) {
      continue;
    }
    mark.text = whole.substr(space + 1, kMaxText);
    return mark;
  }
  return std::nullopt;
}

int send_mark(const std::string& session, const Mark& mark) {
  const int out = ::socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
  if (out < 0) return 0;
  const std::string text = std::to_string(mark.stamp_ns) + " " + mark.text.substr(0, kMaxText);
  int taken = 0;
  std::ifstream sockets("/proc/net/unix");
  for (std::string line; std::getline(sockets, line);) {
    const std::size_t at = line.find(prefix(session));
    if (at == line.npos || (at > 0 && line[at - 1] != ' ')) continue;
    sockaddr_un there{};
    const socklen_t length = address(line.substr(at), there);
    if (::sendto(out, text.data(), text.size(), 0, reinterpret_cast<const sockaddr*>(&there), length) >= 0) ++taken;
  }
  ::close(out);
  return taken;
}

}  // namespace tools
