// Every fault that the virtual arm can play: it is counted, the force is right or zero, zero within 20 ms while the
// link works (else within the device's own 100 ms), and all is well again afterwards.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <functional>
#include <ostream>
#include <string>

#include "tests/unit/phantom/rig.hpp"

namespace drivers::phantom {
namespace {

using testing::held;
using testing::kMs;
using testing::Rig;
using usb::ExchangeStatus;
using virtual_usb::Faults;

constexpr Vec3 kForce{0.5, 1.0, -0.5};
const Eigen::Vector3d kWanted(0.5, 1.0, -0.5);

struct Case {
  const char* name;
  std::function<void(Faults&)> set;
  std::function<std::uint64_t(const usb::LinkCounters&)> count;  // what the user sees
  double samples_at_least;                                       // share of exchanges that still measure
};
void PrintTo(const Case& c, std::ostream* out) { *out << c.name; }

class PhantomFaults : public ::testing::TestWithParam<Case> {};

TEST_P(PhantomFaults, AreCountedHarmlessAndOver) {
  Rig rig(held(ModelId::kVintage, {0.02, 0.01, -0.01}));
  ASSERT_EQ(rig.bring_up(), "");
  ASSERT_EQ(rig.run(200, kForce), 200);
  ASSERT_LT((rig.tip_force_n() - kWanted).norm(), 0.02 * kWanted.norm());

  GetParam().set(rig.device.faults());
  int samples = 0;
  for (int i = 0; i < 2000; ++i) {
    samples += rig.exchange(kForce) == ExchangeStatus::kSample;
    // Never a force that nobody asked for: the commanded one, or none.
    const Eigen::Vector3d force_n = rig.tip_force_n();
    ASSERT_TRUE(force_n.norm() == 0.0 || (force_n - kWanted).norm() < 0.02 * kWanted.norm())
        << i << ": " << force_n.transpose();
  }
  EXPECT_GE(samples, GetParam().samples_at_least * 2000);
  EXPECT_GT(GetParam().count(rig.protocol->counters()), 0u);
  const usb::LinkCounters& c = rig.protocol->counters();
  RecordProperty("lost", static_cast<int>(c.lost_frames));
  RecordProperty("bad", static_cast<int>(c.bad_frames));

  rig.device.faults() = Faults{};
  rig.run(100, kForce);
  EXPECT_EQ(rig.protocol->readiness(), usb::Readiness::kReady);
  EXPECT_EQ(rig.run(200, kForce), 200);
  EXPECT_LT((rig.tip_force_n() - kWanted).norm(), 0.02 * kWanted.norm());
  EXPECT_LT((rig.measured_m() - Eigen::Vector3d(0.02, 0.01, -0.01)).norm(), 60e-6);
}

INSTANTIATE_TEST_SUITE_P(
    All, PhantomFaults,
    ::testing::Values(
        Case{"LostReplies", [](Faults& f) { f.lose_reply = 0.1; }, [](const auto& c) { return c.lost_frames; }, 0.8},
        Case{"LateReplies",
             [](Faults& f) {
               f.late_reply = 0.1;
               f.late_ms = 5.0;
             },
             [](const auto& c) { return c.exchanges; }, 0.99},
        Case{"VeryLateReplies",
             [](Faults& f) {
               f.late_reply = 0.1;
               f.late_ms = 15.0;
             },
             [](const auto& c) { return c.lost_frames; }, 0.8},
        Case{"SplitReplies", [](Faults& f) { f.split_reply = 0.5; }, [](const auto& c) { return c.exchanges; }, 1.0},
        Case{"MergedReplies", [](Faults& f) { f.merge_reply = 0.1; }, [](const auto& c) { return c.lost_frames; }, 0.8},
        Case{"Stalls", [](Faults& f) { f.stall_in = 0.1; }, [](const auto& c) { return c.line_errors; }, 0.8},
        Case{"LostBytes", [](Faults& f) { f.overrun = true; }, [](const auto& c) { return c.line_errors; }, 0.8},
        Case{"EmptyPackets", [](Faults& f) { f.status_flood = true; }, [](const auto& c) { return c.exchanges; }, 1.0}),
    [](const ::testing::TestParamInfo<Case>& c) { return std::string(c.param.name); });

TEST(PhantomFault, BitFlipsCostAnswersAndNeverTheHome) {
  // Nothing in the protocol notices a changed digit (USB's own checksum does); what no arm can do is refused.
  Rig rig(held(ModelId::kVintage, {0.02, 0.01, -0.01}));
  ASSERT_EQ(rig.bring_up(), "");
  rig.run(100, kForce);
  rig.device.faults().flip_reply_bit = 0.002;
  double worst_n = 0.0;
  for (int i = 0; i < 3000; ++i) {
    (void)rig.exchange(kForce);
    worst_n = std::max(worst_n, rig.tip_force_n().norm());
  }
  EXPECT_GT(rig.protocol->counters().bad_frames, 20u);
  EXPECT_LT(worst_n, 1.3 * kWanted.norm());
  rig.device.faults() = Faults{};
  rig.run(100, kForce);
  EXPECT_EQ(rig.protocol->readiness(), usb::Readiness::kReady);
  EXPECT_LT((rig.tip_force_n() - kWanted).norm(), 0.02 * kWanted.norm());
}

TEST(PhantomFault, MuteDeviceGetsZeroWithinTwentyMilliseconds) {
  Rig rig(held(ModelId::kVintage));
  ASSERT_EQ(rig.bring_up(), "");
  rig.run(100, kForce);
  rig.device.faults().mute = true;
  const std::uint64_t begin_ns = rig.channel.now_ns();
  while (rig.tip_force_n().norm() > 0.0 && rig.channel.now_ns() < begin_ns + 200 * kMs) {
    (void)rig.protocol->send(rig.channel, kForce, 1e-3, rig.channel.now_ns() + kMs);
    (void)rig.protocol->receive(rig.channel, rig.sample, rig.channel.now_ns() + kMs);
    rig.device.advance_to(rig.channel.now_ns());
  }
  EXPECT_LT(rig.channel.now_ns() - begin_ns, 20 * kMs);
  for (int i = 0; i < 50; ++i) {
    EXPECT_EQ(rig.exchange(kForce), ExchangeStatus::kNothing);
    EXPECT_EQ(rig.tip_force_n().norm(), 0.0);
  }
  EXPECT_GT(rig.protocol->counters().lost_frames, 10u);
  rig.device.faults().mute = false;
  rig.run(50, kForce);
  EXPECT_LT((rig.tip_force_n() - kWanted).norm(), 0.02 * kWanted.norm());
}

TEST(PhantomFault, PauseOfTwentyMillisecondsIsSurvived) {
  auto settings = held(ModelId::kVintage);
  settings.faults.pause_at_s = 0.5;
  settings.faults.pause_ms = 20.0;
  Rig rig(settings);
  ASSERT_EQ(rig.bring_up(), "");
  for (int i = 0; i < 1000; ++i) {
    (void)rig.exchange(kForce);
    const Eigen::Vector3d force_n = rig.tip_force_n();
    ASSERT_TRUE(force_n.norm() == 0.0 || (force_n - kWanted).norm() < 0.02 * kWanted.norm()) << i;
  }
  EXPECT_GE(rig.protocol->counters().lost_frames, 1u);
  // The zero that was sent into the pause met the command before it: two errors, by the book.
  EXPECT_EQ(rig.protocol->counters().line_errors + rig.device.firmware().rejected() > 0u, true);
  EXPECT_EQ(rig.run(200, kForce), 200);
  EXPECT_LT((rig.tip_force_n() - kWanted).norm(), 0.02 * kWanted.norm());
}

TEST(PhantomFault, LongPauseEndsInTheDevicesOwnWatchdog) {
  auto settings = held(ModelId::kVintage);
  settings.faults.pause_at_s = 0.5;
  settings.faults.pause_ms = 400.0;
  Rig rig(settings);
  ASSERT_EQ(rig.bring_up(), "");
  std::uint64_t last_force_ns = 0;
  const std::uint64_t power_up_ns = rig.channel.now_ns();
  for (int i = 0; i < 3000 && rig.channel.now_ns() < power_up_ns + 850 * kMs; ++i) {
    (void)rig.exchange(kForce);
    if (rig.tip_force_n().norm() > 0.0) last_force_ns = rig.channel.now_ns();
  }
  EXPECT_EQ(rig.device.firmware().watchdog_trips(), 1u);
  EXPECT_GT(last_force_ns, 0u);
  rig.run(100, kForce);
  EXPECT_EQ(rig.run(100, kForce), 100);
  EXPECT_LT((rig.tip_force_n() - kWanted).norm(), 0.02 * kWanted.norm());
}

TEST(PhantomFault, HostThatDiesLeavesTheForceToTheWatchdog) {
  Rig rig(held(ModelId::kVintage));
  ASSERT_EQ(rig.bring_up(), "");
  rig.run(100, kForce);
  const std::uint64_t begin_ns = rig.channel.now_ns();
  rig.device.advance_to(begin_ns + 90 * kMs);
  EXPECT_GT(rig.tip_force_n().norm(), 0.0);
  rig.device.advance_to(begin_ns + 101 * kMs);
  EXPECT_EQ(rig.tip_force_n().norm(), 0.0);
}

TEST(PhantomFault, UnplugIsLostAndReplugGoesOnWhenTheCountersDo) {
  Rig rig(held(ModelId::kVintage, {0.03, -0.02, 0.02}));
  ASSERT_EQ(rig.bring_up(), "");
  rig.run(100, kForce);
  rig.channel.unplug_at(rig.channel.now_ns() + kMs / 2);
  ExchangeStatus got = ExchangeStatus::kSample;
  for (int i = 0; i < 5 && got != ExchangeStatus::kLost; ++i) got = rig.exchange(kForce);
  ASSERT_EQ(got, ExchangeStatus::kLost);
  rig.device.advance_to(rig.channel.now_ns() + 150 * kMs);
  EXPECT_EQ(rig.tip_force_n().norm(), 0.0);
  rig.channel.replug();
  ASSERT_EQ(rig.bring_up(), "");
  EXPECT_EQ(rig.run(100, kForce), 100);
  EXPECT_EQ(rig.protocol->readiness(), usb::Readiness::kReady);
}

TEST(PhantomFault, ReplugWithoutPowerNeedsTheButton) {
  auto settings = held(ModelId::kVintage, {0.03, -0.02, 0.02});
  settings.hand = simulated::Hand();  // its friction holds it
  Rig rig(settings);
  ASSERT_EQ(rig.bring_up(), "");
  rig.run(100);
  rig.channel.unplug_at(rig.channel.now_ns() + kMs / 2);
  rig.run(3);
  rig.channel.replug();
  rig.device.power_cycle(rig.channel.now_ns());
  ASSERT_EQ(rig.bring_up(), "");
  for (int i = 0; i < 1000; ++i) {
    (void)rig.exchange(kForce);
    ASSERT_EQ(rig.tip_force_n().norm(), 0.0);
  }
  EXPECT_EQ(rig.protocol->readiness(), usb::Readiness::kNotHomed);
  EXPECT_THAT(rig.protocol->remedy(), ::testing::HasSubstr("without power"));
  // A button that is pressed elsewhere makes a wrong zero: the sentence says where the arm has to be.
  EXPECT_THAT(rig.protocol->remedy(), ::testing::HasSubstr("the upper arm horizontal and the forearm straight down"));
  // Brought home and the button pressed.
  ASSERT_TRUE(rig.device.arm().place({0.0, -0.015, 0.0}));
  rig.run(10);
  rig.device.hold_button(true);
  rig.run(50);
  rig.device.hold_button(false);
  rig.run(300);
  EXPECT_EQ(rig.protocol->readiness(), usb::Readiness::kReady);
  EXPECT_LT((rig.measured_m() - Eigen::Vector3d(0.0, -0.015, 0.0)).norm(), 60e-6);
}

TEST(PhantomFault, UnplugWhileBeingBroughtUpIsSaid) {
  for (const double at_ms : {0.01, 0.1, 0.5, 5.0, 10.1, 10.3}) {
    Rig rig(held(ModelId::kVintage));
    rig.channel.unplug_at(rig.channel.now_ns() + static_cast<std::uint64_t>(at_ms * 1e6));
    EXPECT_THAT(rig.bring_up(), ::testing::HasSubstr("unplugged")) << at_ms;
  }
}

TEST(PhantomFault, StopWhileBeingBroughtUpEndsIt) {
  Rig rig(held(ModelId::kVintage));
  rig.channel.stop_at(rig.channel.now_ns() + 5 * kMs);
  EXPECT_THAT(rig.bring_up(), ::testing::HasSubstr("stopped"));
}

TEST(PhantomFault, MuteFromTheStartSaysSoWithinASecond) {
  auto settings = held(ModelId::kVintage);
  settings.faults.mute = true;
  Rig rig(settings);
  const std::uint64_t begin_ns = rig.channel.now_ns();
  EXPECT_THAT(rig.bring_up(), ::testing::HasSubstr("does not answer"));
  EXPECT_LT(rig.channel.now_ns() - begin_ns, 1000 * kMs);
}

TEST(PhantomFault, GimbalSensorThatFailsIsCountedAndTheForceStays) {
  Rig rig(held(ModelId::kPolhem));
  ASSERT_EQ(rig.bring_up(), "");
  rig.run(100, kForce);
  rig.device.firmware().fail_gimbal(kGimbal1Failed);
  EXPECT_EQ(rig.run(100, kForce), 100);
  EXPECT_EQ(rig.protocol->counters().line_errors, 100u);
  EXPECT_LT((rig.tip_force_n() - kWanted).norm(), 0.02 * kWanted.norm());
}

}  // namespace
}  // namespace drivers::phantom
