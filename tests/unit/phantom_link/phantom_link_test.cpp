// The whole path of a PHANToM-class arm in one process and in real time: haptic loop, I/O thread, libusb, a usbfs
// descriptor, the virtual arm. What is asserted holds however slow the machine is; figures are in docs/devices.md.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <string>

#include "drivers/phantom/phantom_protocol.hpp"
#include "drivers/usb_host/libusb_channel.hpp"
#include "drivers/usb_host/usb_line.hpp"
#include "drivers/virtual_devices/phantom/virtual_phantom.hpp"
#include "drivers/virtual_usb/usbfs_shim.hpp"
#include "rtbus/clock.hpp"
#include "tests/support/bare_loops.hpp"

namespace drivers::phantom {
namespace {

using Eigen::Vector3d;
using virtual_usb::VirtualPhantom;
using virtual_usb::VirtualPhantomSettings;

VirtualPhantomSettings held(ModelId id, const Vector3d& at_m, bool high_speed = true) {
  VirtualPhantomSettings out;
  out.model = *find_model(static_cast<int>(id));
  out.mechanics = virtual_usb::mechanics_of(out.model);
  out.mechanics.start_position_m = at_m;
  out.hand = {simulated::HoldMotion{at_m}, {2000.0, 20.0, 0.15, 40.0}};
  out.high_speed = high_speed;
  return out;
}

// An arm that is plugged in, its driver, and a loop.
class Desk {
 public:
  explicit Desk(const VirtualPhantomSettings& settings, HomingMode mode = HomingMode::kCounters)
      : arm(settings), port(rtbus_usbfs_shim()->attach(arm, settings.faults)) {
    PhantomSettings driver;
    driver.model = settings.model;
    driver.homing = mode;
    auto homing = std::make_shared<Homing>(Kinematics(driver.model), mode, driver.home_tolerance_rad);
    usb::IoSettings io;
    io.info = settings.model.limits;
    io.info.model = std::string(settings.model.key);
    io.info.can_pace_loop = true;
    io.info.sample_rate_hz = 1000.0;
    io.order = usb::ExchangeOrder::kFetchFirst;
    io.reply_timeout_s = static_cast<double>(PhantomProtocol::kReplyLostNs) * 1e-9;
    device = usb::make_io_device(
        io, usb::IoThread{}, [driver, homing] { return std::make_unique<PhantomProtocol>(driver, homing); },
        [this](usb::StopFlag& stop) -> rtbus::Result<std::unique_ptr<usb::Channel>, DeviceFault> {
          const int fd = port->open();
          if (fd < 0) return rtbus::Failure{DeviceFault{"unplugged"}};
          return usb::LibusbChannel::open_fd(
              fd, {.vendor_id = 0x16c0, .product_id = 0x0483, .serial = "", .interfaces = {0, 1}}, stop);
        });
  }
  ~Desk() {
    device->stop();
    port.reset();
  }

  // The loop, paced by the device, for so many samples or until it took too long.
  template <class Law>
  int loop(int samples, Law law) {
    const std::uint64_t give_up_ns = rtbus::monotonic_ns() + 60 * rtbus::kNsPerS;
    int done = 0;
    while (done < samples && rtbus::monotonic_ns() < give_up_ns) {
      const std::uint64_t deadline_ns = rtbus::monotonic_ns() + 2 * rtbus::kNsPerMs;
      if (device->wait_sample(deadline_ns) == IoStatus::kLost) rtbus::sleep_until(deadline_ns);
      const std::uint64_t now_ns = rtbus::monotonic_ns();
      if (device->read(now_ns, sample) != IoStatus::kOk) continue;
      ++done;
      (void)device->write(now_ns, {law(sample)});
    }
    return done;
  }

  template <class Change>
  void locked(Change change) {
    port->locked([&] {
      arm.advance_to(rtbus::monotonic_ns());
      change();
    });
  }
  Vector3d applied_n() {
    Vector3d out;
    locked([&] { out = arm.arm().mechanics().applied_force_n(); });
    return out;
  }
  bool eventually_zero_force() {
    for (int i = 0; i < 500; ++i) {
      if (applied_n().norm() == 0.0) return true;
      rtbus::sleep_until(rtbus::monotonic_ns() + 2 * rtbus::kNsPerMs);
    }
    return false;
  }

  VirtualPhantom arm;
  std::unique_ptr<virtual_usb::UsbfsPort> port;
  std::unique_ptr<usb::IoDevice> device;
  DeviceSample sample;
};

const auto kNothing = [](const DeviceSample&) { return Vec3{}; };
const auto kPush = [](const DeviceSample&) { return Vec3{0, 1, 0}; };

TEST(PhantomLink, ExchangesThroughLibusbAtBothSpeedsWithoutALoss) {
  for (const bool high : {true, false}) {
    for (const ModelId id : {ModelId::kVintage, ModelId::kWoody, ModelId::kPolhem}) {
      Desk desk(held(id, {0.01, 0.02, -0.01}, high));
      const auto started = desk.device->start(rtbus::monotonic_ns());
      ASSERT_TRUE(started) << started.error().message;
      EXPECT_EQ(desk.loop(300, kNothing), 300);
      const auto figures = desk.device->figures();
      EXPECT_EQ(figures.state, usb::LinkState::kRunning);
      EXPECT_EQ(figures.protocol.bad_frames, 0U);
      EXPECT_EQ(figures.protocol.resyncs, 0U);
      EXPECT_EQ(figures.protocol.line_errors, 0U);
      EXPECT_NEAR(desk.sample.position_m[1], 0.02, 1e-3);
    }
  }
}

// The hand feels what the law asked for: the force that acts is the wall's at the newest samples.
TEST(PhantomLink, TheHandFeelsTheWallsForceWithinTwoPercent) {
  Desk desk(held(ModelId::kVintage, {0, -0.004, 0}));
  ASSERT_TRUE(desk.device->start(rtbus::monotonic_ns()));
  constexpr double kWall = 400.0;
  const auto wall = [](const DeviceSample& s) { return Vec3{0, std::max(0.0, -kWall * s.position_m[1]), 0}; };
  // Forces time out where the driver hears nothing for 20 ms. One thread or two may have waited for that.
  constexpr double kLate_ms = 10.0;
  double off = 1.0;
  std::string machine;
  const auto judged = tests::judge_when_quiet(tests::BareScheduling::kOrdinary, kLate_ms, 20, machine, [&] {
    EXPECT_EQ(desk.loop(500, wall), 500);
    const double wanted_n = wall(desk.sample)[1];
    EXPECT_GT(wanted_n, 0.5);
    off = (desk.applied_n() - Vector3d(0, wanted_n, 0)).norm() / wanted_n;
    return off <= 0.02 || HasFailure();
  });
  if (judged == tests::Judged::kPaused) GTEST_SKIP() << "forces timed out; " << machine;
  EXPECT_LE(off, 0.02);
  EXPECT_EQ(desk.device->figures().protocol.clamped, 0U);
}

TEST(PhantomLink, IsLostUntilHomedAndSaysWhatToDo) {
  auto settings = held(ModelId::kVintage, {0, -0.015, 0});
  settings.zeroed_at_home = false;
  settings.calibration_needed = true;
  Desk desk(settings, HomingMode::kAtStart);
  ASSERT_TRUE(desk.device->start(rtbus::monotonic_ns()));
  EXPECT_EQ(desk.device->figures().state, usb::LinkState::kNotReady);
  EXPECT_THAT(desk.device->take_notice(), ::testing::HasSubstr("press the calibration button"));
  EXPECT_EQ(desk.device->read(rtbus::monotonic_ns(), desk.sample), IoStatus::kLost);
  desk.locked([&] { desk.arm.hold_button(true); });
  rtbus::sleep_until(rtbus::monotonic_ns() + 50 * rtbus::kNsPerMs);
  desk.locked([&] { desk.arm.hold_button(false); });
  EXPECT_EQ(desk.loop(50, kPush), 50);
  EXPECT_EQ(desk.device->figures().state, usb::LinkState::kRunning);
}

TEST(PhantomLink, UnpluggedAndPluggedInMidRunItComesBackWhenItsCountersGoOn) {
  Desk desk(held(ModelId::kVintage, {0.03, 0.02, -0.02}));
  ASSERT_TRUE(desk.device->start(rtbus::monotonic_ns()));
  ASSERT_EQ(desk.loop(100, kPush), 100);
  desk.port->unplug();
  EXPECT_TRUE(desk.eventually_zero_force());  // the device's own watchdog
  EXPECT_EQ(desk.device->read(rtbus::monotonic_ns() + rtbus::kNsPerS, desk.sample), IoStatus::kLost);
  desk.port->replug();
  EXPECT_EQ(desk.loop(100, kNothing), 100);
  EXPECT_EQ(desk.device->figures().losses, 1U);
}

TEST(PhantomLink, ReplugWithoutPowerStaysWithoutForceAndSaysWhy) {
  Desk desk(held(ModelId::kVintage, {0.03, 0.02, -0.02}));
  ASSERT_TRUE(desk.device->start(rtbus::monotonic_ns()));
  ASSERT_EQ(desk.loop(100, kPush), 100);
  (void)desk.device->take_notice();
  desk.port->unplug();
  EXPECT_TRUE(desk.eventually_zero_force());
  desk.locked([&] { desk.arm.power_cycle(rtbus::monotonic_ns()); });
  desk.port->replug();
  std::string told;
  for (int i = 0; i < 2000 && told.find("without power") == std::string::npos; ++i) {
    told += desk.device->take_notice();
    rtbus::sleep_until(rtbus::monotonic_ns() + 5 * rtbus::kNsPerMs);
  }
  EXPECT_THAT(told, ::testing::HasSubstr("without power"));
  EXPECT_EQ(desk.device->figures().state, usb::LinkState::kNotReady);
  EXPECT_EQ(desk.applied_n().norm(), 0.0);
}

TEST(PhantomLink, StopLeavesZeroForce) {
  Desk desk(held(ModelId::kVintage, {0, 0, 0}));
  ASSERT_TRUE(desk.device->start(rtbus::monotonic_ns()));
  ASSERT_EQ(desk.loop(200, kPush), 200);
  desk.device->stop();
  EXPECT_EQ(desk.arm.firmware().currents_ma(), (std::array<double, 3>{0, 0, 0}));
  EXPECT_EQ(desk.applied_n().norm(), 0.0);
}

TEST(PhantomLink, SurvivesAllFaultsOfTheLinkAtOnce) {
  Desk desk(held(ModelId::kVintage, {0.03, 0.02, -0.02}));
  ASSERT_TRUE(desk.device->start(rtbus::monotonic_ns()));
  ASSERT_EQ(desk.loop(50, kNothing), 50);
  desk.locked([&] {
    auto& faults = desk.arm.faults();
    faults.lose_reply = 0.02;
    faults.late_reply = 0.02;
    faults.split_reply = 0.05;
    faults.merge_reply = 0.02;
    faults.stall_in = 0.005;
  });
  ASSERT_EQ(desk.loop(1000, kPush), 1000);
  EXPECT_GT(desk.device->figures().protocol.lost_frames, 0U);
  desk.locked([&] { desk.arm.faults() = {}; });
  ASSERT_EQ(desk.loop(200, kNothing), 200);
  EXPECT_EQ(desk.device->figures().state, usb::LinkState::kRunning);
}

TEST(PhantomLink, SaysWhyItDoesNotStart) {
  auto settings = held(ModelId::kVintage, {0, 0, 0});
  settings.faults.mute = true;
  Desk desk(settings);
  const auto started = desk.device->start(rtbus::monotonic_ns());
  ASSERT_FALSE(started);
  EXPECT_THAT(started.error().message, ::testing::HasSubstr("does not answer"));
}

}  // namespace
}  // namespace drivers::phantom
