#include "drivers/virtual_usb/usbip_server.hpp"

#include <arpa/inet.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <map>
#include <utility>

#include "drivers/virtual_usb/usbip_wire.hpp"
#include "rtbus/clock.hpp"

namespace drivers::virtual_usb {

using usbip::Bytes;

namespace {

constexpr std::size_t kMostClients = 8;
/// A client that reads nothing while answers pile up is dropped.
constexpr std::size_t kLongestBacklog = 8u << 20;
constexpr std::uint64_t kLongestSleepNs = 100 * rtbus::kNsPerMs;
constexpr int kAlreadyTakenBack = -104;  // ECONNRESET, as RET_UNLINK reports a transfer that was still pending

}  // namespace

struct UsbipServer::Client {
  int fd = -1;
  Bytes in;
  Bytes out;
  bool broken = false;
  bool closing = false;                     ///< Once everything is out.
  std::map<std::uint32_t, bool> in_flight;  ///< Sequence number → IN.
};

UsbipServer::UsbipServer(VirtualDevice device, int listener, std::uint16_t port)
    : device_(std::move(device)), queue_(*device_.device), listener_(listener), port_(port) {
  if (device_.faults.unplug_at_s >= 0.0) {
    unplug_ns_ = rtbus::monotonic_ns() + static_cast<std::uint64_t>(device_.faults.unplug_at_s * 1e9);
  }
}

UsbipServer::~UsbipServer() {
  for (const Client& client : clients_) ::close(client.fd);
  ::close(listener_);
}

rtbus::Result<std::unique_ptr<UsbipServer>, std::string> UsbipServer::listen(VirtualDevice device,
                                                                             const std::string& address,
                                                                             std::uint16_t port) {
  sockaddr_in where{};
  where.sin_family = AF_INET;
  where.sin_port = htons(port);
  if (::inet_pton(AF_INET, address.c_str(), &where.sin_addr) != 1) {
    return rtbus::Failure{address + " is no IPv4 address"};
  }
  const int fd = ::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
  const auto failed = [&](const char* what) {
    const std::string text =
        address + ":" + std::to_string(port) + ": " + what + ": " + std::strerror(errno) +
        (errno == EADDRINUSE ? "; another server has it (usbipd?): end it or choose another port" : "");
    if (fd >= 0) ::close(fd);
    return rtbus::Failure{text};
  };
  if (fd < 0) return failed("socket");
  const int on = 1;
  ::setsockopt(fd, SOL_SOCKET, SO_REUSEADDR, &on, sizeof on);
  if (::bind(fd, reinterpret_cast<const sockaddr*>(&where), sizeof where) != 0) return failed("bind");
  if (::listen(fd, 4) != 0) return failed("listen");
  socklen_t size = sizeof where;
  if (::getsockname(fd, reinterpret_cast<sockaddr*>(&where), &size) != 0) return failed("getsockname");
  return std::unique_ptr<UsbipServer>(new UsbipServer(std::move(device), fd, ntohs(where.sin_port)));
}

void UsbipServer::tell(const std::string& text) const {
  if (on_event) on_event(text);
}

std::uint64_t UsbipServer::play(std::uint64_t now_ns) {
  if (now_ns >= unplug_ns_) {
    unplug_ns_ = kNever;
    if (device_.faults.replug_after_s >= 0.0) {
      replug_ns_ = now_ns + static_cast<std::uint64_t>(device_.faults.replug_after_s * 1e9);
    }
    if (attached_ != nullptr) attached_->broken = true;  // closing the connection is the unplugging
    detach("unplugged");
    queue_.unplug();
    tell("the device is unplugged");
  }
  if (now_ns >= replug_ns_) {
    replug_ns_ = kNever;
    queue_.plug(now_ns);
    tell("the device is plugged in again");
  }
  const std::uint64_t next_ns = queue_.pump(now_ns);
  answer_done();
  return std::min({next_ns, unplug_ns_, replug_ns_});
}

void UsbipServer::run(const std::function<bool()>& stopping) {
  std::vector<pollfd> wanted;
  while (!stopping()) {
    const std::uint64_t next_ns = play(rtbus::monotonic_ns());
    for (Client& client : clients_) flush(client);
    const std::size_t clients = clients_.size();
    for (auto client = clients_.begin(); client != clients_.end();) {
      const bool over = client->broken || (client->closing && client->out.empty());
      if (!over) {
        ++client;
        continue;
      }
      if (attached_ == &*client) detach("detached");
      ::close(client->fd);
      client = clients_.erase(client);
    }
    wanted.assign(1, pollfd{listener_, static_cast<short>(clients_.size() < kMostClients ? POLLIN : 0), 0});
    for (const Client& client : clients_) {
      const short events = client.out.empty() ? POLLIN : POLLIN | POLLOUT;
      wanted.push_back({client.fd, events, 0});
    }
    const std::uint64_t now_ns = rtbus::monotonic_ns();
    const bool waits = next_ns > now_ns && clients_.size() == clients;
    const std::uint64_t sleep_ns = waits ? std::min(next_ns - now_ns, kLongestSleepNs) : 0;
    timespec patience{};
    patience.tv_nsec = static_cast<long>(sleep_ns);
    if (::ppoll(wanted.data(), wanted.size(), &patience, nullptr) <= 0) continue;
    auto event = wanted.begin() + 1;
    for (Client& client : clients_) {
      if (event->revents != 0) take_input(client);
      ++event;
    }
    if (wanted.front().revents != 0) accept_client();
  }
  detach("the server ends");
}

void UsbipServer::accept_client() {
  const int fd = ::accept4(listener_, nullptr, nullptr, SOCK_CLOEXEC | SOCK_NONBLOCK);
  if (fd < 0) return;
  const int on = 1;
  ::setsockopt(fd, IPPROTO_TCP, TCP_NODELAY, &on, sizeof on);
  clients_.emplace_back();
  clients_.back().fd = fd;
}

void UsbipServer::take_input(Client& client) {
  std::uint8_t buffer[16384];
  for (;;) {
    const ssize_t got = ::recv(client.fd, buffer, sizeof buffer, MSG_DONTWAIT);
    if (got > 0) {
      client.in.insert(client.in.end(), buffer, buffer + got);
      if (!client.closing && !digest(client)) client.broken = true;
      if (client.broken) return;
      continue;
    }
    if (got == 0 || (errno != EAGAIN && errno != EINTR)) client.broken = true;
    return;
  }
}

bool UsbipServer::digest(Client& client) {
  for (;;) {
    std::size_t used = 0;
    if (!(attached_ == &client ? digest_urb(client, used) : digest_op(client, used))) return false;
    if (used == 0) return true;  // the rest has yet to come
    client.in.erase(client.in.begin(), client.in.begin() + static_cast<std::ptrdiff_t>(used));
    if (client.closing) return true;
  }
}

bool UsbipServer::digest_op(Client& client, std::size_t& used) {
  if (client.in.size() < usbip::kOpHeader) return true;
  const std::uint16_t version = usbip::get16(client.in, 0);
  const auto code = static_cast<usbip::OpCode>(usbip::get16(client.in, 2));
  if (version != usbip::kVersion) return false;
  const Descriptors* const device = queue_.plugged() ? &device_.device->descriptors() : nullptr;
  if (code == usbip::OpCode::kReqDevlist) {
    client.out = usbip::devlist_reply(device);
    client.closing = true;
    used = usbip::kOpHeader;
    return true;
  }
  if (code != usbip::OpCode::kReqImport) return false;
  if (client.in.size() < usbip::kImportSize) return true;
  used = usbip::kImportSize;
  const auto* const name = reinterpret_cast<const char*>(client.in.data() + usbip::kOpHeader);
  const std::string_view bus_id(name, ::strnlen(name, usbip::kImportSize - usbip::kOpHeader));
  const bool granted = device != nullptr && bus_id == usbip::kBusId && attached_ == nullptr;
  const Bytes reply = usbip::import_reply(granted ? device : nullptr);
  client.out.insert(client.out.end(), reply.begin(), reply.end());
  if (granted) {
    attach(client);
  } else {
    client.closing = true;
  }
  return true;
}

void UsbipServer::attach(Client& client) {
  attached_ = &client;
  queue_.plug(rtbus::monotonic_ns());
  tell("attached");
}

void UsbipServer::detach(const std::string& why) {
  if (attached_ == nullptr) return;
  attached_ = nullptr;
  queue_.forget();
  tell(why);
}

bool UsbipServer::digest_urb(Client& client, std::size_t& used) {
  if (client.in.size() < usbip::kUrbHeader) return true;
  usbip::UrbHeader header;
  if (!usbip::parse_urb_header(client.in, header)) return false;
  const std::uint64_t now_ns = rtbus::monotonic_ns();
  if (header.command == usbip::Command::kUnlink) {
    used = usbip::kUrbHeader;
    Urb urb;
    const bool pending = queue_.discard(header.unlink, urb);
    client.in_flight.erase(header.unlink);
    const Bytes reply = usbip::unlink_reply(header.sequence, pending ? kAlreadyTakenBack : 0);
    client.out.insert(client.out.end(), reply.begin(), reply.end());
    return true;
  }
  const std::size_t payload = header.in ? 0 : header.length;
  if (client.in.size() < usbip::kUrbHeader + payload) return true;
  used = usbip::kUrbHeader + payload;
  if (!client.in_flight.emplace(header.sequence, header.in).second) return false;  // the number is in use
  Urb urb;
  urb.id = header.sequence;
  urb.endpoint =
      header.endpoint == 0 ? std::uint8_t{0} : static_cast<std::uint8_t>(header.endpoint | (header.in ? 0x80 : 0));
  urb.setup = header.setup;
  urb.setup_length = std::min<std::uint16_t>(
      header.setup_length, static_cast<std::uint16_t>(std::min<std::uint32_t>(header.length, 0xffff)));
  urb.length = header.length;
  urb.short_not_ok = (header.flags & 0x01) != 0;
  urb.zero_packet = (header.flags & 0x40) != 0;
  if (!header.in) {
    urb.data.assign(client.in.begin() + usbip::kUrbHeader,
                    client.in.begin() + static_cast<std::ptrdiff_t>(usbip::kUrbHeader + payload));
  }
  queue_.submit(std::move(urb), now_ns);
  queue_.pump(now_ns);
  answer_done();
  return true;
}

void UsbipServer::answer_done() {
  Urb urb;
  while (queue_.take_done(urb)) {
    if (attached_ == nullptr) continue;
    const auto sequence = static_cast<std::uint32_t>(urb.id);
    const auto flight = attached_->in_flight.find(sequence);
    if (flight == attached_->in_flight.end()) continue;
    const Bytes reply = usbip::submit_reply(sequence, flight->second, urb.status, urb.actual, urb.data);
    attached_->in_flight.erase(flight);
    attached_->out.insert(attached_->out.end(), reply.begin(), reply.end());
  }
}

void UsbipServer::flush(Client& client) {
  while (!client.out.empty() && !client.broken) {
    const ssize_t sent = ::send(client.fd, client.out.data(), client.out.size(), MSG_NOSIGNAL | MSG_DONTWAIT);
    if (sent > 0) {
      client.out.erase(client.out.begin(), client.out.begin() + sent);
    } else {
      if (errno != EAGAIN && errno != EINTR) client.broken = true;
      break;
    }
  }
  if (client.out.size() > kLongestBacklog) client.broken = true;
}

}  // namespace drivers::virtual_usb
