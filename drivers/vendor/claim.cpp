#include "drivers/vendor/claim.hpp"

#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstddef>
#include <cstring>
#include <fstream>
#include <utility>

namespace drivers::vendor {
namespace {

/// Of the owner's socket: "@rtbus owner of DEVICE: OWNER (pid N)", cut to what a socket's name may have.
std::string owner_prefix(const std::string& device) { return "rtbus owner of " + device; }

std::string own_pid() { return " (pid " + std::to_string(::getpid()) + ")"; }

/// The owner in the first socket whose name begins so and does not end with `except`; empty: there is none.
std::string first_owner(const std::string& prefix, const std::string& except) {
  std::ifstream sockets("/proc/net/unix");
  for (std::string line; std::getline(sockets, line);) {
    const std::size_t at = line.find("@" + prefix);
    if (at == line.npos || (!except.empty() && line.ends_with(except))) continue;
    const std::size_t colon = line.find(": ", at);
    if (colon != line.npos) return line.substr(colon + 2);
  }
  return {};
}

/// A socket bound to an abstract name. −1, with errno: it is not.
int bound(std::string name) {
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  name.resize(std::min(name.size(), sizeof address.sun_path - 1));
  std::memcpy(address.sun_path + 1, name.data(), name.size());  // the first byte, 0, makes it abstract
  const int fd = ::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0);
  if (fd < 0) return -1;
  const auto bytes = static_cast<socklen_t>(offsetof(sockaddr_un, sun_path) + 1 + name.size());
  if (::bind(fd, reinterpret_cast<const sockaddr*>(&address), bytes) == 0) return fd;
  const int error = errno;
  ::close(fd);
  errno = error;
  return -1;
}

}  // namespace

Claim::Claim(Claim&& other) noexcept : claim_(std::exchange(other.claim_, -1)), name_(std::exchange(other.name_, -1)) {}

Claim& Claim::operator=(Claim&& other) noexcept {
  if (this == &other) return *this;
  release();
  claim_ = std::exchange(other.claim_, -1);
  name_ = std::exchange(other.name_, -1);
  return *this;
}

void Claim::release() noexcept {
  for (int* const fd : {&name_, &claim_}) {
    if (*fd >= 0) ::close(*fd);
    *fd = -1;
  }
}

rtbus::Result<Claim, std::string> Claim::take(const std::string& device, const std::string& owner) {
  Claim out;
  out.claim_ = bound("rtbus device " + device);
  if (out.claim_ >= 0) {
    out.name_ = bound(owner_prefix(device) + ": " + owner + own_pid());
    return out;
  }
  if (errno != EADDRINUSE) return out;  // without sockets nobody can be asked: as if there were no claims
  const std::string who = first_owner(owner_prefix(device) + ": ", "");
  return rtbus::Failure{who.empty() ? "another session" : who};
}

std::string other_owner(const std::string& device) { return first_owner(owner_prefix(device), own_pid()); }

}  // namespace drivers::vendor
