#include "physics_node/analytic/contact_sweep.hpp"

#include <cmath>
#include <random>

#include <gtest/gtest.h>

namespace {

using Eigen::Vector3d;
using physics::analytic::Mover;
using physics::analytic::push_out;
using physics::analytic::sweep;
using physics::analytic::SweepResult;
using rtbus::shapes::Box;
using rtbus::shapes::nearest_surface;
using rtbus::shapes::PlacedShape;
using rtbus::shapes::Plane;
using rtbus::shapes::Sphere;

PlacedShape placed(rtbus::shapes::Shape shape, const Vector3d& position = Vector3d::Zero(), double friction = 0.0) {
  PlacedShape result;
  result.shape = shape;
  result.p_WB = position;
  result.friction = friction;
  return result;
}

double clearance(const std::vector<PlacedShape>& shapes, const Vector3d& position, double radius_m) {
  double least = 1e9;
  for (const PlacedShape& shape : shapes)
    least = std::min(least, nearest_surface(shape, position).distance_m - radius_m);
  return least;
}

TEST(ContactSweep, ReachesTheGoalBitForBitInTheOpen) {
  const Vector3d goal(0.1, 0.7, -0.3);
  const SweepResult result = sweep({placed(Plane{})}, {}, {0, 1, 0}, goal);
  EXPECT_EQ(result.end_m, goal);
  EXPECT_EQ(result.contacts, 0U);
}

TEST(ContactSweep, StopsOnThePlaneBelowTheGoalWithoutFriction) {
  const SweepResult result = sweep({placed(Plane{})}, {}, {0, 1, 0}, {0.5, -0.4, 0.2});
  EXPECT_NEAR((result.end_m - Vector3d(0.5, 0, 0.2)).norm(), 0.0, 1e-15);
  EXPECT_EQ(result.contacts, 1U);
}

TEST(ContactSweep, SticksWhereItTouchedWhenFrictionSuffices) {
  // It arrives at (0.25, 0, 0); the goal is 0.25 further and 0.5 deep: inside a cone of 0.6.
  const SweepResult result = sweep({placed(Plane{}, {0, 0, 0}, 0.6)}, {0.0, 1.0}, {0, 0.5, 0}, {0.5, -0.5, 0});
  EXPECT_NEAR((result.end_m - Vector3d(0.25, 0, 0)).norm(), 0.0, 1e-9);
}

TEST(ContactSweep, SlidesOnTheConeWhenFrictionDoesNotSuffice) {
  const SweepResult result = sweep({placed(Plane{}, {0, 0, 0}, 0.5)}, {0.0, 0.4}, {0, 0, 0}, {0.5, -1.0, 0});
  const Vector3d push = result.end_m - Vector3d(0.5, -1.0, 0);
  EXPECT_NEAR(push.y(), 1.0, 1e-15);
  EXPECT_NEAR(-push.x(), 0.2 * push.y(), 1e-15);  // 0.5 · 0.4
}

TEST(ContactSweep, DoesNotTunnelThroughAThinBoxAtAnySpeed) {
  for (const double reach_m : {0.1, 1.0, 100.0, 1e5}) {
    const SweepResult result = sweep({placed(Box{{10, 0.0005, 10}})}, {0.002, 0.0}, {0, 0.05, 0}, {0, -reach_m, 0});
    EXPECT_NEAR(result.end_m.y(), 0.0025, 1e-9) << reach_m;
  }
}

TEST(ContactSweep, PassesBesideABoxWithoutFeelingTheExtendedFace) {
  const std::vector<PlacedShape> shapes{placed(Box{{0.1, 0.1, 0.1}}, {0, 0, 0}, 1.0)};
  const Vector3d goal(1, 0.5, 0);
  const SweepResult result = sweep(shapes, {0.01, 1.0}, {-1, 0, 0}, goal);  // clears the edge by 0.125
  EXPECT_EQ(result.end_m, goal);
  EXPECT_EQ(result.contacts, 0U);
}

TEST(ContactSweep, PassesBesideASphereThatItsLineMissesByAMillimetre) {
  const std::vector<PlacedShape> shapes{placed(Sphere{0.1}, {0, 0, 0}, 1.0)};
  const Vector3d goal(1, 0.101, 0);
  const SweepResult result = sweep(shapes, {0.0, 1.0}, {-1, 0.101, 0}, goal);
  EXPECT_EQ(result.end_m, goal);
}

TEST(ContactSweep, EndsAtTheNearestPointOfASphereToAGoalInsideIt) {
  const std::vector<PlacedShape> shapes{placed(Sphere{0.1})};
  const Vector3d goal = Vector3d(0.3, 0.8, -0.2).normalized() * 0.06;
  const SweepResult result = sweep(shapes, {0.02, 0.0}, {0, 0.5, 0}, goal);
  EXPECT_NEAR((result.end_m - goal.normalized() * 0.12).norm(), 0.0, 1e-9);
}

TEST(ContactSweep, RestsInACornerOfThreeFaces) {
  PlacedShape wall_x = placed(Plane{});
  wall_x.q_WB = Eigen::Quaterniond::FromTwoVectors(Vector3d::UnitY(), Vector3d::UnitX());
  PlacedShape wall_z = placed(Plane{});
  wall_z.q_WB = Eigen::Quaterniond::FromTwoVectors(Vector3d::UnitY(), Vector3d::UnitZ());
  const SweepResult result = sweep({placed(Plane{}), wall_x, wall_z}, {0.01, 0.0}, {1, 1, 1}, {-0.2, -0.3, -0.4});
  EXPECT_NEAR((result.end_m - Vector3d(0.01, 0.01, 0.01)).norm(), 0.0, 1e-12);
  EXPECT_EQ(result.contacts, 3U);
}

TEST(ContactSweep, RollsAroundABoxEdgeWithItsRadius) {
  // Nearest free point to a goal just inside the rounded edge of box and sphere together.
  const std::vector<PlacedShape> shapes{placed(Box{{0.1, 0.1, 0.1}})};
  const Vector3d edge(0.1, 0.1, 0);
  const Vector3d goal = edge + Vector3d(1, 2, 0).normalized() * 0.004;
  const SweepResult result = sweep(shapes, {0.01, 0.0}, {0, 0.2, 0}, goal);
  EXPECT_NEAR((result.end_m - (edge + Vector3d(1, 2, 0).normalized() * 0.01)).norm(), 0.0, 1e-9);
}

TEST(ContactSweep, NeverPenetratesNorEndsFartherFromTheGoalInRandomScenes) {
  std::mt19937_64 random(7);
  std::uniform_real_distribution<double> u(-1, 1);
  for (int trial = 0; trial < 2000; ++trial) {
    std::vector<PlacedShape> shapes{placed(Plane{}, {0, -1, 0}, 0.5)};
    for (int i = 0; i < 4; ++i) {
      const Vector3d at(u(random), u(random), u(random));
      shapes.push_back(i % 2 == 0 ? placed(Sphere{0.3}, at, 0.5) : placed(Box{{0.3, 0.1, 0.2}}, at, 0.5));
      shapes.back().q_WB = Eigen::Quaterniond(u(random), u(random), u(random), u(random)).normalized();
    }
    const Vector3d start(u(random), 0.5 + u(random), u(random));
    if (clearance(shapes, start, 0.02) < 0.0) continue;
    const Vector3d goal = start + 2.0 * Vector3d(u(random), u(random), u(random));
    const double friction = trial % 2 == 0 ? 0.0 : 1.0;
    const SweepResult result = sweep(shapes, {0.02, friction}, start, goal);
    ASSERT_TRUE(result.end_m.allFinite()) << trial;
    EXPECT_GE(clearance(shapes, result.end_m, 0.02), -1e-8) << trial;
    EXPECT_LE((result.end_m - goal).norm(), (start - goal).norm() + 1e-9) << trial;
  }
}

TEST(ContactSweep, IsBoundedBetweenWallsThatLeaveNoRoom) {
  PlacedShape ceiling = placed(Plane{}, {0, 0.01, 0});
  ceiling.q_WB = Eigen::Quaterniond(0, 1, 0, 0);  // faces down
  const SweepResult result = sweep({placed(Plane{}), ceiling}, {0.02, 1.0}, {0, 0.005, 0}, {0.3, -2, 0});
  EXPECT_TRUE(result.end_m.allFinite());
  EXPECT_LE(result.end_m.norm(), 3.0);
}

TEST(PushOut, LeavesAFreePointAlone) {
  const Vector3d start(0.3, 0.02, 0);
  EXPECT_EQ(push_out({placed(Plane{})}, 0.02, start, 1.0), start);
}

TEST(PushOut, MovesNoFartherThanItsBudget) {
  EXPECT_NEAR(push_out({placed(Plane{})}, 0.01, {0, -1, 0}, 0.25).y(), -0.75, 1e-15);
  EXPECT_NEAR(push_out({placed(Plane{})}, 0.01, {0, -0.1, 0}, 0.25).y(), 0.01, 1e-15);
}

}  // namespace
