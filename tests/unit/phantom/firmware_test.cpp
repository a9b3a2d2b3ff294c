// The virtual controller against the quirks that are written down about the real one.
#include "drivers/virtual_devices/phantom/phantom_firmware.hpp"
#include "rtbus/clock.hpp"

#include <gtest/gtest.h>

#include <string>
#include <string_view>
#include <vector>

namespace drivers::virtual_usb {
namespace {

constexpr std::array<std::int32_t, 3> kArm{1000, -1500, 700};
constexpr std::array<std::int32_t, 3> kGimbal{512, 1023, 3};

class Controller {
 public:
  explicit Controller(bool calibration_needed = false) : firmware(2, false, calibration_needed) {}
  // All answers to what arrives at once.
  std::vector<std::string> send(std::string_view text) {
    firmware.receive({reinterpret_cast<const std::uint8_t*>(text.data()), text.size()});
    std::vector<std::string> out;
    while (firmware.has_input()) {
      now_ns += 50'000;
      if (auto reply = firmware.loop(now_ns, arm, kGimbal)) out.push_back(*reply);
    }
    return out;
  }
  // The error field of the only answer.
  int error(std::string_view text) {
    const auto replies = send(text);
    if (replies.size() != 1) return -1;
    return std::stoi(replies[0].substr(replies[0].rfind(',') + 1));
  }
  PhantomFirmware firmware;
  std::array<std::int32_t, 3> arm = kArm;
  std::uint64_t now_ns = 0;
};

TEST(Firmware, AnswersOncePerCommandWithItsCounters) {
  Controller c;
  EXPECT_EQ(c.send("[0,0,0]\n"), (std::vector<std::string>{"[2,1000,-1500,700,512,1023,3,0]\n"}));
  EXPECT_TRUE(c.send("").empty());
  EXPECT_TRUE(c.send("\n\n").empty());
}

TEST(Firmware, NegativeVectors) {
  EXPECT_EQ(Controller().error("[1,2]"), 512);
  EXPECT_EQ(Controller().error("]"), 256);
  EXPECT_EQ(Controller().error(std::string(127, '[')), 128);
  EXPECT_EQ(Controller().error("[1,2,3]X"), 8);
  EXPECT_EQ(Controller().error("[a,2,3]"), 1024);
  EXPECT_EQ(Controller().error("[,,]"), 1024);
  EXPECT_EQ(Controller().error("[1.5,2,3]"), 1024);
  EXPECT_EQ(Controller().error(",[1,2,3]"), 512);
  EXPECT_EQ(Controller().error("[ 1, 2, 3]\r\n"), 0);
  EXPECT_EQ(Controller().error(std::string("[1,2,3]\n\0\0\0", 11)), 0);
  EXPECT_EQ(Controller().error("garbage[1,2,3]"), 0);
}

TEST(Firmware, TwoCommandsAtOnceGiveTwoErrorsAndMoveNothing) {
  Controller c;
  ASSERT_EQ(c.error("[100,0,0]\n"), 0);
  const auto replies = c.send("[0,0,0][0,0,0]");
  ASSERT_EQ(replies.size(), 2u);
  EXPECT_EQ(replies[0], "[2,1000,-1500,700,512,1023,3,8]\n");
  EXPECT_EQ(replies[1], "[2,1000,-1500,700,512,1023,3,256]\n");
  EXPECT_NEAR(c.firmware.currents_ma()[0], 100.0, 1.0);  // the old current flows on
}

TEST(Firmware, ErrorAnswersRepeatOldCountersAndDoNotFeedTheWatchdog) {
  Controller c;
  ASSERT_EQ(c.error("[100,0,0]\n"), 0);
  c.arm = {5, 6, 7};
  EXPECT_EQ(c.send("[1,2]"), (std::vector<std::string>{"[2,1000,-1500,700,512,1023,3,512]\n"}));
  c.now_ns = 99 * rtbus::kNsPerMs;
  c.firmware.watchdog(c.now_ns);
  EXPECT_TRUE(c.firmware.amplifiers_on());
  c.now_ns = 102 * rtbus::kNsPerMs;
  c.firmware.watchdog(c.now_ns);
  EXPECT_FALSE(c.firmware.amplifiers_on());
  EXPECT_EQ(c.firmware.currents_ma()[0], 0.0);
  EXPECT_EQ(c.firmware.watchdog_trips(), 1u);
  EXPECT_EQ(c.send("[0,0,0]\n"), (std::vector<std::string>{"[2,5,6,7,512,1023,3,0]\n"}));
  EXPECT_TRUE(c.firmware.amplifiers_on());
}

TEST(Firmware, OverLimitIsNoCurrentAndNoError) {
  Controller c;
  EXPECT_EQ(c.error("[7000,-6000,6000]\n"), 0);
  const auto ma = c.firmware.currents_ma();
  EXPECT_EQ(ma[0], 0.0);
  EXPECT_NEAR(ma[1], -6000.0, 1.0);
  EXPECT_NEAR(ma[2], 6000.0, 1.0);
}

TEST(Firmware, CurrentComesInStepsOfThePwm) {
  Controller c;
  ASSERT_EQ(c.error("[0,-659,0]\n"), 0);
  EXPECT_NEAR(c.firmware.currents_ma()[1], -659.0, 1.831 / 2);
  EXPECT_NE(c.firmware.currents_ma()[1], -659.0);
}

TEST(Firmware, ButtonZeroesAfterItsDebounceTime) {
  Controller c;
  c.firmware.button(0, true, kArm, kGimbal);
  c.firmware.button(9 * rtbus::kNsPerMs, true, kArm, kGimbal);
  EXPECT_EQ(c.send("[0,0,0]\n")[0], "[2,1000,-1500,700,512,1023,3,0]\n");
  c.firmware.button(10 * rtbus::kNsPerMs, true, kArm, kGimbal);
  EXPECT_EQ(c.send("[0,0,0]\n")[0], "[2,0,0,0,0,0,0,0]\n");
}

TEST(Firmware, MagneticGimbalIsReadOneSensorATurn) {
  PhantomFirmware firmware(1, true, false);
  const auto ask = [&](const std::array<std::int32_t, 3>& gimbal) {
    firmware.receive({reinterpret_cast<const std::uint8_t*>("[0,0,0]\n"), 8});
    return *firmware.loop(0, {}, gimbal);
  };
  EXPECT_EQ(ask({1, 2, 3}), "[1,0,0,0,1,0,0,0]\n");
  EXPECT_EQ(ask({10, 20, 30}), "[1,0,0,0,1,20,0,0]\n");
  EXPECT_EQ(ask({100, 200, 300}), "[1,0,0,0,1,20,300,0]\n");
  EXPECT_EQ(ask({1000, 200, 300}), "[1,0,0,0,1000,20,300,0]\n");
}

TEST(Firmware, CalibrationVariantFakesUntilItsButton) {
  Controller c(true);
  EXPECT_EQ(c.send("[1,0,0]\n")[0], "[2,8000,1,0,512,1023,3,0]\n");
  EXPECT_FALSE(c.firmware.amplifiers_on());
  c.firmware.button(0, true, kArm, kGimbal);
  c.firmware.button(10 * rtbus::kNsPerMs, true, kArm, kGimbal);
  EXPECT_EQ(c.send("[1,0,0]\n")[0], "[2,0,0,0,0,0,0,0]\n");
  EXPECT_TRUE(c.firmware.amplifiers_on());
}

}  // namespace
}  // namespace drivers::virtual_usb
