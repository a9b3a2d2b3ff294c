#include "rtbus/order_client.hpp"

#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstdlib>
#include <cstring>

#include "rtbus/private_folder.hpp"
#include "rtbus/topic_directory.hpp"

namespace rtbus {
namespace {

/// @returns a connected socket, or −1. Each of its calls waits at most `patience`: connecting too, where the queue of a
/// `rtbus run` that hangs is full (errno is EAGAIN then).
int connect_to(const std::string& path, const timeval& patience) {
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  if (path.size() >= sizeof address.sun_path) return -1;
  std::memcpy(address.sun_path, path.c_str(), path.size() + 1);
  const int fd = ::socket(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0);
  if (fd < 0) return -1;
  ::setsockopt(fd, SOL_SOCKET, SO_RCVTIMEO, &patience, sizeof patience);
  ::setsockopt(fd, SOL_SOCKET, SO_SNDTIMEO, &patience, sizeof patience);
  if (::connect(fd, reinterpret_cast<const sockaddr*>(&address), sizeof address) == 0) return fd;
  const int why = errno;
  ::close(fd);
  errno = why;
  return -1;
}

/// Whose session it is: that of its segments; the caller without any.
uid_t owner_of(const std::string& session) {
  const auto topics = list_topics(session);
  return topics.empty() ? ::geteuid() : topics.front().owner;
}

}  // namespace

std::vector<std::string> order_socket_paths(const std::string& session) {
  const auto path_in = [&session](const std::string& folder) { return folder + "/rtbus." + session + ".orders"; };
  const PrivateFolders folders = private_folders_of(owner_of(session));
  std::vector<std::string> out;
  if (const char* const runtime = std::getenv("XDG_RUNTIME_DIR")) out.push_back(path_in(runtime));
  out.push_back(path_in(folders.runtime));
  out.push_back(path_in(folders.own));
  return out;
}

Result<std::string, OrderFault> send_order_text(const std::string& session, const std::string& order,
                                                double patience_s) {
  const auto no_answer = [&session](int why) {
    return Failure{OrderFault{OrderFault::Kind::kNoAnswer,
                              "the `rtbus run` of session " + session +
                                  " does not answer: " + (why == EAGAIN ? "no reply in time" : std::strerror(why))}};
  };
  const auto seconds = static_cast<time_t>(patience_s);
  const timeval patience{seconds, static_cast<suseconds_t>(1e6 * (patience_s - static_cast<double>(seconds)))};
  int fd = -1;
  for (const std::string& path : order_socket_paths(session)) {
    if ((fd = connect_to(path, patience)) >= 0) break;
    if (errno == EAGAIN) return no_answer(EAGAIN);
  }
  if (fd < 0) {
    return Failure{OrderFault{OrderFault::Kind::kNobodyServes,
                              "session " + session + " takes no orders: no `rtbus run` of this user serves it"}};
  }
  std::array<char, kLongestOrder> reply;
  ssize_t got = ::send(fd, order.data(), order.size(), MSG_NOSIGNAL);
  if (got >= 0) got = ::recv(fd, reply.data(), reply.size(), 0);
  const int why = errno;
  ::close(fd);
  if (got < 0) return no_answer(why);
  return std::string(reply.data(), static_cast<std::size_t>(got));
}

}  // namespace rtbus
