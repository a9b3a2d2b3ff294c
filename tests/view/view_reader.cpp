// Looks at a viewer as a fast page would, without a browser: acknowledges every frame, and prints how much came.
//   view_reader PORT KEY SECONDS
#include <sys/socket.h>

#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <string>

#include "rtbus/clock.hpp"
#include "tests/view/view_server.hpp"

namespace {

bool receive(int fd, void* out, std::size_t size) {
  for (std::size_t done = 0; done < size;) {
    const ssize_t got = ::recv(fd, static_cast<char*>(out) + done, size - done, 0);
    if (got <= 0) return false;
    done += static_cast<std::size_t>(got);
  }
  return true;
}

/// One message of the server, which never sends them in pieces. Empty: the connection has ended.
std::string message(int fd) {
  std::uint8_t head[2];
  if (!receive(fd, head, sizeof head)) return "";
  std::uint64_t size = head[1] & 127U;
  std::uint8_t more[8];
  const std::size_t bytes = size == 127 ? 8 : size == 126 ? 2 : 0;
  if (!receive(fd, more, bytes)) return "";
  if (bytes > 0) size = 0;
  for (std::size_t i = 0; i < bytes; ++i) size = size << 8U | more[i];
  std::string text(size, '\0');
  return receive(fd, text.data(), text.size()) ? text : "";
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 4) {
    std::fputs("usage: view_reader PORT KEY SECONDS\n", stderr);
    return 2;
  }
  tests::Visitor visitor(std::atoi(argv[1]));
  const std::string host = std::string("127.0.0.1:") + argv[1];
  if (visitor.upgrade(host, "http://" + host).find("101") == std::string::npos) return 1;
  visitor.say(tests::Visitor::text_frame(std::string(R"({"token":")") + argv[2] + "\"}"));
  const std::uint64_t begin_ns = rtbus::monotonic_ns(), end_ns = begin_ns + rtbus::ns_of(std::atof(argv[3]));
  std::uint64_t frames = 0, bytes = 0;
  while (rtbus::monotonic_ns() < end_ns) {
    const std::string text = message(visitor.fd());
    if (text.empty()) break;
    bytes += text.size();
    if (!text.starts_with("RBV1")) continue;
    ++frames;
    std::uint64_t number = 0;
    std::memcpy(&number, text.data() + 8, sizeof number);
    visitor.say(tests::Visitor::text_frame("{\"ack\":" + std::to_string(number) + "}"));
  }
  const double seconds = rtbus::seconds_between(begin_ns, rtbus::monotonic_ns());
  std::printf("%.1f frames/s, %.3f MB/s\n", static_cast<double>(frames) / seconds,
              1e-6 * static_cast<double>(bytes) / seconds);
  return frames > 0 ? 0 : 1;
}
