// The whole path of a Falcon in one process and in real time: haptic loop, I/O thread, libusb, a usbfs descriptor, the
// virtual Falcon. What is asserted holds however slow the machine is; figures are in docs/devices.md.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>

#include "tests/support/bare_loops.hpp"
#include "tests/support/falcon_desk.hpp"

namespace drivers::falcon {
namespace {

using Eigen::Vector3d;
using tests::Desk;
using tests::held;
using virtual_usb::VirtualFalconSettings;

const auto kNothing = [](const DeviceSample&) { return Vec3{}; };

TEST(FalconLink, LoadsItsFirmwareThroughLibusbAndExchanges) {
  for (const bool event : {false, true}) {
    Desk desk(held({0, 0, 0}), event);
    const auto started = desk.device->start(rtbus::monotonic_ns());
    ASSERT_TRUE(started) << started.error().message;
    EXPECT_EQ(desk.loop(500, kNothing), 500);
    EXPECT_EQ(desk.falcon.board().uploads(), 1);
    const auto figures = desk.device->figures();
    EXPECT_EQ(figures.state, usb::LinkState::kRunning);
    EXPECT_EQ(figures.protocol.bad_frames, 0U);
    EXPECT_EQ(figures.protocol.line_errors, 0U);
  }
}

// The hand feels what the law asked for, sample by sample: the force that acts is the wall's at the newest samples.
TEST(FalconLink, TheHandFeelsTheWallsForceWithinTwoPercent) {
  Desk desk(held({0, -0.004, 0}));
  ASSERT_TRUE(desk.device->start(rtbus::monotonic_ns()));
  constexpr double kWall = 500.0;
  const auto wall = [](const DeviceSample& s) { return Vec3{0, std::max(0.0, -kWall * s.position_m[1]), 0}; };
  // At rest after half a second.
  // Forces time out where the driver hears nothing for 20 ms. One thread or two may have waited for that.
  constexpr double kLate_ms = 10.0;
  double off = 1.0;
  std::string machine;
  const auto judged = tests::judge_when_quiet(tests::BareScheduling::kOrdinary, kLate_ms, 20, machine, [&] {
    EXPECT_EQ(desk.loop(500, wall), 500);
    const double wanted_n = wall(desk.sample)[1];
    EXPECT_GT(wanted_n, 1.0);
    off = (desk.applied_n() - Vector3d(0, wanted_n, 0)).norm() / wanted_n;
    return off <= 0.02 || HasFailure();
  });
  if (judged == tests::Judged::kPaused) GTEST_SKIP() << "forces timed out; " << machine;
  EXPECT_LE(off, 0.02);
  EXPECT_EQ(desk.device->figures().protocol.clamped, 0U);
}

TEST(FalconLink, IsReadyOnlyAfterHoming) {
  Desk desk(VirtualFalconSettings{});
  ASSERT_TRUE(desk.device->start(rtbus::monotonic_ns()));
  EXPECT_EQ(desk.device->figures().state, usb::LinkState::kNotReady);
  EXPECT_THAT(desk.device->take_notice(), ::testing::HasSubstr("pull the grip all the way out"));
  EXPECT_EQ(desk.loop(10, kNothing), 10);  // samples come once it is homed
  EXPECT_EQ(desk.device->figures().state, usb::LinkState::kRunning);
}

TEST(FalconLink, UnpluggedAndPluggedInMidRunItComesBackHomedWithoutAnotherUpload) {
  Desk desk(held({0, 0, 0}));
  ASSERT_TRUE(desk.device->start(rtbus::monotonic_ns()));
  ASSERT_EQ(desk.loop(100, [](const DeviceSample&) { return Vec3{0, 2, 0}; }), 100);
  desk.port->unplug();
  rtbus::sleep_until(rtbus::monotonic_ns() + 200 * rtbus::kNsPerMs);
  EXPECT_EQ(desk.device->read(rtbus::monotonic_ns(), desk.sample), IoStatus::kLost);
  EXPECT_EQ(desk.applied_n().norm(), 0.0);  // the device's own time-out
  desk.port->replug();
  EXPECT_EQ(desk.loop(100, kNothing), 100);
  EXPECT_EQ(desk.falcon.board().uploads(), 1);
  EXPECT_EQ(desk.device->figures().losses, 1U);
}

TEST(FalconLink, StopLeavesZeroForceWithinItsBound) {
  Desk desk(held({0, 0, 0}));
  ASSERT_TRUE(desk.device->start(rtbus::monotonic_ns()));
  ASSERT_EQ(desk.loop(200, [](const DeviceSample&) { return Vec3{0, 2, 0}; }), 200);
  desk.device->stop();
  EXPECT_EQ(desk.falcon.board().commands(), (std::array<std::int16_t, 3>{0, 0, 0}));
  EXPECT_EQ(desk.applied_n().norm(), 0.0);
}

TEST(FalconLink, SurvivesAllFaultsOfTheLinkAtOnce) {
  VirtualFalconSettings settings = held({0, 0, 0});
  Desk desk(settings);
  ASSERT_TRUE(desk.device->start(rtbus::monotonic_ns()));
  ASSERT_EQ(desk.loop(50, kNothing), 50);
  desk.port->locked([&] {
    auto& faults = desk.falcon.board().faults();
    faults.lose_reply = 0.02;
    faults.late_reply = 0.02;
    faults.split_reply = 0.05;
    faults.merge_reply = 0.02;
    faults.stall_in = 0.005;
  });
  ASSERT_EQ(desk.loop(1000, [](const DeviceSample&) { return Vec3{0, 1, 0}; }), 1000);
  EXPECT_GT(desk.device->figures().protocol.lost_frames, 0U);
  desk.port->locked([&] { desk.falcon.board().faults() = {}; });
  ASSERT_EQ(desk.loop(200, kNothing), 200);
  EXPECT_EQ(desk.device->figures().state, usb::LinkState::kRunning);
}

TEST(FalconLink, SaysWhyItDoesNotStart) {
  VirtualFalconSettings settings = held({0, 0, 0});
  settings.board.faults.mute = true;
  Desk desk(settings);
  const auto started = desk.device->start(rtbus::monotonic_ns());
  ASSERT_FALSE(started);
  EXPECT_THAT(started.error().message, ::testing::HasSubstr("is its wall power connected?"));
}

}  // namespace
}  // namespace drivers::falcon
