/// The plant in a process of its own, and what it takes for a command.
#include "drivers/simulated/plant.hpp"

#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cstring>
#include <fstream>
#include <functional>
#include <iterator>
#include <string>
#include <thread>
#include <vector>

#include "rtbus/clock.hpp"
#include "rtbus/topic_directory.hpp"

namespace {

using rtbus::PlantCommand;
using rtbus::PlantState;

struct PlantOnTheBus : testing::Test {
  rtbus::Session session_;
  PlantOnTheBus() { session_.name = "plant-test-" + std::to_string(::getpid()); }
  /// Runs the plant until its state fulfils that. @returns whether it did.
  bool run_until(drivers::simulated::Plant& plant, const std::function<bool(const PlantState&)>& wanted) const {
    auto states = rtbus::Reader<PlantState>::open(session_, "haptic0.plant_state");
    if (!states) return false;
    std::atomic<bool> stop{false};
    std::thread thread([&] { plant.run_until(stop); });
    rtbus::Stamped<PlantState> state;
    bool came = false;
    const std::uint64_t end_ns = rtbus::monotonic_ns() + 10 * rtbus::kNsPerS;
    while (!came && rtbus::monotonic_ns() < end_ns) {
      while (!came && states->read_next(state) == rtbus::ReadStatus::kFresh) came = wanted(state.value);
      std::this_thread::yield();
    }
    stop = true;
    thread.join();
    return came;
  }
};

// docs/safety.md, `topics_scribbled`: the bus cannot tell a word that somebody else wrote from the writer's.
TEST_F(PlantOnTheBus, ObeysAWordThatSomebodyWroteOverTheForce) {
  constexpr double kForce_n = 1.2345, kOther_n = 0.25;
  drivers::simulated::SimulatedSettings settings;
  settings.mechanics.force_step_n = 0.0;
  settings.mechanics.max_force_n = 7.9;
  settings.info.force_timeout_s = 100.0;  // however busy the machine is
  auto plant = drivers::simulated::Plant::create(settings, session_, "haptic0");
  ASSERT_TRUE(plant);
  auto commands = rtbus::Writer<PlantCommand>::create(session_, "haptic0.plant_command");
  ASSERT_TRUE(commands);
  (*plant)->maintain();
  commands->publish({{0.0, kForce_n, 0.0}}, rtbus::monotonic_ns());

  const std::string path = "/dev/shm/" + rtbus::segment_name(session_.name, "haptic0.plant_command");
  std::fstream file(path, std::ios::in | std::ios::out | std::ios::binary);
  const std::vector<char> bytes((std::istreambuf_iterator<char>(file)), {});
  char word[8];
  std::memcpy(word, &kForce_n, 8);
  const auto found = std::search(bytes.begin(), bytes.end(), word, word + 8);
  ASSERT_NE(found, bytes.end());
  std::memcpy(word, &kOther_n, 8);
  file.clear();
  file.seekp(found - bytes.begin());
  file.write(word, 8).flush();
  EXPECT_TRUE(run_until(**plant, [](const PlantState& state) { return state.applied_force_n[1] == kOther_n; }));
  // The next command is the writer's again.
  commands->publish({{0.0, kForce_n, 0.0}}, rtbus::monotonic_ns());
  EXPECT_TRUE(run_until(**plant, [](const PlantState& state) { return state.applied_force_n[1] == kForce_n; }));
}

}  // namespace
