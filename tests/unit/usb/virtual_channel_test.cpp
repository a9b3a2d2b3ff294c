// A channel in simulated time: what a protocol sees when the device is slow, stalls, or is pulled out.
#include "drivers/virtual_usb/virtual_channel.hpp"
#include "rtbus/clock.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>

#include "tests/support/echo_device.hpp"

namespace drivers::virtual_usb {
namespace {

using usb::UsbStatus;
class VirtualChannelTest : public testing::Test {
 protected:
  UsbStatus write(std::vector<std::uint8_t> bytes) {
    return channel_.write(bytes, channel_.now_ns() + 10 * rtbus::kNsPerMs);
  }
  UsbStatus read(std::uint64_t patience_ns = 10 * rtbus::kNsPerMs) {
    return channel_.read(buffer_, got_, channel_.now_ns() + patience_ns);
  }
  tests::EchoDevice device_;
  VirtualChannel channel_{device_};
  std::array<std::uint8_t, 64> buffer_{};
  std::size_t got_ = 0;
};

TEST_F(VirtualChannelTest, TimePassesOnlyUntilTheDeviceAnswers) {
  device_.delay_ns = 3 * rtbus::kNsPerMs;
  const std::uint64_t start_ns = channel_.now_ns();
  EXPECT_EQ(write({1, 2, 3}), UsbStatus::kOk);
  EXPECT_EQ(read(), UsbStatus::kOk);
  EXPECT_EQ(got_, 3u);
  EXPECT_NEAR(static_cast<double>(channel_.now_ns() - start_ns), 3e6, 1e5);
}

TEST_F(VirtualChannelTest, ReadEndsAtItsDeadline) {
  const std::uint64_t start_ns = channel_.now_ns();
  EXPECT_EQ(read(), UsbStatus::kTimeout);
  EXPECT_EQ(channel_.now_ns(), start_ns + 10 * rtbus::kNsPerMs);
}

TEST_F(VirtualChannelTest, AnAnswerBetweenCallsIsNotLost) {
  EXPECT_EQ(write({1}), UsbStatus::kOk);
  EXPECT_EQ(write({2}), UsbStatus::kOk);
  EXPECT_EQ(channel_.sleep_until(channel_.now_ns() + 20 * rtbus::kNsPerMs), UsbStatus::kOk);
  EXPECT_EQ(read(), UsbStatus::kOk);
  EXPECT_EQ(buffer_[0], 1);
  EXPECT_EQ(read(), UsbStatus::kOk);
  EXPECT_EQ(buffer_[0], 2);
}

TEST_F(VirtualChannelTest, AWriteThatNobodyTakesTimesOutAndLeavesNothingBehind) {
  device_.refuse_out = true;
  EXPECT_EQ(write({1}), UsbStatus::kTimeout);
  device_.refuse_out = false;
  EXPECT_EQ(write({2}), UsbStatus::kOk);
  EXPECT_EQ(device_.commands, 1);
}

TEST_F(VirtualChannelTest, AStallIsToldOnceAndCleared) {
  device_.stall_next_in = true;
  EXPECT_EQ(read(), UsbStatus::kStall);
  EXPECT_EQ(write({7}), UsbStatus::kOk);
  EXPECT_EQ(read(), UsbStatus::kOk);
  EXPECT_EQ(buffer_[0], 7);
}

TEST_F(VirtualChannelTest, ControlRequests) {
  const std::uint64_t deadline_ns = channel_.now_ns() + 100 * rtbus::kNsPerMs;
  EXPECT_EQ(channel_.control_out({0x40, 1, 0x0203, 0}, {}, deadline_ns), UsbStatus::kOk);
  EXPECT_EQ(channel_.control_in({0x40, 2, 0, 0}, buffer_, got_, deadline_ns), UsbStatus::kOk);
  EXPECT_EQ(got_, 2u);
  EXPECT_EQ(buffer_[1], 2);
  EXPECT_EQ(channel_.control_out({0x40, 77, 0, 0}, {}, deadline_ns), UsbStatus::kStall);
}

TEST_F(VirtualChannelTest, UnplugAndReplug) {
  channel_.unplug_at(channel_.now_ns() + 2 * rtbus::kNsPerMs);
  EXPECT_EQ(read(), UsbStatus::kLost);
  EXPECT_EQ(write({1}), UsbStatus::kLost);
  channel_.replug();
  EXPECT_EQ(write({1}), UsbStatus::kOk);
  EXPECT_EQ(read(), UsbStatus::kOk);
}

TEST_F(VirtualChannelTest, StopEndsAWait) {
  channel_.stop_at(channel_.now_ns() + 2 * rtbus::kNsPerMs);
  EXPECT_EQ(read(), UsbStatus::kStopping);
  EXPECT_EQ(channel_.sleep_until(channel_.now_ns() + rtbus::kNsPerMs), UsbStatus::kStopping);
  channel_.stop_at(kNever);
  EXPECT_EQ(channel_.sleep_until(channel_.now_ns() + rtbus::kNsPerMs), UsbStatus::kOk);
}

}  // namespace
}  // namespace drivers::virtual_usb
