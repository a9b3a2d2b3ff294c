// The virtual arm as a USB device, and driver against virtual arm in simulated time: pose, force, wall, heat.
#include "drivers/virtual_devices/phantom/virtual_phantom.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "tests/unit/phantom/rig.hpp"

namespace drivers::phantom {
namespace {

using Eigen::Vector3d;
using testing::held;
using testing::kMs;
using testing::model;
using testing::Rig;
using usb::ExchangeStatus;
using virtual_usb::Reply;
using virtual_usb::VirtualPhantom;

TEST(VirtualPhantomUsb, DescriptorsSayWhoItIs) {
  for (const bool high : {true, false}) {
    auto settings = held(ModelId::kVintage);
    settings.high_speed = high;
    const VirtualPhantom device(settings);
    const auto& d = device.descriptors();
    ASSERT_EQ(d.device.size(), 18u);
    EXPECT_EQ(d.device[8] | d.device[9] << 8, 0x16C0);
    EXPECT_EQ(d.device[10] | d.device[11] << 8, 0x0483);
    EXPECT_EQ(d.device[12] | d.device[13] << 8, 0x0279);
    EXPECT_EQ(d.configuration[2] | d.configuration[3] << 8, static_cast<int>(d.configuration.size()));
    std::size_t sum = 0;
    int bulk = 0;
    for (std::size_t at = 0; at < d.configuration.size(); at += d.configuration[at]) {
      ASSERT_GE(d.configuration[at], 2);
      sum += d.configuration[at];
      if (d.configuration[at + 1] == 5 && d.configuration[at + 3] == 2) {
        ++bulk;
        EXPECT_EQ(d.configuration[at + 4] | d.configuration[at + 5] << 8, high ? 512 : 64);
      }
    }
    EXPECT_EQ(sum, d.configuration.size());
    EXPECT_EQ(bulk, 2);
  }
}

TEST(VirtualPhantomUsb, AnswersOnceSeventyFiveMicrosecondsAfterWriting) {
  VirtualPhantom device(held(ModelId::kVintage));
  const std::string command = "[0,0,0]\n";
  ASSERT_EQ(device.out_packet(3, {reinterpret_cast<const std::uint8_t*>(command.data()), command.size()}, 1000).reply,
            Reply::kAck);
  std::uint64_t now_ns = 1000;
  auto in = device.in_packet(4, now_ns);
  while (in.reply == Reply::kNak) {
    ASSERT_GT(in.retry_ns, now_ns);
    now_ns = in.retry_ns;
    in = device.in_packet(4, now_ns);
  }
  EXPECT_EQ(now_ns, 1000u + 20'000 + 75'000);
  EXPECT_EQ(in.bytes.front(), '[');
  EXPECT_EQ(in.bytes.back(), '\n');
  EXPECT_EQ(device.in_packet(4, now_ns + kMs).reply, Reply::kNak);
}

TEST(VirtualPhantomUsb, WhatNobodyReadsIsDropped) {
  VirtualPhantom device(held(ModelId::kVintage));
  const std::string command = "[0,0,0]\n";
  for (std::uint64_t ms = 1; ms <= 200; ++ms) {
    (void)device.out_packet(3, {reinterpret_cast<const std::uint8_t*>(command.data()), command.size()}, ms * kMs);
    device.advance_to(ms * kMs + kMs / 2);
  }
  EXPECT_GT(device.dropped_unread(), 70u);
  EXPECT_LT(device.dropped_unread(), 85u);
}

TEST(VirtualPhantomUsb, Baud134IsTheBootLoader) {
  Rig rig(held(ModelId::kVintage));
  ASSERT_EQ(rig.bring_up(), "");
  const usb::Setup coding{0x21, 0x20, 0, 0};
  constexpr std::array<std::uint8_t, 7> k134{134, 0, 0, 0, 0, 0, 8};
  ASSERT_EQ(rig.channel.control_out(coding, k134, rig.channel.now_ns() + kMs), usb::UsbStatus::kOk);
  EXPECT_TRUE(rig.device.in_boot_loader());
  EXPECT_EQ(rig.exchange({}), ExchangeStatus::kNothing);
}

struct Case {
  ModelId id;
  bool high_speed;
};

class PhantomOnUsb : public ::testing::TestWithParam<Case> {};

TEST_P(PhantomOnUsb, MeasuresTheTipToAQuantum) {
  for (const Vector3d& at : {Vector3d(0, 0, 0), Vector3d(0.03, -0.02, 0.02), Vector3d(-0.05, 0.05, -0.04)}) {
    auto settings = held(GetParam().id, at);
    settings.high_speed = GetParam().high_speed;
    Rig rig(settings);
    ASSERT_EQ(rig.bring_up(), "");
    ASSERT_EQ(rig.run(100), 100);
    EXPECT_LT((rig.measured_m() - at).norm(), 60e-6);
    EXPECT_EQ(rig.protocol->counters().lost_frames, 0u);
    EXPECT_EQ(rig.protocol->counters().bad_frames, 0u);
    EXPECT_EQ(rig.protocol->counters().resyncs, 0u);
    EXPECT_EQ(rig.device.firmware().rejected(), 0u);
  }
}

TEST_P(PhantomOnUsb, ForceAtTheHandIsTheCommandedOneWithinTwoPercent) {
  for (const Vector3d& at : {Vector3d(0, 0, 0), Vector3d(0.03, -0.02, 0.02), Vector3d(-0.05, 0.05, -0.04)}) {
    auto settings = held(GetParam().id, at);
    settings.high_speed = GetParam().high_speed;
    Rig rig(settings);
    ASSERT_EQ(rig.bring_up(), "");
    for (const Vec3& force : {Vec3{1, 0, 0}, Vec3{0, 1, 0}, Vec3{0, 0, 1}, Vec3{-0.6, 1.2, 0.5}, Vec3{0, -2, 0}}) {
      rig.run(3, force);
      const Vector3d wanted(force[0], force[1], force[2]);
      EXPECT_LT((rig.tip_force_n() - wanted).norm(), 0.02 * wanted.norm())
          << at.transpose() << ": " << wanted.transpose() << " gave " << rig.tip_force_n().transpose();
      rig.run(300);  // cool down
    }
  }
}

TEST_P(PhantomOnUsb, WallSettles) {
  // A hand pushes 12 mm deep onto a wall of half the arm's stiffness.
  auto settings = held(GetParam().id);
  settings.high_speed = GetParam().high_speed;
  simulated::PushMotion push;
  push.start_m = {0.0, 0.008, 0.0};
  push.distance_m = 0.020;
  push.start_s = 0.2;
  settings.mechanics.start_position_m = push.start_m;
  settings.hand = simulated::Hand(push, simulated::HandImpedance{300.0, 3.0, 0.08, 10.0});
  Rig rig(settings);
  ASSERT_EQ(rig.bring_up(), "");
  const double stiffness = 0.5 * settings.model.limits.max_stiffness_n_per_m;
  double before_m = rig.device.arm().mechanics().position_m().y();
  double speed_m_s = 0.0;
  double low_m = 1.0, high_m = -1.0, sum_n = 0.0;
  Vec3 force{};
  for (int i = 0; i < 4000; ++i) {
    ASSERT_EQ(rig.exchange(force), ExchangeStatus::kSample);
    const double y_m = rig.sample.position_m[1];
    speed_m_s += 0.1 * ((y_m - before_m) / 1e-3 - speed_m_s);
    before_m = y_m;
    force = {0.0, y_m < 0.0 ? std::max(0.0, -stiffness * y_m - 1.0 * speed_m_s) : 0.0, 0.0};
    if (i < 3000) continue;
    const double true_m = rig.device.arm().mechanics().position_m().y();
    low_m = std::min(low_m, true_m);
    high_m = std::max(high_m, true_m);
    sum_n += rig.tip_force_n().y() / 1000.0;
  }
  EXPECT_LT(high_m - low_m, 100e-6);  // it rests
  EXPECT_LT(high_m, -1e-3);           // in the wall
  const double depth_m = -0.5 * (high_m + low_m);
  EXPECT_NEAR(sum_n, stiffness * depth_m, 0.02 * stiffness * depth_m + stiffness * 60e-6);
  // The hand's spring carries it, within the arm's dry friction.
  EXPECT_NEAR(sum_n, 300.0 * (0.012 - depth_m), settings.mechanics.coulomb_n + 0.02);
  EXPECT_EQ(rig.protocol->counters().lost_frames, 0u);
}

TEST_P(PhantomOnUsb, HeatBudgetLowersTheForceAndKeepsItsDirection) {
  auto settings = held(GetParam().id);
  settings.high_speed = GetParam().high_speed;
  Rig rig(settings);
  ASSERT_EQ(rig.bring_up(), "");
  // The Polhem's motors have more than twice the others' torque for a current.
  const double size = GetParam().id == ModelId::kPolhem ? 3.0 : 1.0;
  const Vec3 force{1.5 * size, 4.0 * size, 1.0 * size};
  const Vector3d direction = Vector3d(1.5, 4.0, 1.0).normalized();
  rig.run(100, force);
  EXPECT_GT(rig.tip_force_n().norm(), 4.3 * size);
  double largest_ma = 0.0;
  for (int i = 0; i < 60000; ++i) {
    (void)rig.exchange(force);
    if (i < 50000) continue;
    for (const int ma : rig.protocol->last_currents_ma()) largest_ma = std::max(largest_ma, std::abs(ma) * 1.0);
  }
  EXPECT_LE(largest_ma, 1275.0);
  EXPECT_LE(rig.protocol->protection().load(), 1.01);
  EXPECT_GT(rig.protocol->counters().clamped, 10000u);
  EXPECT_GT(rig.tip_force_n().normalized().dot(direction), 0.9995);
}

INSTANTIATE_TEST_SUITE_P(Arms, PhantomOnUsb,
                         ::testing::Values(Case{ModelId::kVintage, true}, Case{ModelId::kWoody, true},
                                           Case{ModelId::kPolhem, true}, Case{ModelId::kVintage, false}),
                         [](const ::testing::TestParamInfo<Case>& c) {
                           return std::string(model(c.param.id).key) + (c.param.high_speed ? "HighSpeed" : "FullSpeed");
                         });

TEST(PhantomHomingOnUsb, AtStartHomesAnArmThatIsHeldAtHome) {
  // Vintage: home is the classic reset pose, 15 mm below the centre.
  Rig rig(held(ModelId::kVintage, {0.0, -0.015, 0.0}), HomingMode::kAtStart);
  ASSERT_EQ(rig.bring_up(), "");
  rig.run(200, {0, 1, 0});
  EXPECT_EQ(rig.tip_force_n().norm(), 0.0);
  rig.run(200, {0, 1, 0});
  EXPECT_EQ(rig.protocol->readiness(), usb::Readiness::kReady);
  EXPECT_NEAR(rig.tip_force_n().y(), 1.0, 0.02);
}

TEST(PhantomHomingOnUsb, PoweredUpElsewhereAndStartedThereIsNotBelievedOnceItMovesBack) {
  // Plugged in at the centre instead of home: brought home by hand, the counters do not read zero there.
  auto settings = held(ModelId::kVintage);
  settings.zeroed_at_home = false;
  simulated::PushMotion push;
  push.start_m = Vector3d::Zero();
  push.distance_m = 0.015;
  settings.hand = simulated::Hand(push, simulated::HandImpedance{5000.0, 20.0, 0.1, 100.0});
  settings.button_at_s = 1.5;
  Rig rig(settings, HomingMode::kButton);
  ASSERT_EQ(rig.bring_up(), "");
  rig.run(1400, {0, 1, 0});
  EXPECT_EQ(rig.protocol->readiness(), usb::Readiness::kNotHomed);
  EXPECT_EQ(rig.tip_force_n().norm(), 0.0);
  rig.run(1000, {0, 1, 0});  // the button, with the arm at home
  EXPECT_EQ(rig.protocol->readiness(), usb::Readiness::kReady);
  const Vector3d true_m = rig.device.arm().mechanics().position_m();
  EXPECT_LT((rig.measured_m() - true_m).norm(), 1e-3);  // as well as the hand found home
}

TEST(PhantomHomingOnUsb, CalibrationFirmwareWaitsForItsButton) {
  auto settings = held(ModelId::kVintage, {0.0, -0.015, 0.0});
  settings.calibration_needed = true;
  settings.zeroed_at_home = false;
  settings.button_at_s = 1.0;
  Rig rig(settings, HomingMode::kAtStart);
  ASSERT_EQ(rig.bring_up(), "");
  rig.run(800, {0, 1, 0});
  EXPECT_EQ(rig.protocol->readiness(), usb::Readiness::kNotHomed);
  EXPECT_EQ(rig.tip_force_n().norm(), 0.0);
  rig.run(800, {0, 1, 0});
  EXPECT_EQ(rig.protocol->readiness(), usb::Readiness::kReady);
  EXPECT_NEAR(rig.tip_force_n().y(), 1.0, 0.02);
}

TEST(PhantomGimbalOnUsb, OrientationFollowsTheSensors) {
  Rig rig(held(ModelId::kVintage));
  ASSERT_EQ(rig.bring_up(), "");
  rig.run(5);
  const Quat before = rig.sample.orientation_wxyz;
  rig.device.set_gimbal({0.3, 0.0, 0.0});
  rig.run(5);
  double dot = 0.0;
  for (std::size_t i = 0; i < 4; ++i) dot += before[i] * rig.sample.orientation_wxyz[i];
  EXPECT_NEAR(2.0 * std::acos(dot), 0.3, 0.004);
}

}  // namespace
}  // namespace drivers::phantom
