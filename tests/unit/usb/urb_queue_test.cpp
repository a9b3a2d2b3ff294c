// Transfers cut into packets, as a host controller does it, in simulated time.
#include "drivers/virtual_usb/urb_queue.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <numeric>
#include <optional>

#include "tests/support/echo_device.hpp"

namespace drivers::virtual_usb {
namespace {

using testing::ElementsAre;
using testing::ElementsAreArray;
using testing::SizeIs;
using tests::EchoDevice;
using Bytes = std::vector<std::uint8_t>;

Bytes counting(std::size_t size) {
  Bytes out(size);
  std::iota(out.begin(), out.end(), std::uint8_t{0});
  return out;
}

class UrbQueueTest : public testing::Test {
 protected:
  static Urb out(Bytes data, std::uint64_t id = 1) {
    Urb urb;
    urb.id = id;
    urb.endpoint = 0x02;
    urb.data = std::move(data);
    return urb;
  }
  static Urb in(std::size_t length, std::uint64_t id = 2) {
    Urb urb;
    urb.id = id;
    urb.endpoint = 0x81;
    urb.length = length;
    return urb;
  }
  static Urb control(std::uint8_t type, std::uint8_t request, std::uint16_t value, std::uint16_t index,
                     std::uint16_t length) {
    Urb urb;
    urb.id = 3;
    urb.setup = {type, request, value, index};
    urb.setup_length = length;
    urb.length = (type & 0x80) != 0 ? length : 0;
    return urb;
  }
  // Lets a second pass and gives what ended.
  Urb done() {
    queue_.pump(now_ns_ += 1'000'000'000);
    Urb urb;
    EXPECT_TRUE(queue_.take_done(urb));
    return urb;
  }
  Urb run(Urb urb) {
    queue_.submit(std::move(urb), now_ns_);
    return done();
  }

  EchoDevice device_;
  UrbQueue queue_{device_};
  std::uint64_t now_ns_ = 1000;
};

TEST_F(UrbQueueTest, AnOutTransferBecomesPackets) {
  const Urb urb = run(out(counting(150)));
  EXPECT_EQ(urb.status, kUrbOk);
  EXPECT_EQ(urb.actual, 150u);
  EXPECT_EQ(device_.commands, 3);  // 64 + 64 + 22
  EXPECT_THAT(device_.last_command, SizeIs(22));
}

TEST_F(UrbQueueTest, AFullLastPacketIsFollowedByAnEmptyOneOnlyWhenAsked) {
  (void)run(out(counting(128)));
  EXPECT_EQ(device_.commands, 2);
  Urb urb = out(counting(128));
  urb.zero_packet = true;
  (void)run(std::move(urb));
  EXPECT_EQ(device_.commands, 5);
  EXPECT_THAT(device_.last_command, SizeIs(0));
}

TEST_F(UrbQueueTest, AShortPacketEndsAnInTransfer) {
  device_.delay_ns = 10;
  queue_.submit(out(counting(100)), now_ns_);  // echoed as 64 + 36
  queue_.submit(in(512), now_ns_);
  const Urb first = done();
  EXPECT_EQ(first.id, 1u);
  Urb second;
  ASSERT_TRUE(queue_.take_done(second));
  EXPECT_EQ(second.status, kUrbOk);
  EXPECT_THAT(second.data, ElementsAreArray(counting(100)));
}

TEST_F(UrbQueueTest, FullPacketsGoOnUntilTheTransferIsFull) {
  queue_.submit(out(counting(128)), now_ns_);
  queue_.submit(in(512), now_ns_);
  (void)done();
  EXPECT_EQ(queue_.pending(), 1u) << "two full packets do not end a transfer of 512 bytes";
  queue_.submit(out(counting(5), 7), now_ns_);
  EXPECT_EQ(done().id, 7u);
  Urb urb;
  ASSERT_TRUE(queue_.take_done(urb));
  EXPECT_EQ(urb.actual, 133u);
}

TEST_F(UrbQueueTest, MoreThanWasAskedForIsAnOverflow) {
  (void)run(out(counting(16)));
  const Urb urb = run(in(7));
  EXPECT_EQ(urb.status, kUrbOverflow);
  EXPECT_THAT(urb.data, SizeIs(7));
}

TEST_F(UrbQueueTest, ShortNotOkIsReported) {
  (void)run(out(counting(16)));
  Urb urb = in(64);
  urb.short_not_ok = true;
  const Urb short_one = run(std::move(urb));
  EXPECT_EQ(short_one.status, kUrbShort);
  EXPECT_EQ(short_one.actual, 16u);
}

TEST_F(UrbQueueTest, InTransfersAreServedInOrderAndAtTheirTime) {
  device_.delay_ns = 1'000'000;
  for (const std::uint64_t id : {10, 11, 12}) queue_.submit(in(64, id), now_ns_);
  queue_.submit(out({1}, 1), now_ns_);
  queue_.submit(out({2}, 2), now_ns_);
  const std::uint64_t next_ns = queue_.pump(now_ns_ + 1000 * 1000 / 2);
  EXPECT_NEAR(static_cast<double>(next_ns), static_cast<double>(now_ns_ + 1'000'000), 1e4);
  Urb urb;
  ASSERT_TRUE(queue_.take_done(urb));
  EXPECT_EQ(urb.id, 1u);
  ASSERT_TRUE(queue_.take_done(urb));
  EXPECT_EQ(urb.id, 2u);
  EXPECT_FALSE(queue_.take_done(urb)) << "the device has not answered yet";
  EXPECT_EQ(queue_.pump(now_ns_ + 2'000'000), kNever);
  ASSERT_TRUE(queue_.take_done(urb));
  EXPECT_EQ(urb.id, 10u);
  EXPECT_THAT(urb.data, ElementsAre(1));
  ASSERT_TRUE(queue_.take_done(urb));
  EXPECT_EQ(urb.id, 11u);
  EXPECT_THAT(urb.data, ElementsAre(2));
}

TEST_F(UrbQueueTest, TheBusHasASpeed) {
  queue_.submit(out(counting(64 * 10)), 0);
  std::uint64_t last_ns = 0;
  for (std::uint64_t next_ns = queue_.pump(0); next_ns != kNever; next_ns = queue_.pump(next_ns)) last_ns = next_ns;
  // Ten packets of 64 + 13 bytes at 12 Mbit/s, the first of which starts at once.
  EXPECT_NEAR(static_cast<double>(last_ns), 9 * 77 * 8 * 1000.0 / 12, 10);
}

TEST_F(UrbQueueTest, HowOftenItIsPumpedMakesNoDifference) {
  const auto trace = [](std::uint64_t step_ns) {
    EchoDevice device;
    device.delay_ns = 333'000;
    UrbQueue queue(device);
    std::vector<std::uint64_t> times;
    Urb many = out(counting(500));
    queue.submit(std::move(many), 0);
    queue.submit(in(64), 0);
    for (std::uint64_t now_ns = 0; now_ns < 3'000'000; now_ns += step_ns) queue.pump(now_ns);
    times.push_back(device.last_command_ns);
    return times;
  };
  EXPECT_EQ(trace(1000), trace(1'000'000));
}

TEST_F(UrbQueueTest, ANakWaitsForTheNextEvent) {
  device_.refuse_out = true;
  queue_.submit(out({1, 2}), now_ns_);
  EXPECT_EQ(queue_.pump(now_ns_ + 5), kNever);
  device_.refuse_out = false;
  EXPECT_EQ(queue_.pump(now_ns_ + 1'000'000), kNever) << "nothing has happened on the bus";
  queue_.submit(control(0x40, 1, 7, 0, 0), now_ns_ + 1'000'000);
  queue_.pump(now_ns_ + 2'000'000);
  EXPECT_EQ(queue_.pending(), 0u);
}

TEST_F(UrbQueueTest, AStallHaltsUntilItIsCleared) {
  device_.stall_next_in = true;
  EXPECT_EQ(run(in(64)).status, kUrbStall);
  EXPECT_TRUE(queue_.halted(0x81));
  EXPECT_EQ(run(in(64)).status, kUrbStall) << "the device has nothing against it, the halt has";
  EXPECT_THAT(run(control(0x82, 0, 0, 0x81, 2)).data, ElementsAre(1, 0));
  EXPECT_EQ(run(control(0x02, 1, 0, 0x81, 0)).status, kUrbOk);  // CLEAR_FEATURE(ENDPOINT_HALT)
  EXPECT_THAT(run(control(0x82, 0, 0, 0x81, 2)).data, ElementsAre(0, 0));
  (void)run(out({9}));
  EXPECT_THAT(run(in(64)).data, ElementsAre(9));
}

TEST_F(UrbQueueTest, DiscardTakesBackWhatIsPendingAndOnlyThat) {
  queue_.submit(in(64, 5), now_ns_);
  queue_.submit(in(64, 6), now_ns_);
  Urb urb;
  EXPECT_TRUE(queue_.discard(6, urb));
  EXPECT_EQ(urb.status, kUrbCancelled);
  EXPECT_FALSE(queue_.discard(6, urb));
  (void)run(out({1}));
  EXPECT_FALSE(queue_.discard(5, urb)) << "done already";
}

TEST_F(UrbQueueTest, UnplugEndsEverythingAndPlugKeepsTheDevice) {
  device_.value = 42;
  queue_.submit(in(64, 5), now_ns_);
  queue_.unplug();
  EXPECT_EQ(done().status, kUrbGone);
  EXPECT_EQ(run(out({1})).status, kUrbGone);
  queue_.plug(now_ns_);
  EXPECT_EQ(device_.resets, 1);
  EXPECT_EQ(run(out({1})).status, kUrbOk);
  EXPECT_THAT(run(control(0xc0, 2, 0, 0, 2)).data, ElementsAre(42, 0));
}

TEST_F(UrbQueueTest, AnUnknownEndpointIsRefused) {
  Urb urb = in(64);
  urb.endpoint = 0x85;
  EXPECT_EQ(run(std::move(urb)).status, kUrbStall);
}

TEST_F(UrbQueueTest, ChapterNine) {
  EXPECT_THAT(run(control(0x80, 6, 0x0100, 0, 18)).data, ElementsAreArray(device_.descriptors().device));
  EXPECT_THAT(run(control(0x80, 6, 0x0100, 0, 8)).data, SizeIs(8));
  EXPECT_THAT(run(control(0x80, 6, 0x0200, 0, 255)).data, ElementsAreArray(device_.descriptors().configuration));
  EXPECT_THAT(run(control(0x80, 6, 0x0300, 0, 255)).data, ElementsAre(4, 3, 0x09, 0x04));
  EXPECT_THAT(run(control(0x80, 6, 0x0303, 0x0409, 255)).data, ElementsAre(6, 3, 'E', 0, '1', 0));
  EXPECT_EQ(run(control(0x80, 6, 0x0304, 0x0409, 255)).status, kUrbStall);
  EXPECT_EQ(run(control(0x80, 6, 0x0600, 0, 10)).status, kUrbStall) << "one speed only: no device qualifier";
  EXPECT_THAT(run(control(0x80, 8, 0, 0, 1)).data, ElementsAre(0));
  EXPECT_EQ(run(control(0x00, 9, 1, 0, 0)).status, kUrbOk);
  EXPECT_THAT(run(control(0x80, 8, 0, 0, 1)).data, ElementsAre(1));
  EXPECT_EQ(run(control(0x00, 9, 2, 0, 0)).status, kUrbStall);
  EXPECT_THAT(run(control(0x80, 0, 0, 0, 2)).data, ElementsAre(0, 0));
  EXPECT_EQ(run(control(0x40, 1, 0x1234, 0, 0)).status, kUrbOk);
  EXPECT_THAT(run(control(0xc0, 2, 0, 0, 2)).data, ElementsAre(0x34, 0x12));
  EXPECT_EQ(run(control(0x40, 99, 0, 0, 0)).status, kUrbStall);
}

TEST(ParseConfiguration, SurvivesAnyBytes) {
  std::uint32_t state = 1;
  for (int round = 0; round < 20000; ++round) {
    Bytes bytes(static_cast<std::size_t>(round % 61));
    for (auto& byte : bytes) {
      state = state * 1664525u + 1013904223u;
      byte = static_cast<std::uint8_t>((state >> 24) % (round % 2 == 0 ? 12u : 255u));
    }
    const Configuration parsed = parse_configuration(bytes);
    ASSERT_LE(parsed.endpoints.size() * 7, bytes.size());
  }
}

}  // namespace
}  // namespace drivers::virtual_usb
