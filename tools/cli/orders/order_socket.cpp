#include "tools/cli/orders/order_socket.hpp"

#include <poll.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <optional>
#include <utility>

#include "rtbus/clock.hpp"
#include "rtbus/order_client.hpp"
#include "rtbus/private_folder.hpp"
#include "rtbus/topic_directory.hpp"
#include "tools/cli/common/interrupt.hpp"

namespace tools {

namespace {

namespace fs = std::filesystem;

constexpr const char* kPrefix = "rtbus.";
constexpr const char* kSuffix = ".orders";

std::string path_in(const std::string& folder, const std::string& session) {
  return folder + "/" + kPrefix + session + kSuffix;
}

std::optional<sockaddr_un> address_of(const std::string& path) {
  sockaddr_un out{};
  out.sun_family = AF_UNIX;
  if (path.size() >= sizeof out.sun_path) return std::nullopt;
  std::memcpy(out.sun_path, path.c_str(), path.size() + 1);
  return out;
}

/// @returns a connected socket, or −1, at once.
int connect_to(const std::string& path) {
  const auto address = address_of(path);
  if (!address) return -1;
  const int fd = ::socket(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
  if (fd < 0) return -1;
  if (::connect(fd, reinterpret_cast<const sockaddr*>(&*address), sizeof *address) == 0) return fd;
  const int why = errno;
  ::close(fd);
  errno = why;
  return -1;
}

/// True when a process listens there. It sees a client that goes again.
bool is_served(const std::string& path) {
  const int fd = connect_to(path);
  if (fd < 0) return errno == EAGAIN || errno == EACCES;  // its queue is full, or it is somebody else's
  ::close(fd);
  return true;
}

/// The peer is this user or root.
bool may_order(int client) {
  ucred peer{};
  socklen_t length = sizeof peer;
  if (::getsockopt(client, SOL_SOCKET, SO_PEERCRED, &peer, &length) != 0) return false;
  return peer.uid == ::geteuid() || peer.uid == 0;
}

nlohmann::json refusal(const std::string& why) { return {{"ok", false}, {"error", why}}; }

}  // namespace

OrderSocket::OrderSocket(int listener, std::string path, Answer answer)
    : listener_(listener), path_(std::move(path)), answer_(std::move(answer)) {}

OrderSocket::~OrderSocket() {
  for (const int client : clients_) ::close(client);
  ::close(listener_);
  ::unlink(path_.c_str());
}

rtbus::Result<std::unique_ptr<OrderSocket>, std::string> OrderSocket::open(const std::string& session, Answer answer) {
  const std::string folder = rtbus::private_folder();
  if (folder.empty()) return rtbus::Failure{std::string("no private folder for the order socket: set XDG_RUNTIME_DIR")};
  const std::string path = path_in(folder, session);
  const auto address = address_of(path);
  if (!address) return rtbus::Failure{path + ": longer than the name of a socket may be; set XDG_RUNTIME_DIR"};
  if (!is_served(path)) ::unlink(path.c_str());
  const int fd = ::socket(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
  // The folder is private, so nobody connects between bind() and chmod().
  if (fd < 0 || ::bind(fd, reinterpret_cast<const sockaddr*>(&*address), sizeof *address) != 0 ||
      ::chmod(path.c_str(), 0600) != 0 || ::listen(fd, static_cast<int>(kMostClients)) != 0) {
    const std::string why = path + ": " + std::strerror(errno);
    if (fd >= 0) ::close(fd);
    return rtbus::Failure{why};
  }
  return std::unique_ptr<OrderSocket>(new OrderSocket(fd, path, std::move(answer)));
}

void OrderSocket::accept_clients() {
  for (int fd = 0; (fd = ::accept4(listener_, nullptr, nullptr, SOCK_CLOEXEC | SOCK_NONBLOCK)) >= 0;) {
    if (!may_order(fd) || clients_.size() >= kMostClients) {
      ::close(fd);
    } else {
      clients_.push_back(fd);
    }
  }
}

bool OrderSocket::answer_client(int client) {
  std::array<char, kLongestOrder> text;
  // MSG_TRUNC: the real length of a packet that is too long.
  const ssize_t got = ::recv(client, text.data(), text.size(), MSG_TRUNC);
  if (got < 0) return errno == EAGAIN || errno == EINTR;
  if (got == 0) return false;
  nlohmann::json reply;
  if (static_cast<std::size_t>(got) > text.size()) {
    reply = refusal("an order has at most " + std::to_string(kLongestOrder) + " bytes");
  } else {
    const auto order = nlohmann::json::parse(text.data(), text.data() + got, nullptr, false);
    reply =
        order.is_object() ? answer_(order) : refusal("an order is a JSON object, for example {\"order\": \"estop\"}");
  }
  const std::string out = reply.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace);
  return ::send(client, out.data(), out.size(), MSG_NOSIGNAL | MSG_DONTWAIT) >= 0;  // who does not read is let go
}

bool OrderSocket::serve(std::uint64_t duration_ns) {
  const std::uint64_t end_ns = rtbus::monotonic_ns() + duration_ns;
  for (std::uint64_t now_ns = rtbus::monotonic_ns(); now_ns < end_ns; now_ns = rtbus::monotonic_ns()) {
    if (interrupted()) return false;
    std::vector<pollfd> polled{{listener_, POLLIN, 0}};
    for (const int client : clients_) polled.push_back({client, POLLIN, 0});
    const std::uint64_t left_ns = end_ns - now_ns;
    const timespec left{static_cast<time_t>(left_ns / rtbus::kNsPerS), static_cast<long>(left_ns % rtbus::kNsPerS)};
    if (::ppoll(polled.data(), polled.size(), &left, nullptr) <= 0) continue;
    for (std::size_t i = 1; i < polled.size(); ++i) {
      if (polled[i].revents == 0 || answer_client(polled[i].fd)) continue;
      ::close(polled[i].fd);
      std::erase(clients_, polled[i].fd);
    }
    if (polled[0].revents != 0) accept_clients();
  }
  return !interrupted();
}

rtbus::Result<nlohmann::json, std::string> send_order(const std::string& session, const nlohmann::json& order,
                                                      double patience_s) {
  const auto reply = rtbus::send_order_text(session, order.dump(), patience_s);
  if (!reply) return rtbus::Failure{reply.error().sentence};
  auto parsed = nlohmann::json::parse(*reply, nullptr, false);
  if (!parsed.is_object()) return rtbus::Failure{"the `rtbus run` of session " + session + " answers nonsense"};
  return parsed;
}

std::vector<std::string> remove_dead_order_sockets(const std::string& session, bool dry_run) {
  std::vector<std::string> removed;
  const rtbus::PrivateFolders folders = rtbus::private_folders_of(::geteuid());
  std::vector<std::string> places{folders.runtime, folders.own, rtbus::private_folder()};
  std::sort(places.begin(), places.end());
  places.erase(std::unique(places.begin(), places.end()), places.end());
  for (const std::string& folder : places) {
    std::error_code error;
    for (const fs::directory_entry& entry : fs::directory_iterator(folder, error)) {
      const std::string name = entry.path().filename().string();
      if (!name.starts_with(kPrefix) || !name.ends_with(kSuffix) || !entry.is_socket(error)) continue;
      const bool named = session.empty() || name == std::string(kPrefix) + session + kSuffix;
      if (!named || is_served(entry.path().string())) continue;
      if (!dry_run && ::unlink(entry.path().c_str()) != 0) continue;
      removed.push_back(entry.path().string());
    }
  }
  return removed;
}

}  // namespace tools
