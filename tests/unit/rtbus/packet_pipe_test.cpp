#include "rtbus/packet_pipe.hpp"

#include <gtest/gtest.h>
#include <signal.h>
#include <unistd.h>

#include <limits>

#include "rtbus/clock.hpp"
#include "rtbus/messages.hpp"

namespace {

using rtbus::PacketPipe;
using rtbus::Stamped;

rtbus::Session session() {
  rtbus::Session out;
  out.name = "pipe" + std::to_string(getpid());
  return out;
}
std::uint64_t soon() { return rtbus::monotonic_ns() + 2 * rtbus::kNsPerS; }

TEST(PacketPipe, HasNoClientsBeforeItIsServed) { EXPECT_FALSE(PacketPipe::connect(session(), "haptic0")); }

TEST(PacketPipe, CarriesBothDirectionsAndKeepsTheNewest) {
  auto server = PacketPipe::serve(session(), "haptic0");
  ASSERT_TRUE(server) << server.error();
  auto client = PacketPipe::connect(session(), "haptic0");
  ASSERT_TRUE(client) << client.error();
  Stamped<rtbus::DeviceState> hand;
  for (std::uint64_t n = 1; n <= 3; ++n) {
    hand.sequence = n;
    hand.value.position_m = {0.1 * static_cast<double>(n), 0, 0};
    ASSERT_TRUE(client->send(hand));
  }
  Stamped<rtbus::DeviceState> got;
  ASSERT_TRUE(server->receive_newest(soon(), got));
  EXPECT_EQ(got.sequence, 3u);
  EXPECT_EQ(got.value.position_m, hand.value.position_m);
  EXPECT_FALSE(server->receive_newest(rtbus::monotonic_ns(), got)) << "nothing new";

  Stamped<rtbus::ProxyState> proxy;
  proxy.value.step_index = 77;
  ASSERT_TRUE(server->send(proxy));
  Stamped<rtbus::ProxyState> back;
  ASSERT_TRUE(client->receive_newest(soon(), back));
  EXPECT_EQ(back.value.step_index, 77u);
}

TEST(PacketPipe, DropsPacketsOfAnotherTypeAndBytesOfAnotherProgram) {
  auto server = PacketPipe::serve(session(), "haptic0");
  auto client = PacketPipe::connect(session(), "haptic0");
  ASSERT_TRUE(server && client);
  ASSERT_TRUE(client->send(Stamped<rtbus::ProxyState>{}));
  Stamped<rtbus::DeviceState> got;
  EXPECT_FALSE(server->receive_newest(soon(), got));
  EXPECT_EQ(server->refused(), 1u);
  ASSERT_TRUE(client->send(Stamped<rtbus::DeviceState>{9, 0, {}})) << "and goes on with good ones";
  ASSERT_TRUE(server->receive_newest(soon(), got));
  EXPECT_EQ(got.sequence, 9u);
}

TEST(PacketPipe, DropsSamplesThatAreNotSaneAndCountsThem) {
  auto server = PacketPipe::serve(session(), "haptic0");
  auto client = PacketPipe::connect(session(), "haptic0");
  ASSERT_TRUE(server && client);
  Stamped<rtbus::DeviceState> wrong;
  wrong.value.position_m[1] = std::numeric_limits<double>::quiet_NaN();
  ASSERT_TRUE(client->send(wrong));
  Stamped<rtbus::DeviceState> got;
  EXPECT_FALSE(server->receive_newest(soon(), got));
  EXPECT_EQ(server->refused(), 1u);
}

TEST(PacketPipe, NeverWaitsForAReaderThatDoesNotRead) {
  auto server = PacketPipe::serve(session(), "haptic0");
  auto client = PacketPipe::connect(session(), "haptic0");
  ASSERT_TRUE(server && client);
  int sent = 0;
  for (int i = 0; i < 10'000; ++i) sent += server->send(Stamped<rtbus::ProxyState>{}) ? 1 : 0;
  EXPECT_GT(sent, 10);
  EXPECT_LT(sent, 10'000) << "a full pipe drops";
}

TEST(PacketPipe, TellsTheClientThatTheServerHasGoneAndLeavesNoNameBehind) {
  ::signal(SIGPIPE, SIG_IGN);
  auto client = [] {
    auto server = PacketPipe::serve(session(), "haptic0");
    EXPECT_TRUE(server);
    return PacketPipe::connect(session(), "haptic0");
  }();
  ASSERT_TRUE(client);
  EXPECT_FALSE(client->send(Stamped<rtbus::DeviceState>{}));
  EXPECT_TRUE(client->broken());
  EXPECT_FALSE(PacketPipe::connect(session(), "haptic0"));
  auto again = PacketPipe::serve(session(), "haptic0");
  EXPECT_TRUE(again);
}

}  // namespace
