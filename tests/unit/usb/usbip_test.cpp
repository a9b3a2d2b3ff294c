// The USB/IP server, asked by a plain socket as the Linux kernel would ask it, and by clients that talk nonsense.
#include <arpa/inet.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <atomic>
#include <thread>

#include "drivers/virtual_usb/usbip_server.hpp"
#include "drivers/virtual_usb/usbip_wire.hpp"
#include "tests/support/echo_device.hpp"

namespace drivers::virtual_usb {
namespace {

using testing::ElementsAre;
using testing::ElementsAreArray;
using usbip::Bytes;

Bytes words(std::initializer_list<std::uint32_t> values) {
  Bytes out;
  for (const std::uint32_t value : values) {
    for (int shift = 24; shift >= 0; shift -= 8) out.push_back(static_cast<std::uint8_t>(value >> shift & 0xff));
  }
  return out;
}
Bytes join(Bytes first, const Bytes& second) {
  first.insert(first.end(), second.begin(), second.end());
  return first;
}
Bytes submit(std::uint32_t sequence, bool in, std::uint32_t endpoint, std::uint32_t length, Bytes setup = Bytes(8)) {
  return join(words({1, sequence, 0x10002, in ? 1u : 0u, endpoint, in ? 0x200u : 0u, length, 0, 0xffffffff, 0}), setup);
}
Bytes unlink(std::uint32_t sequence, std::uint32_t victim) {
  return join(words({2, sequence, 0x10002, 0, 0, victim}), Bytes(24));
}
Bytes import() {
  Bytes out = words({0x01118003, 0});
  out.resize(40, 0);
  std::copy(usbip::kBusId.begin(), usbip::kBusId.end(), out.begin() + 8);
  return out;
}

/// A connection to a server.
class Socket {
 public:
  explicit Socket(std::uint16_t port) : fd_(::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0)) {
    sockaddr_in where{};
    where.sin_family = AF_INET;
    where.sin_port = htons(port);
    where.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    EXPECT_EQ(::connect(fd_, reinterpret_cast<sockaddr*>(&where), sizeof where), 0);
    const timeval patience{10, 0};
    ::setsockopt(fd_, SOL_SOCKET, SO_RCVTIMEO, &patience, sizeof patience);
  }
  ~Socket() { close(); }
  Socket(const Socket&) = delete;
  Socket& operator=(const Socket&) = delete;
  void close() {
    if (fd_ >= 0) ::close(fd_);
    fd_ = -1;
  }
  void send(const Bytes& bytes) const {
    EXPECT_EQ(::send(fd_, bytes.data(), bytes.size(), MSG_NOSIGNAL), static_cast<ssize_t>(bytes.size()));
  }
  /// Exactly so many bytes, or fewer when the server closes first.
  Bytes receive(std::size_t size) const {
    Bytes out(size);
    std::size_t have = 0;
    while (have < size) {
      const ssize_t got = ::recv(fd_, out.data() + have, size - have, 0);
      if (got <= 0) break;
      have += static_cast<std::size_t>(got);
    }
    out.resize(have);
    return out;
  }
  /// True when the server has closed, whatever it said before.
  bool closed() const {
    char byte;
    ssize_t got = 1;
    while (got > 0) got = ::recv(fd_, &byte, 1, 0);
    return got == 0 || errno == ECONNRESET;
  }

 private:
  int fd_;
};

class UsbipServerTest : public testing::Test {
 protected:
  void serve(Faults faults = {}) {
    auto device = std::make_unique<tests::EchoDevice>();
    device_ = device.get();
    auto server = UsbipServer::listen({std::move(device), faults}, "127.0.0.1", 0);
    ASSERT_TRUE(server) << server.error();
    server_ = std::move(*server);
    thread_ = std::thread([this] { server_->run([this] { return stop_.load(); }); });
  }
  void TearDown() override {
    stop_.store(true);
    if (thread_.joinable()) thread_.join();
  }
  std::unique_ptr<Socket> attach() {
    auto socket = std::make_unique<Socket>(server_->port());
    socket->send(import());
    const Bytes reply = socket->receive(320);
    EXPECT_EQ(reply.size(), 320u);
    EXPECT_EQ(usbip::get32(reply, 4), 0u);
    return socket;
  }
  /// A bulk echo there and back, as two transfers.
  void expect_echo(Socket& socket, std::uint32_t sequence) {
    socket.send(submit(sequence, true, 1, 64));
    socket.send(join(submit(sequence + 1, false, 2, 3), {7, 8, 9}));
    const Bytes first = socket.receive(48);
    ASSERT_EQ(first.size(), 48u);
    EXPECT_EQ(usbip::get32(first, 0), 3u);
    EXPECT_EQ(usbip::get32(first, 4), sequence + 1);
    EXPECT_EQ(usbip::get32(first, 20), 0u);
    EXPECT_EQ(usbip::get32(first, 24), 3u);
    const Bytes second = socket.receive(51);
    ASSERT_EQ(second.size(), 51u);
    EXPECT_EQ(usbip::get32(second, 4), sequence);
    EXPECT_THAT(Bytes(second.begin() + 48, second.end()), ElementsAre(7, 8, 9));
  }

  tests::EchoDevice* device_ = nullptr;  // the server's thread owns it while it runs
  std::unique_ptr<UsbipServer> server_;
  std::atomic<bool> stop_{false};
  std::thread thread_;
};

TEST(UsbipWire, DevlistHasTheDeviceRecordAndItsInterfaces) {
  const tests::EchoDevice device;
  const Bytes reply = usbip::devlist_reply(&device.descriptors());
  ASSERT_EQ(reply.size(), 8u + 4 + 312 + 4);
  EXPECT_THAT(Bytes(reply.begin(), reply.begin() + 12), ElementsAreArray({1, 0x11, 0, 5, 0, 0, 0, 0, 0, 0, 0, 1}));
  EXPECT_EQ(std::string(reinterpret_cast<const char*>(&reply[12 + 256])), "1-1");
  // busnum 1, devnum 2, full speed, 1209:0001, bcdDevice 0100, class ff/00/00, configuration 1 of 1, 1 interface
  EXPECT_THAT(Bytes(reply.begin() + 12 + 288, reply.begin() + 12 + 312),
              ElementsAreArray({0, 0, 0, 1, 0, 0, 0, 2, 0, 0, 0, 2, 0x12, 0x09, 0, 1, 1, 0, 0xff, 0, 0, 1, 1, 1}));
  EXPECT_THAT(Bytes(reply.end() - 4, reply.end()), ElementsAre(0xff, 0xff, 0xff, 0));
  EXPECT_EQ(usbip::devlist_reply(nullptr).size(), 12u);
}

TEST(UsbipWire, ImportIsTheRecordWithoutInterfaces) {
  const tests::EchoDevice device;
  EXPECT_EQ(usbip::import_reply(&device.descriptors()).size(), 320u);
  EXPECT_THAT(usbip::import_reply(nullptr), ElementsAre(1, 0x11, 0, 3, 0, 0, 0, 1));
}

TEST(UsbipWire, HeadersAreReadAndNonsenseRefused) {
  usbip::UrbHeader header;
  ASSERT_TRUE(usbip::parse_urb_header(submit(5, true, 0, 18, {0x80, 6, 0, 1, 0, 0, 18, 0}), header));
  EXPECT_EQ(header.sequence, 5u);
  EXPECT_TRUE(header.in);
  EXPECT_EQ(header.setup.value, 0x0100);
  EXPECT_EQ(header.setup_length, 18);
  ASSERT_TRUE(usbip::parse_urb_header(unlink(6, 5), header));
  EXPECT_EQ(header.unlink, 5u);
  EXPECT_FALSE(usbip::parse_urb_header(Bytes(47), header));
  EXPECT_FALSE(usbip::parse_urb_header(Bytes(48), header)) << "command 0";
  EXPECT_FALSE(usbip::parse_urb_header(submit(1, true, 16, 8), header)) << "endpoint 16";
  EXPECT_FALSE(usbip::parse_urb_header(submit(1, true, 1, 0x7fffffff), header)) << "2 GiB";
  EXPECT_FALSE(usbip::parse_urb_header(submit(1, false, 0, 4, {0x80, 6, 0, 1, 0, 0, 4, 0}), header))
      << "set-up says IN, the header OUT";
}

TEST(UsbipWire, RepliesAre48BytesAndTheData) {
  const Bytes data{1, 2, 3};
  EXPECT_THAT(usbip::submit_reply(9, true, 0, 3, data),
              ElementsAreArray(join(words({3, 9, 0, 0, 0, 0, 3, 0, 0xffffffff, 0, 0, 0}), data)));
  EXPECT_THAT(usbip::submit_reply(9, false, -32, 0, {}),
              ElementsAreArray(words({3, 9, 0, 0, 0, 0xffffffe0, 0, 0, 0xffffffff, 0, 0, 0})));
  EXPECT_THAT(usbip::unlink_reply(9, -104), ElementsAreArray(words({4, 9, 0, 0, 0, 0xffffff98, 0, 0, 0, 0, 0, 0})));
}

TEST_F(UsbipServerTest, ListsTheDeviceAndCloses) {
  serve();
  const Socket socket(server_->port());
  socket.send(words({0x01118005, 0}));
  EXPECT_EQ(socket.receive(328).size(), 328u);
  EXPECT_TRUE(socket.closed());
}

TEST_F(UsbipServerTest, ImportsAndEchoes) {
  serve();
  const auto socket = attach();
  for (std::uint32_t i = 1; i < 100; i += 2) expect_echo(*socket, i);
}

TEST_F(UsbipServerTest, EnumeratesAsTheKernelDoes) {
  serve();
  const auto socket = attach();
  socket->send(submit(1, true, 0, 64, {0x80, 6, 0, 1, 0, 0, 64, 0}));
  EXPECT_EQ(socket->receive(48 + 18).size(), 66u);
  socket->send(submit(2, true, 0, 10, {0x80, 6, 0, 6, 0, 0, 10, 0}));  // device qualifier
  Bytes reply = socket->receive(48);
  EXPECT_EQ(usbip::get32(reply, 20), 0xffffffe0u) << "a full-speed device stalls it";
  socket->send(submit(3, false, 0, 0, {0x00, 9, 1, 0, 0, 0, 0, 0}));  // SET_CONFIGURATION
  reply = socket->receive(48);
  EXPECT_EQ(usbip::get32(reply, 20), 0u);
}

TEST_F(UsbipServerTest, UnlinkTakesBackWhatIsPending) {
  serve();
  const auto socket = attach();
  socket->send(submit(1, true, 1, 64));
  socket->send(unlink(2, 1));
  Bytes reply = socket->receive(48);
  EXPECT_EQ(usbip::get32(reply, 0), 4u);
  EXPECT_EQ(usbip::get32(reply, 4), 2u);
  EXPECT_EQ(usbip::get32(reply, 20), static_cast<std::uint32_t>(-104));
  socket->send(unlink(3, 1));
  reply = socket->receive(48);
  EXPECT_EQ(usbip::get32(reply, 20), 0u) << "there is nothing left to take back";
  expect_echo(*socket, 10);
}

TEST_F(UsbipServerTest, MessagesMayComeByteByByte) {
  serve();
  const auto socket = attach();
  const Bytes whole = join(submit(1, false, 2, 3), {1, 2, 3});
  for (const std::uint8_t byte : whole) socket->send({byte});
  EXPECT_EQ(socket->receive(48).size(), 48u);
}

TEST_F(UsbipServerTest, OneClientAtATimeAndTheStateSurvivesDetaching) {
  serve();
  auto first = attach();
  const Socket second(server_->port());
  second.send(import());
  EXPECT_THAT(second.receive(8), ElementsAre(1, 0x11, 0, 3, 0, 0, 0, 1));
  EXPECT_TRUE(second.closed());
  first->send(submit(1, false, 0, 0, {0x40, 1, 0x34, 0x12, 0, 0, 0, 0}));  // the echo device's value
  EXPECT_EQ(first->receive(48).size(), 48u);
  first.reset();
  // The server notices the closed connection when it looks next.
  std::unique_ptr<Socket> again;
  for (int i = 0; i < 200 && !again; ++i) {
    auto attempt = std::make_unique<Socket>(server_->port());
    attempt->send(import());
    const Bytes reply = attempt->receive(320);
    if (reply.size() == 320) again = std::move(attempt);
  }
  ASSERT_TRUE(again);
  again->send(submit(1, true, 0, 2, {0xc0, 2, 0, 0, 0, 0, 2, 0}));
  const Bytes reply = again->receive(50);
  ASSERT_EQ(reply.size(), 50u);
  EXPECT_THAT(Bytes(reply.begin() + 48, reply.end()), ElementsAre(0x34, 0x12));
}

TEST_F(UsbipServerTest, UnplugClosesTheConnectionAndReplugTakesANewOne) {
  serve({.unplug_at_s = 0.1, .replug_after_s = 0.1});
  const auto socket = attach();
  socket->send(submit(1, true, 1, 64));
  EXPECT_TRUE(socket->closed());
  std::unique_ptr<Socket> again;
  for (int i = 0; i < 2000 && !again; ++i) {
    auto attempt = std::make_unique<Socket>(server_->port());
    attempt->send(import());
    if (attempt->receive(320).size() == 320) again = std::move(attempt);
    usleep(5000);
  }
  ASSERT_TRUE(again);
  expect_echo(*again, 1);
}

TEST_F(UsbipServerTest, AnotherPortThatIsTakenIsExplained) {
  serve();
  const auto second = UsbipServer::listen({std::make_unique<tests::EchoDevice>(), {}}, "127.0.0.1", server_->port());
  ASSERT_FALSE(second);
  EXPECT_THAT(second.error(), testing::HasSubstr("another server has it"));
  EXPECT_FALSE(UsbipServer::listen({std::make_unique<tests::EchoDevice>(), {}}, "not an address", 0));
}

// It asks nobody for a password: who is on another address reaches nothing.
TEST_F(UsbipServerTest, IsReachedByItsOwnAddressAlone) {
  serve();
  const int fd = ::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
  sockaddr_in where{};
  where.sin_family = AF_INET;
  where.sin_port = htons(server_->port());
  where.sin_addr.s_addr = htonl(INADDR_LOOPBACK + 1);  // this machine, too, for a server that takes all addresses
  EXPECT_NE(::connect(fd, reinterpret_cast<sockaddr*>(&where), sizeof where), 0);
  EXPECT_EQ(errno, ECONNREFUSED);
  ::close(fd);
}

TEST_F(UsbipServerTest, NonsenseEndsThatClientAlone) {
  serve();
  std::uint32_t state = 12345;
  const auto random = [&] { return static_cast<std::uint8_t>((state = state * 1664525u + 1013904223u) >> 24); };
  for (int round = 0; round < 150; ++round) {
    Socket socket(server_->port());
    Bytes bytes(1 + random() % 200);
    for (auto& byte : bytes) byte = random();
    if (round % 3 == 0) {  // attached first
      bytes = join(import(), bytes);
      bytes.resize(std::max<std::size_t>(bytes.size(), 88));
    } else if (round % 3 == 1) {  // a well-formed beginning
      bytes = join(words({0x01118003, 0}), bytes);
    }
    socket.send(bytes);
    ::usleep(200);
  }
  // Whoever was attached last is gone as soon as the server looks.
  for (int i = 0; i < 2000; ++i) {
    Socket probe(server_->port());
    probe.send(import());
    if (probe.receive(320).size() == 320) {
      expect_echo(probe, 1);
      return;
    }
    ::usleep(2000);
  }
  FAIL() << "nobody can attach any more";
}

}  // namespace
}  // namespace drivers::virtual_usb
