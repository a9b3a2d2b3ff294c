// The I/O thread over the real libusb: force rules, hand-over, loss and return. Nothing here asserts how long
// something takes; what must happen is waited for.
#include "drivers/usb_host/usb_line.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstring>
#include <limits>
#include <string>
#include <utility>

#include "rtbus/clock.hpp"
#include "tests/support/bare_loops.hpp"
#include "tests/support/process.hpp"
#include "tests/unit/usb_link/support.hpp"

namespace drivers::usb {
namespace {

using testing::HasSubstr;
using tests::EchoPort;
using tests::EchoProtocol;
using tests::eventually;
IoSettings settings() {
  IoSettings out;
  out.info.model = "echo";
  out.info.max_force_n = 5.0;
  out.info.force_timeout_s = 0.020;
  out.info.can_pace_loop = true;
  out.info.sample_rate_hz = 1000.0;
  // A busy machine may keep every thread waiting for longer than a device would.
  out.reply_timeout_s = 0.1;
  out.lost_after_s = 1.0;
  return out;
}

class IoDeviceTest : public testing::Test {
 protected:
  void make(EchoProtocol::Settings protocol = {}, const IoSettings& io = settings()) {
    protocol.shut_downs = &shut_downs_;
    device_ = make_io_device(
        io, IoThread{}, [protocol] { return std::make_unique<EchoProtocol>(protocol); },
        [this](StopFlag& stop) { return port_.open(stop); });
  }
  void start() {
    const auto started = device_->start(0);
    ASSERT_TRUE(started) << started.error().message;
  }
  Vec3 force() {
    Vec3 out{};
    port_.locked([&] { out = tests::force_at(port_.device); });
    return out;
  }
  /// One cycle of a loop that the device paces.
  IoStatus cycle(const Vec3& force_n) {
    const IoStatus waited = device_->wait_sample(rtbus::monotonic_ns() + 2000 * rtbus::kNsPerMs);
    const IoStatus got = device_->read(rtbus::monotonic_ns(), sample_);
    const IoStatus wrote = device_->write(rtbus::monotonic_ns(), {force_n});
    return waited != IoStatus::kOk   ? waited
           : got == IoStatus::kStale ? IoStatus::kOk
           : got != IoStatus::kOk    ? got
                                     : wrote;
  }
  bool running() {
    return eventually(10.0, [&] { return device_->figures().state == LinkState::kRunning; });
  }

  EchoPort port_;
  // What the device's thread touches until it has ended: members, since the device outlives the body of a test.
  std::atomic<int> shut_downs_{0}, bring_up_{-1}, exchange_{-1};
  std::atomic<bool> homed_{false}, fault_{false}, withhold_{false};
  std::unique_ptr<IoDevice> device_;
  DeviceSample sample_;
};

TEST_F(IoDeviceTest, TheForceOfASampleLeavesInTheSameExchange) {
  make();
  start();
  int answered = 0, next = 0;
  double last = 0.0;
  for (int i = 1; i <= 500; ++i) {
    const double wish = 0.001 * i;
    if (cycle({wish, 0.0, 0.0}) != IoStatus::kOk) continue;
    // The echo brings back the force that went out with the exchange: the one of the cycle before.
    ++answered;
    next += std::abs(sample_.position_m[0] * 1e3 - last) < 1e-6;
    last = wish;
  }
  const LinkFigures figures = device_->figures();
  std::printf("%d cycles, %d with the force of the cycle before, %llu late, sample to wire p50 %.0f us p99 %.0f us\n",
              answered, next, static_cast<unsigned long long>(figures.late_forces),
              1e-3 * static_cast<double>(device_->sample_to_wire().percentile(0.5)),
              1e-3 * static_cast<double>(device_->sample_to_wire().percentile(0.99)));
  EXPECT_GT(answered, 400);
  // Each exception is a force that came too late, and counted.
  EXPECT_GE(next + 2 * static_cast<int>(figures.late_forces) + static_cast<int>(figures.timed_out) + 2, answered);
  EXPECT_GT(device_->sample_to_wire().count(), 0u);
  // An answer that a starved thread took too late counts as no answer, and as a bad frame when it comes.
  EXPECT_LE(figures.protocol.bad_frames, figures.silences);
}

TEST_F(IoDeviceTest, WithoutALoopToPaceItKeepsItsRateAndSendsTheNewestForce) {
  make();
  start();
  EXPECT_TRUE(eventually(5.0, [&] {
    (void)device_->write(rtbus::monotonic_ns(), {{1.5, 0, 0}});
    return force()[0] == 1.5;
  }));
  EXPECT_TRUE(eventually(5.0, [&] { return device_->sample_period().count() > 200; }));
  EXPECT_GT(device_->sample_period().percentile(0.5), 700'000u) << "paced, not as fast as the device answers";
}

TEST_F(IoDeviceTest, ZeroWhenTheLoopStopsWriting) {
  make();
  start();
  ASSERT_TRUE(eventually(5.0, [&] {
    (void)device_->write(rtbus::monotonic_ns(), {{2.0, 0, 0}});
    return force()[0] == 2.0;
  }));
  EXPECT_TRUE(eventually(5.0, [&] { return force()[0] == 0.0; }));
  EXPECT_GT(device_->figures().timed_out, 0u);
}

// A device that falls silent with a force on: the zero is there 20 ms after its last answer, not three time-outs of an
// answer later.
TEST_F(IoDeviceTest, ADeviceThatFallsSilentGetsItsZeroWithinTwentyMilliseconds) {
  IoSettings io = settings();
  io.reply_timeout_s = 0.008;
  make({}, io);
  start();
  // Two time-outs of 8 ms leave 4 ms, for two threads.
  constexpr double kLate_ms = 2.0;
  double zero_ms = 0.0;
  std::string machine;
  const auto judged = tests::judge_when_quiet(tests::BareScheduling::kOrdinary, kLate_ms, 20, machine, [&] {
    zero_ms = 1e9;
    EXPECT_TRUE(eventually(10.0, [&] { return cycle({1, 0, 0}) == IoStatus::kOk && force()[0] == 1.0; }));
    std::size_t from = 0;
    std::uint64_t last_answer_ns = 0;
    port_.locked([&] {
      port_.device.mute = true;
      from = port_.device.history.size();
    });
    // The loop goes on asking for the force, as it would: the link works, only the device says nothing.
    for (int i = 0; i < 30; ++i) {
      (void)device_->write(rtbus::monotonic_ns(), {{1, 0, 0}});
      rtbus::sleep_until(rtbus::monotonic_ns() + rtbus::kNsPerMs);
    }
    port_.locked([&] {
      last_answer_ns = port_.device.last_answer_ns;
      for (std::size_t i = from; i < port_.device.history.size(); ++i) {
        const auto& command = port_.device.history[i];
        if (command.time_ns <= last_answer_ns || tests::force_of(command.bytes)[0] != 0.0) continue;
        zero_ms = 1e-6 * static_cast<double>(command.time_ns - last_answer_ns);
        break;
      }
      port_.device.mute = false;
    });
    return zero_ms <= 20.0 || HasFailure();
  });
  if (judged == tests::Judged::kPaused) GTEST_SKIP() << "zero after " << zero_ms << " ms; " << machine;
  EXPECT_LE(zero_ms, 20.0);
  EXPECT_GT(zero_ms, 8.0) << "one lost answer alone is no reason";
}

// What the driver makes zero by itself must not come back without a ramp: the loop learns that its force did not leave.
TEST_F(IoDeviceTest, AWithheldForceFailsTheNextWriteAndComesBackOnlyAfterIt) {
  make({.withhold = &withhold_});
  start();
  ASSERT_TRUE(eventually(5.0, [&] { return cycle({2, 0, 0}) == IoStatus::kOk && force()[0] == 2.0; }));
  EXPECT_EQ(device_->figures().withheld, 0u);
  withhold_.store(true);
  ASSERT_TRUE(eventually(5.0, [&] { return device_->figures().withheld == 1; }));
  withhold_.store(false);
  // Not told yet: the old force stays away, however often it is repeated.
  EXPECT_TRUE(eventually(5.0, [&] { return force()[0] == 0.0; }));
  int seen = 0;
  port_.locked([&] { seen = port_.device.commands; });
  EXPECT_TRUE(eventually(5.0, [&] {
    int now = 0;
    port_.locked([&] { now = port_.device.commands; });
    return now > seen + 5;
  }));
  EXPECT_EQ(force()[0], 0.0);
  EXPECT_EQ(device_->write(rtbus::monotonic_ns(), {{2, 0, 0}}), IoStatus::kLost);
  EXPECT_EQ(device_->write(rtbus::monotonic_ns(), {}), IoStatus::kOk);
  EXPECT_EQ(force()[0], 0.0);
  EXPECT_EQ(device_->figures().withheld, 1u) << "one zero, counted once";
  EXPECT_TRUE(eventually(5.0, [&] { return cycle({0.5, 0, 0}) == IoStatus::kOk && force()[0] == 0.5; }));
}

TEST_F(IoDeviceTest, IsRealtimeOnlyWhileTheDeviceRuns) {
  make({.homed = &homed_, .bring_up_policy = &bring_up_, .exchange_policy = &exchange_});
  start();
  EXPECT_EQ(bring_up_.load() & ~SCHED_RESET_ON_FORK, SCHED_OTHER);
  EXPECT_EQ(exchange_.load() & ~SCHED_RESET_ON_FORK, SCHED_OTHER) << "not homed: nothing is urgent";
  homed_.store(true);
  ASSERT_TRUE(running());
  int may = SCHED_OTHER;
  std::thread([&] { may = rtbus::prefer_on_time() ? SCHED_FIFO : SCHED_OTHER; }).join();
  EXPECT_TRUE(eventually(5.0, [&] { return (exchange_.load() & ~SCHED_RESET_ON_FORK) == may; }));
  // Lost and brought up anew: ordinary again.
  bring_up_.store(-1);
  port_.port->unplug();
  ASSERT_TRUE(eventually(5.0, [&] { return device_->figures().state == LinkState::kLost; }));
  port_.port->replug();
  ASSERT_TRUE(running());
  EXPECT_EQ(bring_up_.load() & ~SCHED_RESET_ON_FORK, SCHED_OTHER);
}

TEST_F(IoDeviceTest, TellsItsLinkForTheBus) {
  make();
  start();
  for (int i = 0; i < 5000 && device_->sample_to_wire().count() <= 10; ++i) (void)cycle({1, 0, 0});
  ASSERT_TRUE(eventually(5.0, [&] { return device_->figures().protocol.exchanges > 50; }));
  const auto link = device_->link_stats();
  ASSERT_TRUE(link.has_value());
  EXPECT_GT(link->exchanges, 50u);
  EXPECT_EQ(link->state, static_cast<std::uint32_t>(LinkState::kRunning));
  EXPECT_GT(link->period_p50_us, 100.0);
  EXPECT_GT(link->sample_to_wire_p99_us, 0.0);
}

TEST_F(IoDeviceTest, ClampsAndCounts) {
  make();
  start();
  ASSERT_TRUE(eventually(5.0, [&] {
    (void)device_->write(rtbus::monotonic_ns(), {{30.0, 40.0, 0}});
    return std::abs(force()[0] - 3.0) < 1e-6 && std::abs(force()[1] - 4.0) < 1e-6;
  }));
  const std::uint64_t clamped = device_->clamped();
  EXPECT_GT(clamped, 0u);
  (void)device_->write(rtbus::monotonic_ns(), {{std::numeric_limits<double>::quiet_NaN(), 1.0, 0}});
  EXPECT_EQ(device_->clamped(), clamped + 1);
}

TEST_F(IoDeviceTest, NotHomedMeansNoPoseNoForceAndSaysWhatToDo) {
  make({.homed = &homed_});
  start();
  EXPECT_THAT(device_->take_notice(), HasSubstr("move the handle to its rest"));
  EXPECT_EQ(device_->read(rtbus::monotonic_ns(), sample_), IoStatus::kLost);
  EXPECT_EQ(device_->write(rtbus::monotonic_ns(), {{1, 0, 0}}), IoStatus::kLost);
  EXPECT_EQ(device_->wait_sample(rtbus::monotonic_ns() + 10 * rtbus::kNsPerMs), IoStatus::kLost);
  homed_.store(true);
  EXPECT_TRUE(running());
  EXPECT_THAT(device_->take_notice(), HasSubstr("ready"));
  EXPECT_TRUE(eventually(5.0, [&] { return cycle({1, 0, 0}) == IoStatus::kOk; }));
}

TEST_F(IoDeviceTest, UnplugAndReplugInMidRun) {
  make();
  start();
  ASSERT_TRUE(eventually(5.0, [&] { return cycle({1, 0, 0}) == IoStatus::kOk && force()[0] == 1.0; }));
  port_.port->unplug();
  EXPECT_TRUE(eventually(5.0, [&] { return device_->read(rtbus::monotonic_ns(), sample_) == IoStatus::kLost; }));
  EXPECT_EQ(device_->write(rtbus::monotonic_ns(), {{1, 0, 0}}), IoStatus::kLost);
  EXPECT_EQ(device_->wait_sample(rtbus::monotonic_ns() + 1000 * rtbus::kNsPerMs), IoStatus::kLost);
  EXPECT_TRUE(eventually(5.0, [&] { return device_->figures().losses == 1; }));
  EXPECT_THAT(device_->take_notice(), HasSubstr("unplugged"));
  EXPECT_EQ(device_->take_notice(), "");
  port_.port->replug();
  ASSERT_TRUE(running());
  EXPECT_THAT(device_->take_notice(), HasSubstr("back"));
  EXPECT_TRUE(eventually(5.0, [&] { return cycle({1, 0, 0}) == IoStatus::kOk; }));
  EXPECT_EQ(device_->figures().losses, 1u);
}

TEST_F(IoDeviceTest, APendingWaitEndsWhenTheDeviceGoes) {
  make();
  start();
  port_.locked([&] { port_.device.mute = true; });
  std::thread hand([&] {
    rtbus::sleep_until(rtbus::monotonic_ns() + 50 * rtbus::kNsPerMs);
    port_.port->unplug();
  });
  IoStatus status = IoStatus::kOk;
  ASSERT_TRUE(eventually(10.0, [&] {
    (void)device_->read(rtbus::monotonic_ns(), sample_);
    status = device_->wait_sample(rtbus::monotonic_ns() + 5000 * rtbus::kNsPerMs);
    return status != IoStatus::kOk;
  }));
  EXPECT_EQ(status, IoStatus::kLost);
  hand.join();
}

TEST_F(IoDeviceTest, LostAnswersAreCountedAndTheLinkGoesOn) {
  IoSettings io = settings();
  io.reply_timeout_s = 0.005;
  make({}, io);
  start();
  port_.locked([&] { port_.device.lose_next = 3; });
  EXPECT_TRUE(eventually(5.0, [&] { return device_->figures().silences >= 3; }));
  const std::uint64_t before = device_->figures().protocol.exchanges;
  EXPECT_TRUE(eventually(5.0, [&] { return device_->figures().protocol.exchanges > before + 20; }));
}

TEST_F(IoDeviceTest, ADeviceThatFallsSilentIsLostAndFoundAgain) {
  IoSettings io = settings();
  io.reply_timeout_s = 0.005;
  io.lost_after_s = 0.1;
  make({}, io);
  start();
  port_.locked([&] { port_.device.mute = true; });
  EXPECT_TRUE(eventually(5.0, [&] { return device_->figures().state == LinkState::kLost; }));
  EXPECT_THAT(device_->take_notice(), HasSubstr("does not answer any more"));
  port_.locked([&] { port_.device.mute = false; });
  EXPECT_TRUE(running());
}

TEST_F(IoDeviceTest, AStallCostsAnAnswerAndNothingElse) {
  IoSettings io = settings();
  io.reply_timeout_s = 0.02;
  make({}, io);
  start();
  for (int i = 0; i < 5; ++i) {
    port_.locked([&] { port_.device.stall_next_in = true; });
    const std::uint64_t before = device_->figures().protocol.exchanges;
    ASSERT_TRUE(eventually(5.0, [&] { return device_->figures().protocol.exchanges > before + 10; }));
  }
  EXPECT_EQ(device_->figures().losses, 0u);
}

TEST_F(IoDeviceTest, AFaultIsToldAndTheDeviceBroughtUpAnew) {
  make({.fault = &fault_});
  start();
  fault_.store(true);
  EXPECT_TRUE(eventually(5.0, [&] { return device_->figures().state == LinkState::kLost; }));
  EXPECT_THAT(device_->take_notice(), HasSubstr("the device reports overheating"));
  EXPECT_GE(shut_downs_.load(), 1) << "the link works: zero force is sent";
  fault_.store(false);
  EXPECT_TRUE(running());
}

TEST_F(IoDeviceTest, StartSaysWhyItFailsAndLeavesNothingRunning) {
  make({.fail_with = "no wall power: plug in the supply"});
  auto started = device_->start(0);
  ASSERT_FALSE(started);
  EXPECT_EQ(started.error().message, "no wall power: plug in the supply");
  EXPECT_EQ(device_->figures().state, LinkState::kStopped);
  port_.port->unplug();
  started = device_->start(0);
  ASSERT_FALSE(started);
  EXPECT_THAT(started.error().message, HasSubstr("unplugged"));
  device_->stop();
}

TEST_F(IoDeviceTest, ADeviceThatNeverAnswersFailsTheStart) {
  IoSettings io = settings();
  io.reply_timeout_s = 0.005;
  io.lost_after_s = 0.05;
  port_.locked([&] { port_.device.mute = true; });
  make({}, io);
  const auto started = device_->start(0);
  ASSERT_FALSE(started);
  EXPECT_THAT(started.error().message, HasSubstr("does not answer"));
}

TEST_F(IoDeviceTest, StopEndsABringUpThatWaits) {
  make({.wait_in_bring_up = true});
  std::thread other([&] {
    rtbus::sleep_until(rtbus::monotonic_ns() + 50 * rtbus::kNsPerMs);
    device_->cancel_start();
  });
  const auto started = device_->start(0);
  other.join();
  EXPECT_FALSE(started);
}

TEST_F(IoDeviceTest, StopLeavesZeroForceAndMayBeFollowedByStart) {
  make();
  start();
  ASSERT_TRUE(eventually(5.0, [&] { return cycle({2, 0, 0}) == IoStatus::kOk && force()[0] == 2.0; }));
  device_->stop();
  device_->stop();
  EXPECT_EQ(force()[0], 0.0);
  EXPECT_EQ(shut_downs_.load(), 1);
  EXPECT_THAT(device_->take_notice(), HasSubstr("sample to wire p50"));
  EXPECT_EQ(device_->read(rtbus::monotonic_ns(), sample_), IoStatus::kLost);
  start();
  EXPECT_TRUE(eventually(5.0, [&] { return cycle({1, 0, 0}) == IoStatus::kOk; }));
}

TEST_F(IoDeviceTest, FetchFirstAnswersAFreshMeasurement) {
  IoSettings io = settings();
  io.order = ExchangeOrder::kFetchFirst;
  make({}, io);
  start();
  int good = 0;
  for (int i = 0; i < 200; ++i) good += cycle({0.5, 0, 0}) == IoStatus::kOk;
  EXPECT_GT(good, 100);
  std::printf("sample to wire p50 %.0f us p99 %.0f us\n",
              1e-3 * static_cast<double>(device_->sample_to_wire().percentile(0.5)),
              1e-3 * static_cast<double>(device_->sample_to_wire().percentile(0.99)));
  EXPECT_GT(device_->sample_to_wire().count(), 100u);
  // Two exchanges per period.
  EXPECT_GT(device_->figures().protocol.exchanges, device_->sample_period().count() * 3 / 2);
}

/// A device that always answers. In its first exchange the thread itself stands still until nobody waits any more.
struct StandsStillOnce final : io::Line {
  explicit StandsStillOnce(double s) : for_s(s) {}
  rtbus::Result<void, DeviceFault> connect(StopFlag&) override {
    ++connections;
    return {};
  }
  io::SendStatus send(const Vec3&, double, bool, std::uint64_t) noexcept override { return io::SendStatus::kSent; }
  io::ExchangeStatus receive(DeviceSample& out, std::uint64_t) noexcept override {
    if (const double s = std::exchange(for_s, 0.0); s > 0.0) {
      rtbus::sleep_until(rtbus::monotonic_ns() + rtbus::ns_of(s));
      return io::ExchangeStatus::kNothing;
    }
    out.time_ns = rtbus::monotonic_ns();
    return io::ExchangeStatus::kSample;
  }
  void disconnect(bool) noexcept override {}
  [[nodiscard]] io::Readiness readiness() const noexcept override { return io::Readiness::kReady; }
  [[nodiscard]] const io::LinkCounters& counters() const noexcept override { return none; }

  double for_s;
  int connections = 0;
  io::LinkCounters none;
};

TEST(IoDevices, AMachineThatStandsStillIsNoDeviceThatIsSilent) {
  IoSettings io = settings();
  io.lost_after_s = 0.05;
  StandsStillOnce* line = nullptr;
  io::IoDevice device(io, IoThread{}, [&] {
    auto out = std::make_unique<StandsStillOnce>(2.0 * io.lost_after_s);
    line = out.get();
    return out;
  });
  const auto started = device.start(0);
  ASSERT_TRUE(started) << started.error().message;
  EXPECT_EQ(device.figures().silences, 1u);
  device.stop();
  EXPECT_EQ(line->connections, 1);
}

TEST(IoDevices, TwoRunSideBySide) {
  EchoPort ports[2];
  std::unique_ptr<IoDevice> devices[2];
  for (int i = 0; i < 2; ++i) {
    devices[i] = make_io_device(
        settings(), IoThread{}, [] { return std::make_unique<EchoProtocol>(EchoProtocol::Settings{}); },
        [&ports, i](StopFlag& stop) { return ports[i].open(stop); });
    const auto started = devices[i]->start(0);
    ASSERT_TRUE(started) << started.error().message;
  }
  for (int i = 0; i < 2; ++i) {
    EXPECT_TRUE(eventually(5.0, [&] {
      (void)devices[i]->write(rtbus::monotonic_ns(), {{1.0 + i, 0, 0}});
      Vec3 got{};
      ports[i].locked([&] { got = tests::force_at(ports[i].device); });
      return got[0] == 1.0 + i;
    }));
  }
}

}  // namespace
}  // namespace drivers::usb
