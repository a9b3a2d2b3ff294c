// What a client may send to the USB/IP server: the real server with a virtual Falcon or arm, over a socket. The first
// byte says which, and how the rest is cut into packets.
#include <arpa/inet.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <cstdint>
#include <cstdlib>
#include <vector>

#include "drivers/virtual_devices/kinds.hpp"
#include "drivers/virtual_usb/usbip_server.hpp"
#include "drivers/virtual_usb/usbip_wire.hpp"
#include "tests/support/temporary_file.hpp"

namespace {

using namespace drivers::virtual_usb;

void require(bool condition) {
  if (!condition) std::abort();
}

DeviceMaker maker_of(const char* kind) {
  static const tests::TemporaryFolder folder;
  rtbus::config::Map settings = rtbus::config::load(folder.write("device.yaml", "hand: {type: none}\n"));
  return find_kind(kind)->parse(settings);
}

int connect_to(std::uint16_t port) {
  const int fd = ::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
  sockaddr_in where{};
  where.sin_family = AF_INET;
  where.sin_port = htons(port);
  where.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  require(fd >= 0 && ::connect(fd, reinterpret_cast<const sockaddr*>(&where), sizeof where) == 0);
  const linger at_once{1, 0};  // no port stays behind in TIME_WAIT
  ::setsockopt(fd, SOL_SOCKET, SO_LINGER, &at_once, sizeof at_once);
  return fd;
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size == 0 || size > 60'000) return 0;
  static const DeviceMaker falcon = maker_of("falcon"), arm = maker_of("phantom");
  auto server = UsbipServer::listen((data[0] & 0x80) != 0 ? arm() : falcon(), "127.0.0.1", 0);
  require(static_cast<bool>(server));
  const int client = connect_to((*server)->port());
  const std::size_t cut = (data[0] & 0x7fu) * std::size_t{32} + 1;
  std::size_t at = 1;
  int rounds = 0;
  std::vector<std::uint8_t> answers(65536);
  // The next packet, or what the server says to the last one; at most some rounds after that.
  const auto stopping = [&] {
    if (at < size) {
      const std::size_t length = std::min(cut, size - at);
      if (::send(client, data + at, length, MSG_NOSIGNAL | MSG_DONTWAIT) < 0) at = size;
      at = std::min(at + length, size);
    } else if (rounds++ == 0) {
      ::shutdown(client, SHUT_WR);
    }
    const ssize_t got = ::recv(client, answers.data(), answers.size(), MSG_DONTWAIT);
    return got == 0 || rounds > 4;
  };
  (*server)->run(stopping);
  ::close(client);
  return 0;
}
