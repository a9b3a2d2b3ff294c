// Which CPUs an observer leaves to the loops, from what nodes say about themselves on the bus.
#include "tools/cli/host/loop_cores.hpp"

#include <gtest/gtest.h>
#include <sched.h>
#include <unistd.h>

#include <algorithm>
#include <cstring>
#include <optional>
#include <thread>

#include "rtbus/clock.hpp"
#include "rtbus/messages.hpp"

namespace {

class LoopCores : public testing::Test {
 protected:
  LoopCores() { session_.name = "cores-" + std::to_string(::getpid()); }

  void introduce(std::optional<rtbus::Writer<rtbus::NodeInfo>>& writer, const char* topic, const char* role,
                 std::uint32_t core) {
    auto created = rtbus::Writer<rtbus::NodeInfo>::create(session_, topic, {.capacity = 4});
    ASSERT_TRUE(created);
    writer.emplace(std::move(*created));
    rtbus::NodeInfo info;
    std::strncpy(info.role.data(), role, info.role.size() - 1);
    info.core = core;
    writer->publish(info, rtbus::monotonic_ns());
  }

  rtbus::Session session_;
  std::optional<rtbus::Writer<rtbus::NodeInfo>> haptic_, free_haptic_, physics_;
};

TEST_F(LoopCores, AreThoseOfPinnedHapticNodes) {
  introduce(haptic_, "haptic0.node_info", "haptic", 1);
  introduce(free_haptic_, "haptic1.node_info", "haptic", 0xffffffff);
  introduce(physics_, "physics.node_info", "physics", 0);
  EXPECT_EQ(tools::loop_cores(rtbus::list_topics(session_.name)), std::vector<int>{1});
}

TEST_F(LoopCores, OfANodeThatIsGoneAreFree) {
  introduce(haptic_, "haptic0.node_info", "haptic", 1);
  haptic_.reset();
  EXPECT_TRUE(tools::loop_cores(rtbus::list_topics(session_.name)).empty());
}

TEST_F(LoopCores, AreAvoidedUnlessThereIsNoOther) {
  cpu_set_t all;
  ASSERT_EQ(::sched_getaffinity(0, sizeof all, &all), 0);
  int last = CPU_SETSIZE - 1;
  while (!CPU_ISSET(last, &all)) --last;
  introduce(haptic_, "haptic0.node_info", "haptic", static_cast<std::uint32_t>(last));
  cpu_set_t left;
  std::thread([&] {  // an affinity of its own
    tools::keep_off_loops(rtbus::list_topics(session_.name));
    ::sched_getaffinity(0, sizeof left, &left);
  })
      .join();
  EXPECT_EQ(CPU_ISSET(last, &left) != 0, CPU_COUNT(&all) == 1);
  EXPECT_EQ(CPU_COUNT(&left), std::max(1, CPU_COUNT(&all) - 1));
}

}  // namespace
