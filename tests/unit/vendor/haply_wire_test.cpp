// What RFC 6455 allows and a simple exchange of texts never shows, in both directions: our client against the stand-in
// for the Inverse Service, and that against a client of this test that writes its frames itself.
#include <arpa/inet.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <cstdint>
#include <string>
#include <string_view>

#include "drivers/haply/web_socket.hpp"
#include "drivers/virtual_vendor/haply/service.hpp"
#include "rtbus/clock.hpp"

namespace drivers::haply {
namespace {

namespace stand_in = virtual_vendor::haply;
using ::testing::HasSubstr;

constexpr std::uint64_t kPatienceNs = 10 * rtbus::kNsPerS;

stand_in::Settings quiet() {
  stand_in::Settings out;
  out.unit.serial = "049D";
  out.unit.call_us = 0.0;
  return out;
}

/// Our client, which has got the list of devices.
struct Client {
  explicit Client(const stand_in::Settings& settings) : service(settings) {
    EXPECT_EQ(socket.connect("127.0.0.1", service.port(), stop), "");
    EXPECT_EQ(receive(), WireStatus::kOk) << "the list of devices";
  }
  WireStatus send(std::string_view message) { return socket.send(message, rtbus::monotonic_ns() + kPatienceNs); }
  WireStatus receive() {
    std::string_view got;
    const WireStatus status = socket.receive(got, rtbus::monotonic_ns() + kPatienceNs);
    text = got;
    return status;
  }

  stand_in::Service service;
  io::StopFlag stop;
  WebSocket socket;
  std::string text;
};

TEST(InverseServiceWire, APingBetweenTwoFragmentsIsAnsweredAndTheAnswerStaysWhole) {
  stand_in::Settings settings = quiet();
  settings.fragments = settings.ping_within = true;
  Client client(settings);
  for (int i = 0; i < 3; ++i) {
    ASSERT_EQ(client.send("{}"), WireStatus::kOk);
    ASSERT_EQ(client.receive(), WireStatus::kOk);
    EXPECT_TRUE(client.text.starts_with("{\"inverse3\":[") && client.text.ends_with("]}")) << client.text;
  }
  // Pongs are written while the client serves its socket.
  const std::uint64_t until_ns = rtbus::monotonic_ns() + kPatienceNs;
  while (client.service.pongs() < 3 && rtbus::monotonic_ns() < until_ns) {
    ASSERT_EQ(client.send("{}"), WireStatus::kOk);
    ASSERT_EQ(client.receive(), WireStatus::kOk);
  }
  EXPECT_GE(client.service.pongs(), 3);
}

TEST(InverseServiceWire, ACloseTellsItsCodeAndReason) {
  stand_in::Settings settings = quiet();
  settings.close_at_s = 0.0;
  settings.close_code = 1011;
  Client client(settings);
  WireStatus status = WireStatus::kOk;
  const std::uint64_t until_ns = rtbus::monotonic_ns() + kPatienceNs;
  while (status == WireStatus::kOk && rtbus::monotonic_ns() < until_ns) {
    status = client.send("{}");
    if (status == WireStatus::kOk) status = client.receive();
  }
  EXPECT_EQ(status, WireStatus::kClosed);
  EXPECT_EQ(client.socket.why_closed(), " (code 1011: restarting)");
}

TEST(InverseServiceWire, ABinaryFrameIsRefused) {
  stand_in::Settings settings = quiet();
  settings.binary = true;
  stand_in::Service service(settings);
  io::StopFlag stop;
  WebSocket socket;
  ASSERT_EQ(socket.connect("127.0.0.1", service.port(), stop), "");
  std::string_view text;
  EXPECT_EQ(socket.receive(text, rtbus::monotonic_ns() + kPatienceNs), WireStatus::kClosed);
  EXPECT_EQ(socket.why_closed(), " (it sent a binary frame)");
}

TEST(InverseServiceWire, AMessageOfMoreThanOneMebibyteIsRefused) {
  stand_in::Settings settings = quiet();
  settings.answer_bytes = 1'100'000;
  Client client(settings);
  ASSERT_EQ(client.send("{}"), WireStatus::kOk);
  EXPECT_EQ(client.receive(), WireStatus::kClosed);
  EXPECT_THAT(client.socket.why_closed(), HasSubstr("more than 1 MiB"));
}

// Lengths around the borders of a frame's 7, 16 and 64 bits, and of the library's buffer of 64 KiB.
class LongText : public ::testing::TestWithParam<int> {};

TEST_P(LongText, GoesBothWays) {
  stand_in::Settings settings = quiet();
  settings.answer_bytes = GetParam();
  Client client(settings);
  const std::string message = "{\"padding\":\"" + std::string(static_cast<std::size_t>(GetParam()), 'x') + "\"}";
  for (int i = 0; i < 2; ++i) {
    ASSERT_EQ(client.send(message), WireStatus::kOk);
    ASSERT_EQ(client.receive(), WireStatus::kOk);
    EXPECT_EQ(client.text.size(), static_cast<std::size_t>(GetParam()));
    EXPECT_TRUE(client.text.starts_with("{\"inverse3\":[") && client.text.ends_with("\"}"));
  }
}

INSTANTIATE_TEST_SUITE_P(InverseServiceWire, LongText, ::testing::Values(65'535, 65'536, 65'537, 200'000));

/// A client that writes what it is told to, byte by byte.
class RawClient {
 public:
  explicit RawClient(int port) : fd_(::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0)) {
    sockaddr_in to{};
    to.sin_family = AF_INET;
    to.sin_port = htons(static_cast<std::uint16_t>(port));
    to.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    EXPECT_EQ(::connect(fd_, reinterpret_cast<const sockaddr*>(&to), sizeof to), 0);
    write(
        "GET / HTTP/1.1\r\nHost: 127.0.0.1\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
        "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\nSec-WebSocket-Version: 13\r\n\r\n");
    while (received_.find("\r\n\r\n") == std::string::npos && more()) {
    }
    // The key and its answer are those of RFC 6455, section 1.3.
    EXPECT_THAT(received_, HasSubstr("s3pPLMBiTxaQ9kYGzzhZRbK+xOo="));
    received_.erase(0, received_.find("\r\n\r\n") + 4);
  }
  ~RawClient() { ::close(fd_); }
  RawClient(const RawClient&) = delete;
  RawClient& operator=(const RawClient&) = delete;

  void write(const std::string& bytes) {
    EXPECT_EQ(::send(fd_, bytes.data(), bytes.size(), MSG_NOSIGNAL), static_cast<ssize_t>(bytes.size()));
  }
  /// A frame with at most 125 bytes. `first`: FIN and opcode.
  void frame(unsigned first, const std::string& payload) {
    std::string out{static_cast<char>(first), static_cast<char>(0x80u | payload.size())};
    constexpr std::string_view key = "\x11\x22\x33\x44";  // every frame of a client is masked
    out += key;
    for (std::size_t i = 0; i < payload.size(); ++i) out += static_cast<char>(payload[i] ^ key[i % 4]);
    write(out);
  }

  struct Frame {
    unsigned first = 0;  ///< 0: none came, the connection is at its end.
    std::string payload;
  };
  Frame next() {
    const auto byte = [&](std::size_t i) { return static_cast<unsigned char>(received_[i]); };
    const auto has = [&](std::size_t bytes) {
      while (received_.size() < bytes && more()) {
      }
      return received_.size() >= bytes;
    };
    if (!has(2)) return {};
    std::size_t head = 2, length = byte(1);
    if (length == 126) {
      if (!has(4)) return {};
      head = 4;
      length = static_cast<std::size_t>(byte(2)) << 8 | byte(3);
    }
    if (!has(head + length)) return {};
    Frame out{byte(0), received_.substr(head, length)};
    received_.erase(0, head + length);
    return out;
  }

 private:
  bool more() {
    pollfd ready{fd_, POLLIN, 0};
    if (::poll(&ready, 1, 10'000) <= 0) return false;
    char buffer[4096];
    const ssize_t bytes = ::recv(fd_, buffer, sizeof buffer, 0);
    if (bytes <= 0) return false;
    received_.append(buffer, static_cast<std::size_t>(bytes));
    return true;
  }

  int fd_;
  std::string received_;
};

constexpr unsigned kFin = 0x80, kContinuation = 0, kText = 1, kBinary = 2, kClose = 8, kPing = 9, kPong = 10;

std::string close_code(const RawClient::Frame& frame) {
  if (frame.first != (kFin | kClose) || frame.payload.size() < 2) return "no close";
  return std::to_string(static_cast<unsigned char>(frame.payload[0]) << 8 |
                        static_cast<unsigned char>(frame.payload[1]));
}

TEST(InverseServiceWire, TheStandInAnswersAPingWithinAFragmentedMessageAndThatOnce) {
  stand_in::Service service(quiet());
  RawClient client(service.port());
  EXPECT_THAT(client.next().payload, HasSubstr("session_id"));
  client.frame(kText, "{\"inve");
  client.frame(kFin | kPing, "there?");
  client.frame(kContinuation, "rse3\":");
  client.frame(kFin | kContinuation, "[]}");
  const RawClient::Frame pong = client.next();
  EXPECT_EQ(pong.first, kFin | kPong);
  EXPECT_EQ(pong.payload, "there?");
  EXPECT_THAT(client.next().payload, HasSubstr("cursor_position"));
  client.frame(kFin | kPing, "last");
  EXPECT_EQ(client.next().payload, "last") << "three fragments were one message: one answer";
}

TEST(InverseServiceWire, TheStandInAnswersACloseWithItsCode) {
  stand_in::Service service(quiet());
  RawClient client(service.port());
  EXPECT_THAT(client.next().payload, HasSubstr("session_id"));
  client.frame(kFin | kClose, std::string("\x03\xe8", 2) + "done");  // 1000
  EXPECT_EQ(close_code(client.next()), "1000");
  EXPECT_EQ(client.next().first, 0u);
}

TEST(InverseServiceWire, TheStandInRefusesABinaryFrame) {
  stand_in::Service service(quiet());
  RawClient client(service.port());
  EXPECT_THAT(client.next().payload, HasSubstr("session_id"));
  client.frame(kFin | kBinary, "{}");
  EXPECT_EQ(close_code(client.next()), "1003");
}

}  // namespace
}  // namespace drivers::haply
