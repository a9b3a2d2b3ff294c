// The running Falcon: homing, forces at the virtual hand, the wall in closed loop, and every fault of the link. All in
// simulated time.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Core>

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <span>
#include <vector>

#include "tests/unit/falcon/virtual_bench.hpp"

namespace drivers::falcon {
namespace {

using Eigen::Vector3d;
using tests::FalconBench;
using virtual_usb::FalconHoming;
using virtual_usb::Faults;
using virtual_usb::VirtualFalconSettings;

// A hand that stays at `at_m`, on an arm that is homed at once.
VirtualFalconSettings held(const Vector3d& at_m, double stiffness_n_per_m = 2000.0) {
  VirtualFalconSettings settings;
  settings.arm.homing = FalconHoming::kDone;
  settings.arm.hand = {simulated::HoldMotion{at_m}, {stiffness_n_per_m, 20.0, 0.15, 40.0}};
  settings.arm.mechanics.start_position_m = at_m;
  return settings;
}

FalconSettings without_weight() {
  FalconSettings settings;
  settings.grip_mass_kg = 0.0;
  return settings;
}

Vector3d applied_n(FalconBench& bench) {
  bench.device.arm().advance_to(bench.channel.now_ns());
  return bench.device.arm().mechanics().applied_force_n();
}

// ---- Homing

TEST(FalconExchange, HomesByItselfWithinSecondsAndShowsItsLights) {
  FalconBench bench;
  ASSERT_EQ(bench.bring_up(), "");
  ASSERT_TRUE(bench.run(0.2));
  EXPECT_EQ(bench.protocol->readiness(), usb::Readiness::kNotHomed);
  EXPECT_THAT(bench.protocol->remedy(), ::testing::HasSubstr("pull the grip all the way out"));
  EXPECT_EQ(bench.device.board().flags(), kHoming | kRedLed);
  const double took_s = bench.home();
  EXPECT_GT(took_s, 0.5);
  EXPECT_LT(took_s, 4.0);
  ASSERT_TRUE(bench.run(0.01));
  EXPECT_EQ(bench.device.board().flags(), kHoming | kGreenLed);
  EXPECT_EQ(bench.protocol->remedy(), "");
}

TEST(FalconExchange, IsNeverReadyAndNeverPushesWhileNobodyHomesIt) {
  VirtualFalconSettings settings;
  settings.arm.homing = FalconHoming::kNever;
  FalconBench bench(settings);
  ASSERT_EQ(bench.bring_up(), "");
  for (int i = 0; i < 500; ++i) {
    ASSERT_EQ(bench.exchange({5, 5, 5}), usb::ExchangeStatus::kSample);
    ASSERT_EQ(bench.device.board().commands(), (std::array<std::int16_t, 3>{0, 0, 0}));
  }
  EXPECT_EQ(bench.protocol->readiness(), usb::Readiness::kNotHomed);
}

TEST(FalconExchange, TheHomingFlagCanBeClearedAfterwards) {
  FalconSettings settings;
  settings.keep_homing_flag = false;
  FalconBench bench({}, settings);
  ASSERT_EQ(bench.bring_up(), "");
  ASSERT_GT(bench.home(), 0.0);
  ASSERT_TRUE(bench.run(0.01));
  EXPECT_EQ(bench.device.board().flags(), kGreenLed);
}

// ---- Measurement and force

TEST(FalconExchange, ShowsWhereTheGripIsAndWhichButtonsAreDown) {
  VirtualFalconSettings settings = held({0.012, -0.021, 0.017});
  settings.arm.hand = {simulated::HoldMotion{{0.012, -0.021, 0.017}}, {5000.0, 30.0, 0.15, 40.0}, {{0.1, 2, true}}};
  FalconBench bench(settings);
  ASSERT_EQ(bench.bring_up(), "");
  ASSERT_TRUE(bench.run(1.5));
  const Vector3d truth = bench.device.arm().mechanics().position_m();
  for (std::size_t i = 0; i < 3; ++i) EXPECT_NEAR(bench.sample.position_m[i], truth[static_cast<int>(i)], 60e-6);
  EXPECT_EQ(bench.sample.buttons, 4U);
}

TEST(FalconExchange, ExchangesEveryMillisecondWithoutLoss) {
  FalconBench bench(held({0, 0, 0}));
  ASSERT_EQ(bench.bring_up(), "");
  const auto before = bench.protocol->counters();
  ASSERT_TRUE(bench.run(10.0));
  const auto& after = bench.protocol->counters();
  EXPECT_GE(after.exchanges - before.exchanges, 9900U);
  EXPECT_EQ(after.lost_frames, before.lost_frames);
  EXPECT_EQ(after.bad_frames, 0U);
  EXPECT_EQ(after.resyncs, 0U);
  EXPECT_EQ(after.line_errors, 0U);
}

TEST(FalconExchange, TheEventCharacterMakesAnswersImmediate) {
  FalconSettings settings;
  settings.event_character = true;
  FalconBench bench(held({0, 0, 0}), settings);
  ASSERT_EQ(bench.bring_up(), "");
  ASSERT_TRUE(bench.run(0.1));
  const auto sent_ns = bench.channel.now_ns();
  ASSERT_EQ(bench.exchange({}), usb::ExchangeStatus::kSample);
  EXPECT_LT(bench.channel.now_ns() - sent_ns, 500'000U);
}

TEST(FalconExchange, ForceAtTheHandIsWhatWasCommandedAcrossTheWorkspace) {
  double worst = 0.0;
  for (const double x : {-0.03, 0.0, 0.03}) {
    for (const double y : {-0.03, 0.0, 0.03}) {
      for (const double z : {-0.025, 0.0, 0.025}) {
        FalconBench bench(held({x, y, z}), without_weight());
        ASSERT_EQ(bench.bring_up(), "");
        for (const Vector3d& force_n : {Vector3d(2, 0, 0), Vector3d(0, -3, 0), Vector3d(0.5, 1, 2)}) {
          ASSERT_TRUE(bench.run(0.15, [&](const DeviceSample&) {
            return Vec3{force_n.x(), force_n.y(), force_n.z()};
          }));
          worst = std::max(worst, (applied_n(bench) - force_n).norm() / force_n.norm());
        }
        EXPECT_EQ(bench.protocol->counters().clamped, 0U);
      }
    }
  }
  EXPECT_LE(worst, 0.02);
}

TEST(FalconExchange, CalibrationMultipliesTheForce) {
  FalconSettings settings = without_weight();
  settings.command_gain *= 1.3;
  FalconBench bench(held({0, 0, 0}), settings);
  ASSERT_EQ(bench.bring_up(), "");
  ASSERT_TRUE(bench.run(0.2, [](const DeviceSample&) { return Vec3{0, 2, 0}; }));
  EXPECT_NEAR(applied_n(bench).y(), 2.6, 0.02);
}

TEST(FalconExchange, TooMuchForceKeepsItsDirectionAndIsCounted) {
  FalconBench bench(held({0, 0, 0}, 20000.0), without_weight());
  ASSERT_EQ(bench.bring_up(), "");
  ASSERT_TRUE(bench.run(0.05, [](const DeviceSample&) { return Vec3{20, 10, -5}; }));
  const Vector3d force_n = applied_n(bench);
  EXPECT_GT(force_n.normalized().dot(Vector3d(20, 10, -5).normalized()), 0.999);
  EXPECT_LT(force_n.norm(), 15.0);
  EXPECT_GT(bench.protocol->counters().clamped, 10U);
}

TEST(FalconExchange, AForceThatIsNotFiniteBecomesNone) {
  FalconBench bench(held({0, 0, 0}), without_weight());
  ASSERT_EQ(bench.bring_up(), "");
  ASSERT_TRUE(bench.run(0.05, [](const DeviceSample&) { return Vec3{0, 2, 0}; }));
  const auto before = bench.protocol->counters().clamped;
  for (const double bad : {std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity()}) {
    ASSERT_EQ(bench.exchange({bad, 2, 0}), usb::ExchangeStatus::kSample);
    EXPECT_EQ(bench.device.board().commands(), (std::array<std::int16_t, 3>{0, 0, 0}));
  }
  EXPECT_EQ(bench.protocol->counters().clamped, before + 2);
}

TEST(FalconExchange, TheGripsWeightIsCarriedAfterASecond) {
  VirtualFalconSettings settings;  // homed by hand; then nobody holds it
  settings.arm.mechanics.start_position_m = {0, 0.01, 0};
  FalconSettings compensated;
  compensated.grip_mass_kg = settings.arm.mechanics.mass_kg;
  FalconBench floating(settings, compensated);
  FalconBench sinking(settings, without_weight());
  for (FalconBench* bench : {&floating, &sinking}) {
    ASSERT_EQ(bench->bring_up(), "");
    ASSERT_GT(bench->home(), 0.0);
    ASSERT_TRUE(bench->run(3.0));
  }
  EXPECT_NEAR(sinking.sample.position_m[1], -0.040, 0.001);  // on the floor of its workspace
  EXPECT_GT(floating.sample.position_m[1], 0.0);
  EXPECT_NEAR(applied_n(floating).y(), 0.14 * 9.81, 0.03);
}

TEST(FalconExchange, TheDeviceGoesToZeroByItselfWhenTheHostFallsSilent) {
  FalconBench bench(held({0, 0, 0}), without_weight());
  ASSERT_EQ(bench.bring_up(), "");
  ASSERT_TRUE(bench.run(0.05, [](const DeviceSample&) { return Vec3{0, 3, 0}; }));
  EXPECT_GT(applied_n(bench).norm(), 2.9);
  ASSERT_EQ(bench.channel.sleep_until(bench.channel.now_ns() + 60'000'000), usb::UsbStatus::kOk);
  EXPECT_EQ(applied_n(bench).norm(), 0.0);
}

TEST(FalconExchange, ShutDownLeavesZeroForceAndAllLights) {
  FalconBench bench(held({0, 0, 0}));
  ASSERT_EQ(bench.bring_up(), "");
  ASSERT_TRUE(bench.run(0.05, [](const DeviceSample&) { return Vec3{0, 3, 0}; }));
  const auto from_ns = bench.channel.now_ns();
  bench.protocol->shut_down(bench.channel);
  EXPECT_LT(bench.channel.now_ns() - from_ns, 50'000'000U);
  EXPECT_EQ(bench.device.board().commands(), (std::array<std::int16_t, 3>{0, 0, 0}));
  EXPECT_EQ(bench.device.board().flags(), kHoming | kGreenLed | kBlueLed | kRedLed);
  EXPECT_EQ(applied_n(bench).norm(), 0.0);
}

TEST(FalconExchange, AWallInClosedLoopSettles) {
  VirtualFalconSettings settings;
  settings.arm.homing = FalconHoming::kDone;
  settings.arm.mechanics.start_position_m = {0, 0.015, 0};
  settings.arm.hand = {simulated::PushMotion{{0, 0.015, 0}, -Vector3d::UnitY(), 0.020, 0.05, 0.5, 0.1},
                       {700.0, 6.0, 0.15, 20.0}};
  FalconSettings driver;
  driver.grip_mass_kg = settings.arm.mechanics.mass_kg;
  FalconBench bench(settings, driver);
  ASSERT_EQ(bench.bring_up(), "");
  constexpr double kWall = 400.0;
  const auto wall = [](const DeviceSample& s) { return Vec3{0, std::max(0.0, -kWall * s.position_m[1]), 0}; };
  ASSERT_TRUE(bench.run(3.0, wall));
  double low = 1.0;
  double high = -1.0;
  for (int i = 0; i < 1000; ++i) {
    ASSERT_EQ(bench.exchange(wall(bench.sample)), usb::ExchangeStatus::kSample);
    low = std::min(low, bench.sample.position_m[1]);
    high = std::max(high, bench.sample.position_m[1]);
  }
  EXPECT_LT(high - low, 150e-6);  // at rest, to three counts
  // Hand and wall as springs in series: 5 mm of way between 700 and 400 N/m, dry friction 0.15 N aside.
  EXPECT_NEAR(high, -0.005 * 700.0 / 1100.0, 0.15 / 1100.0 + 60e-6);
}

// ---- Faults of the link: counted, survived, and no force that was not asked for

struct FaultCase {
  const char* name;
  std::function<void(Faults&)> set;
};

class FalconFaults : public ::testing::Test {
 protected:
  // Runs with the fault from the start of the exchange on; forces stay what they should be while samples come.
  void run(const std::function<void(Faults&)>& set, double duration_s = 5.0) {
    bench_ = std::make_unique<FalconBench>(held({0.01, 0.005, 0.0}), without_weight());
    ASSERT_EQ(bench_->bring_up(), "");
    ASSERT_TRUE(bench_->run(0.05));
    before_ = bench_->protocol->counters();
    set(bench_->device.board().faults());
    begin_ns_ = bench_->channel.now_ns();
    ASSERT_TRUE(bench_->run(duration_s, [](const DeviceSample&) { return Vec3{0, 1, 0}; }));
    bench_->device.board().faults() = {};
    after_ = bench_->protocol->counters();
    // It recovers at once: 100 exchanges without loss, and no sample is an exchange behind.
    ASSERT_TRUE(bench_->run(0.05));
    const auto recovered = bench_->protocol->counters();
    ASSERT_TRUE(bench_->run(0.1));
    EXPECT_EQ(bench_->protocol->counters().lost_frames, recovered.lost_frames);
    EXPECT_GE(bench_->protocol->counters().exchanges - recovered.exchanges, 95U);
    expect_fresh_samples();
  }

  // The button goes down on the arm; the next answer but one has to show it.
  void expect_fresh_samples() {
    ASSERT_EQ(bench_->exchange({}), usb::ExchangeStatus::kSample);
    const std::uint64_t frames = bench_->device.board().frames();
    const std::uint64_t answers = bench_->protocol->counters().exchanges;
    ASSERT_TRUE(bench_->run(0.02));
    EXPECT_EQ(bench_->device.board().frames() - frames, bench_->protocol->counters().exchanges - answers);
    EXPECT_TRUE(bench_->device.board().outgoing().empty());  // nothing is left that a later read would take for its own
  }

  std::unique_ptr<FalconBench> bench_;
  usb::LinkCounters before_;
  usb::LinkCounters after_;
  std::uint64_t begin_ns_ = 0;
};

TEST_F(FalconFaults, LostRepliesAreAllAccountedFor) {
  run([](Faults& f) { f.lose_reply = 0.05; });
  const auto lost = bench_->device.board().lost_replies();
  EXPECT_GT(lost, 50U);
  EXPECT_EQ(after_.lost_frames - before_.lost_frames, lost);
}

TEST_F(FalconFaults, LateRepliesDoNotMakeSamplesOld) {
  run([](Faults& f) {
    f.late_reply = 0.02;
    f.late_ms = 12.0;
  });
  EXPECT_GT(after_.lost_frames - before_.lost_frames, 10U);
}

TEST_F(FalconFaults, SplitRepliesArePutTogether) {
  run([](Faults& f) { f.split_reply = 0.2; });
  EXPECT_EQ(after_.lost_frames, before_.lost_frames);
  EXPECT_EQ(after_.resyncs, before_.resyncs);
}

TEST_F(FalconFaults, MergedRepliesGiveTheNewest) {
  run([](Faults& f) { f.merge_reply = 0.05; });
  EXPECT_GT(after_.lost_frames - before_.lost_frames, 10U);
  EXPECT_EQ(after_.bad_frames, before_.bad_frames);
}

TEST_F(FalconFaults, StalledTransfersAreCountedAndTheLinkGoesOn) {
  virtual_usb::VirtualFalconSettings settings = held({0, 0, 0});
  settings.board.faults.stall_in = 0.02;
  FalconBench stalling(settings);
  ASSERT_EQ(stalling.bring_up(), "");
  ASSERT_TRUE(stalling.run(2.0));
  EXPECT_GT(stalling.protocol->counters().line_errors, 10U);
  EXPECT_GT(stalling.protocol->counters().exchanges, 1000U);
}

TEST_F(FalconFaults, AFloodOfStatusPacketsIsNotTakenForData) {
  VirtualFalconSettings settings = held({0, 0, 0});
  settings.board.faults.status_flood = true;
  FalconBench bench(settings);
  ASSERT_EQ(bench.bring_up(), "");
  ASSERT_TRUE(bench.run(0.5));
  EXPECT_GT(bench.protocol->counters().exchanges, 450U);
  EXPECT_EQ(bench.protocol->counters().bad_frames, 0U);
}

TEST_F(FalconFaults, OverrunsAreCountedAsLineErrors) {
  VirtualFalconSettings settings = held({0, 0, 0});
  settings.board.faults.overrun = true;
  FalconBench bench(settings);
  ASSERT_EQ(bench.bring_up(), "");
  ASSERT_TRUE(bench.run(0.5));
  EXPECT_GT(bench.protocol->counters().line_errors, 400U);
}

TEST_F(FalconFaults, APauseOfTwentyMillisecondsIsSurvived) {
  run([](Faults& f) {
    f.pause_at_s = 2.0;
    f.pause_ms = 20.0;
  });
  const auto lost = after_.lost_frames - before_.lost_frames;
  EXPECT_GE(lost, 2U);
  EXPECT_EQ(lost, bench_->device.board().lost_replies());
}

TEST_F(FalconFaults, ADeviceThatFallsSilentGivesNothingUntilItSpeaksAgain) {
  FalconBench bench(held({0, 0, 0}), without_weight());
  ASSERT_EQ(bench.bring_up(), "");
  ASSERT_TRUE(bench.run(0.1, [](const DeviceSample&) { return Vec3{0, 2, 0}; }));
  bench.device.board().faults().mute = true;
  for (int i = 0; i < 20; ++i) EXPECT_EQ(bench.exchange({0, 2, 0}), usb::ExchangeStatus::kNothing);
  EXPECT_EQ(bench.protocol->counters().lost_frames, 20U);
  EXPECT_EQ(applied_n(bench).norm(), 0.0);  // 50 ms after the last command it heard
  bench.device.board().faults().mute = false;
  EXPECT_EQ(bench.exchange({}), usb::ExchangeStatus::kSample);
}

TEST_F(FalconFaults, UnpluggingIsReportedAtOnceAndTheArmGoesLimp) {
  FalconBench bench(held({0, 0, 0}), without_weight());
  ASSERT_EQ(bench.bring_up(), "");
  ASSERT_TRUE(bench.run(0.1, [](const DeviceSample&) { return Vec3{0, 2, 0}; }));
  bench.channel.unplug_at(bench.channel.now_ns() + 300'000);
  const auto from_ns = bench.channel.now_ns();
  EXPECT_EQ(bench.exchange({0, 2, 0}), usb::ExchangeStatus::kLost);
  EXPECT_LT(bench.channel.now_ns() - from_ns, 1'000'000U);
  bench.device.arm().advance_to(bench.channel.now_ns() + 51'000'000);
  EXPECT_EQ(bench.device.arm().mechanics().applied_force_n().norm(), 0.0);
}

// A line that changes the bytes of an answer.
class WrongLine final : public usb::Channel {
 public:
  explicit WrongLine(virtual_usb::VirtualChannel& channel) : channel_(channel) {}
  std::uint64_t now_ns() const noexcept override { return channel_.now_ns(); }
  usb::UsbStatus sleep_until(std::uint64_t t) noexcept override { return channel_.sleep_until(t); }
  usb::UsbStatus control_out(const usb::Setup& s, std::span<const std::uint8_t> d, std::uint64_t t) noexcept override {
    return channel_.control_out(s, d, t);
  }
  usb::UsbStatus control_in(const usb::Setup& s, std::span<std::uint8_t> d, std::size_t& got,
                            std::uint64_t t) noexcept override {
    return channel_.control_in(s, d, got, t);
  }
  usb::UsbStatus write(std::span<const std::uint8_t> bytes, std::uint64_t t) noexcept override {
    return channel_.write(bytes, t);
  }
  usb::UsbStatus read(std::span<std::uint8_t> out, std::size_t& got, std::uint64_t t) noexcept override {
    const auto status = channel_.read(out, got, t);
    // Two status bytes and a frame.
    if (change && status == usb::UsbStatus::kOk && got == 2 + kFrameBytes) change(out.subspan(2, kFrameBytes));
    return status;
  }
  std::size_t read_size() const noexcept override { return channel_.read_size(); }
  std::function<void(std::span<std::uint8_t>)> change;

 private:
  virtual_usb::VirtualChannel& channel_;
};

// One exchange through the wrong line.
usb::ExchangeStatus exchange_over(WrongLine& line, FalconBench& bench, const Vec3& force_n) {
  const auto until_ns = line.now_ns() + 8'000'000;
  EXPECT_EQ(bench.protocol->send(line, force_n, 0.001, until_ns), usb::UsbStatus::kOk);
  return bench.protocol->receive(line, bench.sample, until_ns);
}

// As a Falcon that has lost its homing answers: no axis homed, all counts 0.
void forget_homing(std::span<std::uint8_t> frame) {
  for (std::size_t i = 1; i < 13; ++i) frame[i] = 'A';
  frame[13] = 'A';
}

TEST_F(FalconFaults, OneAnswerWithoutTheHomedBitsIsNotBelieved) {
  FalconBench bench(held({0.01, 0.005, 0.0}), without_weight());
  ASSERT_EQ(bench.bring_up(), "");
  ASSERT_TRUE(bench.run(0.1, [](const DeviceSample&) { return Vec3{0, 1, 0}; }));
  WrongLine line(bench.channel);
  for (int i = 0; i < 20; ++i) {
    const DeviceSample before = bench.sample;
    line.change = &forget_homing;
    EXPECT_EQ(exchange_over(line, bench, {0, 1, 0}), usb::ExchangeStatus::kNothing);
    EXPECT_EQ(bench.sample.position_m, before.position_m) << "no pose of a frame that is not believed";
    EXPECT_EQ(bench.protocol->readiness(), usb::Readiness::kReady);
    line.change = {};
    EXPECT_EQ(exchange_over(line, bench, {0, 1, 0}), usb::ExchangeStatus::kSample);
    EXPECT_NEAR(bench.sample.position_m[0], before.position_m[0], 1e-4);
    EXPECT_NE(bench.device.board().commands(), (std::array<std::int16_t, 3>{0, 0, 0}));
  }
  EXPECT_EQ(bench.protocol->counters().bad_frames, 20U);
}

TEST_F(FalconFaults, TwoAnswersWithoutTheHomedBitsCutTheForce) {
  FalconBench bench(held({0.01, 0.005, 0.0}), without_weight());
  ASSERT_EQ(bench.bring_up(), "");
  ASSERT_TRUE(bench.run(0.1, [](const DeviceSample&) { return Vec3{0, 1, 0}; }));
  WrongLine line(bench.channel);
  line.change = &forget_homing;
  EXPECT_EQ(exchange_over(line, bench, {0, 1, 0}), usb::ExchangeStatus::kNothing);
  EXPECT_EQ(exchange_over(line, bench, {0, 1, 0}), usb::ExchangeStatus::kSample);
  EXPECT_EQ(bench.protocol->readiness(), usb::Readiness::kNotHomed);
  (void)exchange_over(line, bench, {0, 1, 0});
  EXPECT_EQ(bench.device.board().commands(), (std::array<std::int16_t, 3>{0, 0, 0}));
  EXPECT_TRUE(bench.protocol->withheld());
  // One axis is enough.
  FalconBench axis(held({0.01, 0.005, 0.0}), without_weight());
  ASSERT_EQ(axis.bring_up(), "");
  ASSERT_TRUE(axis.run(0.1));
  WrongLine worse(axis.channel);
  worse.change = [](std::span<std::uint8_t> frame) {
    frame[13] = static_cast<std::uint8_t>('A' + ((frame[13] - 'A') & ~0x10));
  };
  for (int i = 0; i < 2; ++i) (void)exchange_over(worse, axis, {});
  EXPECT_EQ(axis.protocol->readiness(), usb::Readiness::kNotHomed);
}

TEST_F(FalconFaults, AForceThatIsLoweredIsNotWithheld) {
  FalconBench bench(held({0, 0, 0}), without_weight());
  ASSERT_EQ(bench.bring_up(), "");
  ASSERT_TRUE(bench.run(0.05));
  ASSERT_EQ(bench.exchange({0, 1, 0}), usb::ExchangeStatus::kSample);
  EXPECT_FALSE(bench.protocol->withheld());
  ASSERT_EQ(bench.exchange({0, 100, 0}), usb::ExchangeStatus::kSample);
  EXPECT_FALSE(bench.protocol->withheld()) << "lowered is not withheld";
  ASSERT_EQ(bench.exchange({}), usb::ExchangeStatus::kSample);
  EXPECT_FALSE(bench.protocol->withheld());
}

TEST_F(FalconFaults, AnEncoderValueThatNoGripCanHaveIsABadFrame) {
  FalconBench bench(held({0, 0, 0}));
  ASSERT_EQ(bench.bring_up(), "");
  ASSERT_TRUE(bench.run(0.05));
  WrongLine channel(bench.channel);
  channel.change = [](std::span<std::uint8_t> frame) { frame[4] = 'H'; };  // encoder 1 above 28671
  const DeviceSample before = bench.sample;
  const auto until_ns = channel.now_ns() + 8'000'000;
  ASSERT_EQ(bench.protocol->send(channel, {0, 1, 0}, 0.001, until_ns), usb::UsbStatus::kOk);
  EXPECT_EQ(bench.protocol->receive(channel, bench.sample, until_ns), usb::ExchangeStatus::kNothing);
  EXPECT_EQ(bench.sample.position_m, before.position_m);
  EXPECT_EQ(bench.protocol->counters().bad_frames, 1U);
}

// A frame has no checksum: next to damage that is seen, a wrong position looks like a right one.
TEST_F(FalconFaults, OnALineThatDamagesFramesNoneIsBelievedUntilItIsClean) {
  FalconBench bench(held({0.01, 0.005, 0.0}), without_weight());
  ASSERT_EQ(bench.bring_up(), "");
  ASSERT_TRUE(bench.run(0.1, [](const DeviceSample&) { return Vec3{0, 1, 0}; }));
  WrongLine line(bench.channel);
  const auto damaged = [&] {
    line.change = [](std::span<std::uint8_t> frame) { frame[4] = 'z'; };
    EXPECT_EQ(exchange_over(line, bench, {0, 1, 0}), usb::ExchangeStatus::kNothing);
    line.change = {};
  };
  damaged();
  EXPECT_EQ(exchange_over(line, bench, {0, 1, 0}), usb::ExchangeStatus::kSample) << "one alone costs one answer";
  const std::uint64_t seen_ns = line.now_ns();  // but for the way there and back
  damaged();
  std::uint64_t believed_ns = 0;
  for (int i = 0; i < 300 && believed_ns == 0; ++i) {
    if (exchange_over(line, bench, {0, 1, 0}) == usb::ExchangeStatus::kSample) believed_ns = line.now_ns();
  }
  EXPECT_GE(believed_ns, seen_ns + 100'000'000);
  EXPECT_LE(believed_ns, seen_ns + 110'000'000);
  // Two that are far from each other cost an answer each.
  for (int i = 0; i < 2; ++i) {
    ASSERT_TRUE(bench.run(0.15, [](const DeviceSample&) { return Vec3{0, 1, 0}; }));
    damaged();
    EXPECT_EQ(exchange_over(line, bench, {0, 1, 0}), usb::ExchangeStatus::kSample);
  }
}

}  // namespace
}  // namespace drivers::falcon
