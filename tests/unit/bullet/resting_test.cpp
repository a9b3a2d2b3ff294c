/// Nothing that lies still may wander, sink or fall over: stacks, beads and large boxes, asleep and awake.
#include <gtest/gtest.h>

#include <cstdio>
#include <ctime>

#include "tests/unit/bullet/scenes.hpp"

namespace {

using tests::bullet;
using tests::Rest;
using tests::Vector3d;

void run(physics::World& world, double seconds, double h) {
  for (int i = 0; i < static_cast<int>(std::lround(seconds / h)); ++i) world.step(h);
}

/// CPU milliseconds per step of this thread, for the printed figures only.
double cpu_ms_per_step(physics::World& world, int steps, double h) {
  timespec from{}, to{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &from);
  for (int i = 0; i < steps; ++i) world.step(h);
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &to);
  return (static_cast<double>(to.tv_sec - from.tv_sec) * 1e3 + static_cast<double>(to.tv_nsec - from.tv_nsec) * 1e-6) /
         steps;
}

struct Stack {
  const char* name;
  int wide, high, deep;
  double edge_m, gap_m, h;
  int iterations;
};
void PrintTo(const Stack& stack, std::ostream* out) { *out << stack.name; }

class RestingStack : public testing::TestWithParam<Stack> {};

TEST_P(RestingStack, StandsWhereItWasBuiltAndFallsAsleep) {
  const Stack& stack = GetParam();
  const auto scene = tests::stack_scene(stack.wide, stack.high, stack.deep, stack.edge_m, stack.gap_m);
  const auto world = bullet(scene, stack.iterations);
  run(*world, 10.0, stack.h);
  const Rest rest = tests::look_at(*world, scene, stack.high, stack.deep, stack.edge_m);
  std::printf("%s: height error %.3g mm, creep %.3g mm, mean penetration %.3g %% of the edge, awake %zu\n", stack.name,
              rest.height_error_m * 1e3, rest.creep_m * 1e3, 100.0 * rest.mean_penetration_m / stack.edge_m, rest.awake);
  EXPECT_LE(rest.height_error_m, 0.05 * stack.edge_m);  // 1 mm of 20
  EXPECT_LE(rest.creep_m, 0.1 * stack.edge_m);
  EXPECT_LT(rest.mean_penetration_m, 0.01 * stack.edge_m);
  EXPECT_EQ(rest.awake, 0U);
}

INSTANTIATE_TEST_SUITE_P(Sizes, RestingStack,
                         testing::Values(Stack{"cubes_125", 5, 5, 5, 0.02, 1e-4, 1e-3, 10},
                                         Stack{"cubes_250", 10, 5, 5, 0.02, 1e-4, 1e-3, 10},
                                         Stack{"cubes_500", 10, 10, 5, 0.02, 1e-4, 1e-3, 10},
                                         Stack{"cubes_500_as_in_the_session", 10, 10, 5, 0.02, 1e-3, 2e-3, 10},
                                         Stack{"grains_2_mm", 5, 5, 5, 0.002, 1e-5, 0.36e-3, 10},
                                         Stack{"boxes_1_m", 5, 5, 5, 1.0, 5e-3, 1.0 / 240.0, 10}),
                         [](const auto& row) { return std::string(row.param.name); });

TEST(Resting, StandsForSecondsWithoutSleepingToo) {
  auto scene = tests::stack_scene(5, 5, 5, 0.02, 1e-4);
  scene.deactivation.enabled = false;
  const auto world = bullet(scene);
  run(*world, 4.0, 1e-3);
  const Rest rest = tests::look_at(*world, scene, 5, 5, 0.02);
  EXPECT_EQ(rest.awake, 125U);
  EXPECT_LE(rest.creep_m, 0.5e-3);
  EXPECT_LT(rest.mean_penetration_m, 0.01 * 0.02);
}

TEST(Resting, CostsNothingToSpeakOfOnceAsleep) {
  const auto scene = tests::stack_scene(10, 10, 5, 0.02, 1e-4);
  const auto world = bullet(scene);
  run(*world, 0.1, 1e-3);
  EXPECT_EQ(world->awake_bodies(), 500U);
  const double awake_ms = cpu_ms_per_step(*world, 100, 1e-3);
  run(*world, 2.0, 1e-3);
  EXPECT_EQ(world->awake_bodies(), 0U);
  const double asleep_ms = cpu_ms_per_step(*world, 500, 1e-3);
  std::printf("500 cubes: %.3g ms per step awake, %.3g ms asleep, %.3g times less\n", awake_ms, asleep_ms,
              awake_ms / asleep_ms);
  RecordProperty("ratio", std::to_string(awake_ms / asleep_ms));
}

TEST(Resting, StaysAsleepWhenBuiltSo) {
  auto scene = tests::stack_scene(5, 5, 5, 0.02, 1e-4);
  for (auto& body : scene.bodies) body.asleep = body.type == rtbus::config::BodyType::kDynamic;
  const auto world = bullet(scene);
  run(*world, 1.0, 4e-3);
  EXPECT_LT(tests::look_at(*world, scene, 5, 5, 0.02).creep_m, 1e-8);  // Bullet's units and back: rounding only
  EXPECT_EQ(world->awake_bodies(), 0U);
}

TEST(Resting, WakesWhenTheProxyTouches) {
  const auto scene = tests::stack_scene(5, 5, 5, 0.02, 1e-4);
  const auto world = bullet(scene);
  world->add_proxy({"haptic0", 0.1, 0.005, 1.0, {0.04, 0.05, -0.03}});
  run(*world, 2.0, 1e-3);
  ASSERT_EQ(world->awake_bodies(), 0U);
  for (int i = 0; i < 1000; ++i) {
    world->set_proxy_target(0, {{0.04, 0.05, -0.03 + 0.04 * i * 1e-3}, {0, 0, 0.04}, 300.0, 6.0});
    world->step(1e-3);
  }
  EXPECT_GT(world->awake_bodies(), 5U);
  const std::size_t touched = 1 + 2 * 25 + 2 * 5;  // cube_2_2_0
  EXPECT_GT(world->body_pose(touched).position_m.z(), 1e-3);
}

TEST(Resting, WarnsWhenTheStepIsTooLongForTheSmallestBody) {
  const auto scene = tests::stack_scene(1, 2, 1, 0.02, 0.0);
  EXPECT_TRUE(bullet(scene)->warnings(1e-3).empty());
  ASSERT_EQ(bullet(scene)->warnings(2e-3).size(), 1U);
  EXPECT_NE(bullet(scene)->warnings(2e-3)[0].find("2 ms is longer than 1.13 ms"), std::string::npos)
      << bullet(scene)->warnings(2e-3)[0];
  EXPECT_TRUE(bullet(tests::floor_scene())->warnings(0.1).empty()) << "nothing there to fall over";
}

}  // namespace
