/// Nothing that lies still may wander, sink or fall over: stacks, beads and large boxes, asleep and awake.
#include <gtest/gtest.h>

#include <cstdio>
#include <utility>

#include "rtbus/config/document.hpp"
#include "rtbus/config/scene.hpp"

#include "tests/unit/bullet/scenes.hpp"

namespace {

using tests::bullet;
using tests::Rest;
using tests::Vector3d;

void run(physics::World& world, double seconds, double h) {
  for (int i = 0; i < static_cast<int>(std::lround(seconds / h)); ++i) world.step(h);
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
              rest.height_error_m * 1e3, rest.creep_m * 1e3, 100.0 * rest.mean_penetration_m / stack.edge_m,
              rest.awake);
  EXPECT_LE(rest.height_error_m, 0.05 * stack.edge_m);  // 1 mm of 20
  EXPECT_LE(rest.creep_m, 0.1 * stack.edge_m);
  EXPECT_LT(rest.mean_penetration_m, 0.01 * stack.edge_m);
  EXPECT_EQ(rest.awake, 0U);
}

INSTANTIATE_TEST_SUITE_P(Sizes, RestingStack,
                         testing::Values(Stack{"cubes_125", 5, 5, 5, 0.02, 1e-4, 1e-3, 10},
                                         Stack{"cubes_250", 10, 5, 5, 0.02, 1e-4, 1e-3, 10},
                                         Stack{"cubes_250_as_in_the_session", 10, 5, 5, 0.02, 1e-4, 2e-3, 15},
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

// What a step costs goes with the bodies that move and the contacts that are solved: both are counted, not timed
// (`rtbus bench physics` times them).
TEST(Resting, HasNothingLeftToSolveOnceAsleep) {
  for (const auto& [wide, high] : {std::pair{5, 5}, {10, 5}, {10, 10}}) {
    const auto scene = tests::stack_scene(wide, high, 5, 0.02, 1e-4);
    const auto cubes = static_cast<std::size_t>(wide * high * 5);
    const auto world = bullet(scene);
    run(*world, 0.1, 1e-3);
    EXPECT_EQ(world->awake_bodies(), cubes);
    EXPECT_GE(world->solved_contacts(), 4 * cubes) << "each cube stands on four points";
    run(*world, 2.0, 1e-3);
    EXPECT_EQ(world->awake_bodies(), 0U) << cubes;
    EXPECT_EQ(world->solved_contacts(), 0U) << cubes;
  }
}

/// Deepest overlap of two spheres, or of a sphere and the floor at y = 0, over the diameter.
double deepest_overlap(const physics::World& world, const rtbus::config::Scene& scene) {
  double deepest = 0.0;
  for (std::size_t i = 0; i < scene.bodies.size(); ++i) {
    const auto* const a = std::get_if<rtbus::shapes::Sphere>(&scene.bodies[i].shape);
    if (a == nullptr) continue;
    const Vector3d at = world.body_pose(i).position_m;
    deepest = std::max(deepest, (a->radius_m - at.y()) / (2.0 * a->radius_m));
    for (std::size_t j = i + 1; j < scene.bodies.size(); ++j) {
      const auto* const b = std::get_if<rtbus::shapes::Sphere>(&scene.bodies[j].shape);
      if (b == nullptr) continue;
      const double gap_m = (world.body_pose(j).position_m - at).norm() - a->radius_m - b->radius_m;
      deepest = std::max(deepest, -gap_m / (2.0 * a->radius_m));
    }
  }
  return deepest;
}

/// Beads, large boxes and a bit of everything: nothing sinks, nothing wanders off, all falls asleep.
struct Pile {
  const char* scene;
  double h;
  double lowest_m;  ///< No centre may be lower than this above the floor.
};
void PrintTo(const Pile& pile, std::ostream* out) { *out << pile.scene; }

class RestingPile : public testing::TestWithParam<Pile> {};

TEST_P(RestingPile, ComesToRestAndFallsAsleep) {
  const Pile& pile = GetParam();
  auto map = rtbus::config::load(std::string(RTBUS_SOURCE_DIR) + "/config/scenes/" + pile.scene + ".yaml");
  const rtbus::config::Scene scene = rtbus::config::read_scene(map);
  const auto world = bullet(scene);
  run(*world, 8.0, pile.h);
  std::vector<Vector3d> then;
  for (std::size_t i = 0; i < world->bodies(); ++i) then.push_back(world->body_pose(i).position_m);
  run(*world, 2.0, pile.h);
  double lowest_m = 1e9, moved_m = 0.0;
  for (std::size_t i = 0; i < world->bodies(); ++i) {
    if (scene.bodies[i].type != rtbus::config::BodyType::kDynamic) continue;
    const Vector3d at = world->body_pose(i).position_m;
    if (std::holds_alternative<rtbus::config::ConvexHull>(scene.bodies[i].shape)) {
      EXPECT_NEAR(at.y(), 0.0, 0.2e-3) << "its origin is in the face it lies on; it lies on its skin";
    } else {
      lowest_m = std::min(lowest_m, at.y());
    }
    moved_m = std::max(moved_m, (at - then[i]).norm());
  }
  const double overlap = deepest_overlap(*world, scene);
  std::printf(
      "%s: lowest centre %.4g mm, deepest overlap of spheres %.3g %%, moved %.3g mm in the last 2 s, awake %zu\n",
      pile.scene, lowest_m * 1e3, 100.0 * overlap, moved_m * 1e3, world->awake_bodies());
  EXPECT_GE(lowest_m, pile.lowest_m);
  EXPECT_LE(overlap, 0.02);
  EXPECT_LE(moved_m, 1e-5);
  EXPECT_EQ(world->awake_bodies(), 0U);
  EXPECT_EQ(world->solved_contacts(), 0U);
}

// Steps as in the sessions of these scenes. The smallest half extents are 1 mm (a bead) and 5 mm (the die).
INSTANTIATE_TEST_SUITE_P(Scenes, RestingPile,
                         testing::Values(Pile{"beads_mm", 1e-3 / 3.0, 0.98e-3}, Pile{"mixed_sizes", 0.5e-3, 4.95e-3}),
                         [](const auto& row) { return std::string(row.param.scene); });

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
