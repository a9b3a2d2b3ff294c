// The simulated device in a process of its own, end to end: what the hand feels when either side goes away.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <memory>
#include <string>
#include <vector>

#include "rtbus/clock.hpp"
#include "rtbus/messages.hpp"
#include "rtbus/topic.hpp"
#include "tests/conformance/devices/plant_process.hpp"

namespace drivers::testing {
namespace {

using Arguments = std::vector<std::string>;

using rtbus::kNsPerMs;
using rtbus::kNsPerS;

constexpr const char* kDevice =
    "{schema: device/1, driver: simulated, process: own, hand: {type: hold, position_m: [0, 0, 0]}}";
constexpr std::uint64_t kForceTimeoutNs = 20 * kNsPerMs;

// Calls `attempt` once a millisecond until it is true. The bound only keeps a broken build from hanging.
template <class F>
bool eventually(F attempt) {
  const std::uint64_t give_up_ns = rtbus::monotonic_ns() + 10 * kNsPerS;
  while (!attempt()) {
    if (rtbus::monotonic_ns() > give_up_ns) return false;
    rtbus::sleep_until(rtbus::monotonic_ns() + kNsPerMs);
  }
  return true;
}

// 50 cycles of 1 N to the right; the stamp of the last. On a busy machine the plant lets go in between.
std::uint64_t write_some(Device& device) {
  std::uint64_t now_ns = rtbus::monotonic_ns();
  for (int i = 0; i < 50; ++i) {
    rtbus::sleep_until(now_ns + kNsPerMs);
    now_ns = rtbus::monotonic_ns();
    (void)device.write(now_ns, {{1.0, 0.0, 0.0}});
  }
  return now_ns;
}

TEST(SimulatedPlant, GoesToZeroForceWhenCommandsStop) {
  const SessionFile session(kDevice);
  const PlantProcess plant(session);
  const auto device = session.open_device();
  ASSERT_TRUE(device->start(rtbus::monotonic_ns()));
  auto states = rtbus::Reader<rtbus::PlantState>::open({.name = session.name(), .group = {}}, "haptic0.plant_state",
                                                       {.from_oldest = true});
  ASSERT_TRUE(states);
  const std::uint64_t last_command_ns = write_some(*device);

  // Judged by the plant's own stamps, so it does not matter when this test is scheduled.
  int pushed = 0;
  int released = 0;
  EXPECT_TRUE(eventually([&] {
    rtbus::Stamped<rtbus::PlantState> state;
    while (states->read_next(state) == rtbus::ReadStatus::kFresh) {
      const bool zero = state.value.applied_force_n == std::array<double, 3>{};
      pushed += !zero && state.value.timed_out == 0;
      if (state.value.sample_time_ns < last_command_ns + kForceTimeoutNs) continue;
      EXPECT_TRUE(zero) << "force " << state.value.sample_time_ns - last_command_ns << " ns after the last command";
      EXPECT_EQ(state.value.timed_out, 1u);
      ++released;
    }
    return released > 100;
  }));
  EXPECT_GT(pushed, 0);

  // Commands that come back act again.
  write_some(*device);
  rtbus::Stamped<rtbus::PlantState> state;
  EXPECT_TRUE(eventually([&] {
    (void)device->write(rtbus::monotonic_ns(), {{1.0, 0.0, 0.0}});
    return states->read_latest(state) == rtbus::ReadStatus::kFresh && state.value.timed_out == 0 &&
           state.value.applied_force_n[0] > 0.9;
  }));
}

TEST(SimulatedPlant, AWriteIsNotTakenWhileThePlantHasLetGo) {
  const SessionFile session(kDevice);
  const PlantProcess plant(session);
  const auto device = session.open_device();
  ASSERT_TRUE(device->start(rtbus::monotonic_ns()));
  DeviceSample sample;
  const auto write = [&] {
    (void)device->read(rtbus::monotonic_ns(), sample);
    return device->write(rtbus::monotonic_ns(), {{1.0, 0.0, 0.0}});
  };
  EXPECT_EQ(write(), IoStatus::kOk) << "the first command ends no force that anybody had";
  write_some(*device);
  auto states = rtbus::Reader<rtbus::PlantState>::open({.name = session.name(), .group = {}}, "haptic0.plant_state");
  ASSERT_TRUE(states);
  ASSERT_TRUE(eventually([&] {
    (void)device->read(rtbus::monotonic_ns(), sample);
    rtbus::Stamped<rtbus::PlantState> state;
    return states->read_latest(state) == rtbus::ReadStatus::kFresh && state.value.timed_out != 0;
  }));
  // The state that tells it is older than this read, so the link has it.
  EXPECT_EQ(write(), IoStatus::kLost);
  EXPECT_TRUE(eventually([&] { return write() == IoStatus::kOk; })) << "and it is taken again";
}

TEST(SimulatedPlant, HandFeelsTheCommandedForce) {
  const SessionFile session(kDevice);
  const PlantProcess plant(session);
  const auto device = session.open_device();
  ASSERT_TRUE(device->start(rtbus::monotonic_ns()));
  // 1 N and the weight against 300 N/m of hand, less what friction may carry.
  EXPECT_TRUE(eventually([&] {
    write_some(*device);
    DeviceSample sample;
    const IoStatus status = device->read(rtbus::monotonic_ns(), sample);
    return status == IoStatus::kOk && std::abs(sample.position_m[0] - 1.0 / 300.0) < 0.06 / 300.0 + 50e-6;
  }));
}

TEST(SimulatedPlant, LinkSurvivesThePlantsDeath) {
  const SessionFile session(kDevice);
  auto plant = std::make_unique<PlantProcess>(session);
  const auto device = session.open_device();
  ASSERT_TRUE(device->start(rtbus::monotonic_ns()));
  DeviceSample sample;
  EXPECT_NE(device->read(rtbus::monotonic_ns(), sample), IoStatus::kLost);

  EXPECT_EQ(plant->end(SIGKILL), -SIGKILL);
  EXPECT_TRUE(eventually([&] { return device->read(rtbus::monotonic_ns(), sample) == IoStatus::kLost; }));
  EXPECT_EQ(device->wait_sample(rtbus::monotonic_ns() + 2 * kNsPerMs), IoStatus::kLost);

  plant = std::make_unique<PlantProcess>(session);
  EXPECT_TRUE(eventually([&] {
    device->maintain();
    (void)device->write(rtbus::monotonic_ns(), {{1.0, 0.0, 0.0}});
    return device->read(rtbus::monotonic_ns(), sample) == IoStatus::kOk && sample.position_m[0] > 1e-3;
  }));
}

TEST(SimulatedPlant, EndsCleanlyOnASignal) {
  for (const int signal : {SIGTERM, SIGINT}) {
    const SessionFile session(kDevice);
    PlantProcess plant(session);
    ASSERT_TRUE(eventually([&] { return session.segments().size() == 1; }));
    // The topic exists before the signals have a taker; they wait for it.
    EXPECT_EQ(plant.end(signal), 0);
    EXPECT_THAT(session.segments(), ::testing::IsEmpty());
  }
}

TEST(SimulatedPlant, SecondOneForTheSameNodeIsRefused) {
  const SessionFile session(kDevice);
  const PlantProcess first(session);
  const auto device = session.open_device();
  ASSERT_TRUE(device->start(rtbus::monotonic_ns()));
  PlantProcess second(session);
  EXPECT_EQ(second.end(0), 1);
}

TEST(SimulatedPlant, LinkWithoutAPlantSaysWhatToStart) {
  const SessionFile session(kDevice);
  const auto device = session.open_device();
  const auto started = device->start(rtbus::monotonic_ns());
  ASSERT_FALSE(started);
  EXPECT_THAT(started.error().message, ::testing::HasSubstr("simulated_plant --config"));
  EXPECT_THAT(session.segments(), ::testing::IsEmpty());
}

TEST(SimulatedPlant, CommandLineIsChecked) {
  const SessionFile session(kDevice);
  EXPECT_EQ(PlantProcess(Arguments{"--help"}).end(0), 0);
  EXPECT_EQ(PlantProcess(Arguments{"--frobnicate"}).end(0), 2);
  EXPECT_EQ(PlantProcess(Arguments{"--config"}).end(0), 2);
  EXPECT_EQ(PlantProcess(Arguments{"--config", session.path(), "--node", "haptic7"}).end(0), 2);
  EXPECT_EQ(PlantProcess(Arguments{"--config", "/nonexistent.yaml", "--node", "haptic0"}).end(0), 2);
  EXPECT_EQ(
      PlantProcess(Arguments{"--config", session.path(), "--node", "haptic0", "--set", "haptic.0.device.process=node"})
          .end(0),
      1);
}

}  // namespace
}  // namespace drivers::testing
