// The real libusb over a virtual device: transfers, stalls, time-outs, unplugging, the kernel's driver.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <cstring>
#include <thread>

#include "rtbus/clock.hpp"
#include "tests/unit/usb_link/support.hpp"

namespace drivers::usb {
namespace {

using tests::EchoPort;
class LibusbChannelTest : public testing::Test {
 protected:
  void SetUp() override { open(); }
  void open() {
    auto opened = port_.open(stop_);
    ASSERT_TRUE(opened) << opened.error().message;
    channel_ = std::move(*opened);
  }
  std::uint64_t in_ms(std::uint64_t ms) { return channel_->now_ns() + ms * rtbus::kNsPerMs; }
  UsbStatus write(std::vector<std::uint8_t> bytes, std::uint64_t ms = 2000) {
    return channel_->write(bytes, in_ms(ms));
  }
  UsbStatus read(std::uint64_t ms = 2000) { return channel_->read(buffer_, got_, in_ms(ms)); }

  EchoPort port_;
  StopFlag stop_;
  std::unique_ptr<Channel> channel_;
  std::array<std::uint8_t, 64> buffer_{};
  std::size_t got_ = 0;
};

TEST_F(LibusbChannelTest, EchoesInOrder) {
  EXPECT_EQ(channel_->read_size(), 64u);
  for (std::uint8_t i = 0; i < 200; ++i) {
    ASSERT_EQ(write({i, 1, 2}), UsbStatus::kOk);
    ASSERT_EQ(read(), UsbStatus::kOk);
    ASSERT_EQ(got_, 3u);
    ASSERT_EQ(buffer_[0], i);
  }
}

TEST_F(LibusbChannelTest, KeepsAnswersThatCameBetweenTheCalls) {
  for (std::uint8_t i = 0; i < 3; ++i) ASSERT_EQ(write({i}), UsbStatus::kOk);
  EXPECT_EQ(channel_->sleep_until(in_ms(20)), UsbStatus::kOk);
  for (std::uint8_t i = 0; i < 3; ++i) {
    ASSERT_EQ(read(), UsbStatus::kOk);
    EXPECT_EQ(buffer_[0], i);
  }
  EXPECT_EQ(read(5), UsbStatus::kTimeout);
}

TEST_F(LibusbChannelTest, ControlRequestsBothWaysAndAStall) {
  EXPECT_EQ(channel_->control_out({0x40, 1, 0x0203, 0}, {}, in_ms(1000)), UsbStatus::kOk);
  EXPECT_EQ(channel_->control_in({0x40, 2, 0, 0}, buffer_, got_, in_ms(1000)), UsbStatus::kOk);
  ASSERT_EQ(got_, 2u);
  EXPECT_EQ(buffer_[0], 3);
  EXPECT_EQ(buffer_[1], 2);
  EXPECT_EQ(channel_->control_out({0x40, 99, 0, 0}, {}, in_ms(1000)), UsbStatus::kStall);
  EXPECT_EQ(channel_->control_out({0x40, 1, 1, 0}, {}, in_ms(1000)), UsbStatus::kOk) << "endpoint 0 does not halt";
}

TEST_F(LibusbChannelTest, ReadAndWriteEndAtTheirDeadline) {
  EXPECT_EQ(read(10), UsbStatus::kTimeout);
  port_.locked([&] { port_.device.refuse_out = true; });
  EXPECT_EQ(write({1}, 10), UsbStatus::kTimeout);
  port_.locked([&] { port_.device.refuse_out = false; });
  EXPECT_EQ(write({2}), UsbStatus::kOk);
  EXPECT_EQ(read(), UsbStatus::kOk);
  EXPECT_EQ(buffer_[0], 2) << "what timed out was taken back";
}

TEST_F(LibusbChannelTest, AStallIsClearedAndTheNextAnswerComes) {
  port_.locked([&] { port_.device.stall_next_in = true; });
  EXPECT_EQ(read(), UsbStatus::kStall);
  for (std::uint8_t i = 0; i < 10; ++i) {
    ASSERT_EQ(write({i}), UsbStatus::kOk);
    ASSERT_EQ(read(), UsbStatus::kOk);
    ASSERT_EQ(buffer_[0], i);
  }
}

TEST_F(LibusbChannelTest, UnplugInFlightGivesLostAndReplugOpensAnew) {
  std::thread hand([&] {
    rtbus::sleep_until(rtbus::monotonic_ns() + 20 * rtbus::kNsPerMs);
    port_.port->unplug();
  });
  EXPECT_EQ(read(5000), UsbStatus::kLost);
  hand.join();
  EXPECT_EQ(write({1}), UsbStatus::kLost);
  EXPECT_EQ(channel_->control_out({0x40, 1, 1, 0}, {}, in_ms(100)), UsbStatus::kLost);
  channel_.reset();
  EXPECT_FALSE(port_.open(stop_));
  port_.port->replug();
  ASSERT_NO_FATAL_FAILURE(open());
  EXPECT_EQ(write({7}), UsbStatus::kOk);
  EXPECT_EQ(read(), UsbStatus::kOk);
}

TEST_F(LibusbChannelTest, AStopEndsAWaitUnlessHeldBack) {
  std::thread other([&] {
    rtbus::sleep_until(rtbus::monotonic_ns() + 20 * rtbus::kNsPerMs);
    stop_.raise();
  });
  EXPECT_EQ(read(60'000), UsbStatus::kStopping);
  other.join();
  EXPECT_EQ(channel_->sleep_until(in_ms(60'000)), UsbStatus::kStopping);
  stop_.hold_back(true);
  EXPECT_EQ(write({5}), UsbStatus::kOk) << "the last zero force has to leave";
  EXPECT_EQ(read(), UsbStatus::kOk);
}

TEST_F(LibusbChannelTest, AnotherHandleIsRefusedWhileOneIsOpen) { EXPECT_FALSE(port_.open(stop_)); }

TEST(LibusbChannel, TheKernelsDriverIsDetachedAndGivenBack) {
  EchoPort port;
  port.port->bind_kernel_driver(0, "cdc_acm");
  StopFlag stop;
  {
    auto channel = port.open(stop);
    ASSERT_TRUE(channel) << channel.error().message;
    EXPECT_EQ(port.port->kernel_driver(0), "usbfs");
  }
  EXPECT_EQ(port.port->kernel_driver(0), "cdc_acm");
}

TEST(LibusbChannel, AnInterfaceThatIsNotThereIsExplained) {
  EchoPort port;
  StopFlag stop;
  auto channel = LibusbChannel::open_fd(port.port->open(), {1, 2, "", {3}}, stop);
  ASSERT_FALSE(channel);
  EXPECT_THAT(channel.error().message, testing::HasSubstr("claiming USB interface 3"));
}

TEST(LibusbChannel, HighSpeedHasPacketsOf512Bytes) {
  EchoPort port({}, true);
  StopFlag stop;
  auto channel = port.open(stop);
  ASSERT_TRUE(channel) << channel.error().message;
  EXPECT_EQ((*channel)->read_size(), 512u);
}

TEST(LibusbChannel, TwoDevicesDoNotMeet) {
  EchoPort one, two;
  StopFlag stop_one, stop_two;
  auto first = one.open(stop_one), second = two.open(stop_two);
  ASSERT_TRUE(first && second);
  const auto talk = [](Channel& channel, std::uint8_t mark) {
    std::array<std::uint8_t, 64> in{};
    std::size_t got = 0;
    for (int i = 0; i < 300; ++i) {
      const std::uint8_t out[] = {mark, static_cast<std::uint8_t>(i)};
      ASSERT_EQ(channel.write(out, channel.now_ns() + 5000 * rtbus::kNsPerMs), UsbStatus::kOk);
      ASSERT_EQ(channel.read(in, got, channel.now_ns() + 5000 * rtbus::kNsPerMs), UsbStatus::kOk);
      ASSERT_EQ(in[0], mark);
      ASSERT_EQ(in[1], static_cast<std::uint8_t>(i));
    }
  };
  std::thread other([&] { talk(**second, 2); });
  talk(**first, 1);
  other.join();
}

}  // namespace
}  // namespace drivers::usb
