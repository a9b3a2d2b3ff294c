// The haptic node's end of a plant in a process of its own: what it concludes from the states that come.
#include "drivers/simulated/plant_link.hpp"

#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cstdint>
#include <string>
#include <thread>

#include "rtbus/clock.hpp"
#include "rtbus/messages.hpp"
#include "rtbus/topic.hpp"

namespace drivers::simulated {
namespace {

// A plant that tells a state every millisecond, and takes commands or not. It never lets go by itself.
class TellingPlant {
 public:
  explicit TellingPlant(const rtbus::Session& session)
      : states_(*rtbus::Writer<rtbus::PlantState>::create(session, "haptic0.plant_state")),
        commands_(session, "haptic0.plant_command"),
        thread_([this] { run(); }) {}
  ~TellingPlant() {
    stop_ = true;
    thread_.join();
  }
  void takes_commands(bool taking) { taking_ = taking; }

 private:
  void run() {
    rtbus::Stamped<rtbus::PlantCommand> command;
    while (!stop_) {
      commands_.maintain();
      rtbus::PlantState state;
      state.sample_time_ns = rtbus::monotonic_ns();
      if (taking_) (void)commands_.read_latest(command);
      state.command_time_ns = std::min(command.stamp_ns, state.sample_time_ns);
      states_.publish(state, state.sample_time_ns);
      rtbus::sleep_until(state.sample_time_ns + rtbus::kNsPerMs);
    }
  }

  rtbus::Writer<rtbus::PlantState> states_;
  rtbus::Subscription<rtbus::PlantCommand> commands_;
  std::atomic<bool> taking_{true};
  std::atomic<bool> stop_{false};
  std::thread thread_;
};

struct LinkToATellingPlant : testing::Test {
  rtbus::Session session_{.name = "plant-link-test-" + std::to_string(::getpid()), .group = {}};
  TellingPlant plant_{session_};
  PlantLink link_{SimulatedSettings{}, {session_, "haptic0"}};

  IoStatus cycle() {
    const std::uint64_t now_ns = rtbus::monotonic_ns();
    rtbus::sleep_until(now_ns + rtbus::kNsPerMs);
    DeviceSample sample;
    (void)link_.read(rtbus::monotonic_ns(), sample);
    return link_.write(rtbus::monotonic_ns(), {{1.0, 0.0, 0.0}});
  }
  bool comes_to(IoStatus wanted) {
    const std::uint64_t give_up_ns = rtbus::monotonic_ns() + 10 * rtbus::kNsPerS;
    while (rtbus::monotonic_ns() < give_up_ns) {
      if (cycle() == wanted) return true;
    }
    return false;
  }
};

// `evaluate faults`, topics_truncated: a device that still holds the last force may not get the next one as a step.
TEST_F(LinkToATellingPlant, NoticesThatItsCommandsAreNoLongerTaken) {
  ASSERT_TRUE(link_.start(rtbus::monotonic_ns()));
  for (int i = 0; i < 100; ++i) ASSERT_EQ(cycle(), IoStatus::kOk) << "command " << i;
  plant_.takes_commands(false);
  EXPECT_TRUE(comes_to(IoStatus::kLost));
  plant_.takes_commands(true);
  EXPECT_TRUE(comes_to(IoStatus::kOk));
  for (int i = 0; i < 20; ++i) ASSERT_EQ(cycle(), IoStatus::kOk) << "command " << i;
}

TEST_F(LinkToATellingPlant, IsNotLostForAWriterThatWasHeldUp) {
  ASSERT_TRUE(link_.start(rtbus::monotonic_ns()));
  for (int i = 0; i < 20; ++i) {
    EXPECT_EQ(cycle(), IoStatus::kOk);
    rtbus::sleep_until(rtbus::monotonic_ns() + 5 * PlantLink::kUnheardAfterNs);
  }
}

TEST_F(LinkToATellingPlant, IsNotLostBeforeThePlantHasFoundItsCommands) {
  plant_.takes_commands(false);
  ASSERT_TRUE(link_.start(rtbus::monotonic_ns()));
  for (int i = 0; i < 20; ++i) EXPECT_EQ(cycle(), IoStatus::kOk);
}

}  // namespace
}  // namespace drivers::simulated
