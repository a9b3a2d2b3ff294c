#include "tools/cli/run/restarts.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "rtbus/clock.hpp"

namespace tools {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;

constexpr int kStatus1 = 1 << 8;  // as waitpid() gives it

class RestartsTest : public ::testing::Test {
 protected:
  RestartsTest() {
    plan_.plants = {{"haptic0 plant", Stage::kPlant, "/plant", {}}};
    plan_.nodes = {{"physics", Stage::kPhysics, "/physics", {}},
                   {"haptic0", Stage::kHaptic, "/haptic", {"--telemetry"}}};
    plan_.bridge = ChildSpec{"bridge", Stage::kObserver, "/bridge", {}};
  }
  static ChildEnd crash(std::string name, double cpu_s) {
    ChildEnd end;
    end.name = std::move(name);
    end.wait_status = kStatus1;
    end.cpu_s = cpu_s;
    return end;
  }
  RunPlan plan_;
};

TEST_F(RestartsTest, AChildIsDueWhenItsDelayIsOver) {
  Restarts restarts(plan_, true);
  const auto verdict = restarts.on_end(crash("haptic0", 0.5), rtbus::kNsPerS);
  ASSERT_TRUE(verdict.restart);
  const std::uint64_t due_ns = rtbus::kNsPerS + static_cast<std::uint64_t>(verdict.delay_s * 1e9);
  EXPECT_THAT(restarts.waiting(), ElementsAre("haptic0"));
  EXPECT_FALSE(restarts.take_due(due_ns - 1).has_value());
  const auto child = restarts.take_due(due_ns);
  ASSERT_TRUE(child.has_value());
  EXPECT_EQ(child->program, "/haptic");
  EXPECT_THAT(child->arguments, ElementsAre("--telemetry"));
  EXPECT_THAT(restarts.waiting(), IsEmpty());
  EXPECT_FALSE(restarts.take_due(UINT64_MAX).has_value());
}

TEST_F(RestartsTest, EachKindOfChildComesBack) {
  Restarts restarts(plan_, true);
  for (const char* const name : {"haptic0 plant", "physics", "bridge"}) {
    ASSERT_TRUE(restarts.on_end(crash(name, 0.0), rtbus::kNsPerS).restart) << name;
    const auto child = restarts.take_due(UINT64_MAX);
    ASSERT_TRUE(child.has_value()) << name;
    EXPECT_EQ(child->name, name);
  }
}

TEST_F(RestartsTest, TheTimeOfAllProcessesOfAChildIsSummed) {
  Restarts restarts(plan_, true);
  EXPECT_EQ(restarts.ended_cpu_s("physics"), 0.0);
  (void)restarts.on_end(crash("physics", 0.5), rtbus::kNsPerS);
  (void)restarts.on_end(crash("physics", 0.25), 2 * rtbus::kNsPerS);
  EXPECT_EQ(restarts.ended_cpu_s("physics"), 0.75);
  EXPECT_EQ(restarts.ended_cpu_s("haptic0"), 0.0);
}

TEST_F(RestartsTest, NothingWaitsWhereRestartsAreNotAllowed) {
  Restarts restarts(plan_, false);
  EXPECT_FALSE(restarts.on_end(crash("physics", 0.5), rtbus::kNsPerS).restart);
  EXPECT_THAT(restarts.waiting(), IsEmpty());
}

}  // namespace
}  // namespace tools
