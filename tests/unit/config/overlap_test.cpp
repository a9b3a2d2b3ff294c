#include "rtbus/config/overlap.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <memory>
#include <string>

#include "rtbus/config/closed_surface.hpp"

namespace {

using Eigen::Vector3d;
using rtbus::config::Body;
using rtbus::config::BodyShape;
using rtbus::config::BodyType;
using rtbus::config::is_inside;
using rtbus::config::overlap_warnings;
using rtbus::config::Scene;
using rtbus::config::TriangleMesh;

Body body(BodyShape shape, const Vector3d& p_WB, BodyType type = BodyType::kDynamic) {
  Body out;
  out.name = "body";
  out.source = "scene.yaml:1: bodies.0";
  out.type = type;
  out.shape = std::move(shape);
  out.p_WB = p_WB;
  return out;
}

BodyShape cube(double edge_m) { return rtbus::shapes::Box{Vector3d::Constant(0.5 * edge_m)}; }
BodyShape plane() { return rtbus::shapes::Plane{}; }

/// Corners of a cube around a point that is not the origin.
BodyShape hull(double edge_m) {
  auto points = std::make_shared<TriangleMesh>();
  for (int i = 0; i < 8; ++i) {
    points->vertices_m.emplace_back((i & 1) * edge_m, (i & 2) / 2 * edge_m, (i & 4) / 4 * edge_m);
  }
  return rtbus::config::ConvexHull{points};
}

Scene scene_of(std::vector<Body> bodies) {
  Scene out;
  out.bodies = std::move(bodies);
  return out;
}

TEST(IsInside, KnowsEveryShape) {
  const auto ball = std::make_shared<const TriangleMesh>(rtbus::config::make_ball(200, 0.05));
  const Vector3d above(0.0, 0.06, 0.0), below(0.0, 0.04, 0.0);
  const std::vector<BodyShape> shapes{rtbus::shapes::Sphere{0.05}, cube(0.1), rtbus::config::Capsule{0.02, 0.1},
                                      rtbus::config::Cylinder{0.02, 0.1}, rtbus::config::Mesh{ball}};
  for (const BodyShape& shape : shapes) {
    const Body at = body(shape, {0.3, 0.0, 0.0});
    EXPECT_TRUE(is_inside(at, at.p_WB + below, 1e-6)) << name_of(shape);
    EXPECT_FALSE(is_inside(at, at.p_WB + above, 1e-6)) << name_of(shape);
  }
  EXPECT_TRUE(is_inside(body(plane(), {0.0, 0.05, 0.0}), below, 1e-6));
  EXPECT_FALSE(is_inside(body(plane(), {0.0, 0.05, 0.0}), above, 1e-6));
}

TEST(IsInside, AsksForTheDepth) {
  EXPECT_TRUE(is_inside(body(cube(0.1), Vector3d::Zero()), {0.0, 0.04, 0.0}, 0.009));
  EXPECT_FALSE(is_inside(body(cube(0.1), Vector3d::Zero()), {0.0, 0.04, 0.0}, 0.011));
  EXPECT_TRUE(is_inside(body(hull(0.1), Vector3d::Zero()), {0.05, 0.09, 0.05}, 0.009));
  EXPECT_FALSE(is_inside(body(hull(0.1), Vector3d::Zero()), {0.05, 0.09, 0.05}, 0.011));
  EXPECT_FALSE(is_inside(body(hull(0.1), Vector3d::Zero()), {0.05, 0.1001, 0.05}, 0.0));
}

TEST(IsInside, TurnsWithTheBody) {
  Body at = body(rtbus::shapes::Box{{0.1, 0.01, 0.01}}, Vector3d::Zero());
  EXPECT_FALSE(is_inside(at, {0.0, 0.05, 0.0}, 0.0));
  at.q_WB = Eigen::AngleAxisd(0.5 * 3.14159265, Vector3d::UnitZ());
  EXPECT_TRUE(is_inside(at, {0.0, 0.05, 0.0}, 0.0));
}

TEST(IsInside, AnOpenMeshHoldsNothing) {
  auto open = rtbus::config::make_ball(200, 0.05);
  open.triangles.pop_back();
  EXPECT_FALSE(is_inside(body(rtbus::config::Mesh{std::make_shared<const TriangleMesh>(open)}, Vector3d::Zero()),
                         Vector3d::Zero(), 0.0));
}

TEST(OverlapWarnings, AreSilentAboutBodiesThatTouch) {
  const Body floor = body(plane(), Vector3d::Zero(), BodyType::kStatic);
  for (const auto& [shape, height_m] :
       {std::pair{cube(0.1), 0.05}, std::pair{BodyShape(rtbus::shapes::Sphere{0.05}), 0.05},
        std::pair{BodyShape(rtbus::config::Capsule{0.02, 0.1}), 0.05}, std::pair{hull(0.1), 0.0}}) {
    const Body lower = body(shape, {0.0, height_m, 0.0}), upper = body(shape, {0.0, height_m + 0.1, 0.0});
    EXPECT_THAT(overlap_warnings(scene_of({floor, lower, upper})), testing::IsEmpty()) << name_of(shape);
    // A little depth is what a stack at rest has.
    const Body sunk = body(shape, {0.0, height_m - 0.002, 0.0});
    EXPECT_THAT(overlap_warnings(scene_of({floor, sunk})), testing::IsEmpty()) << name_of(shape);
  }
}

TEST(OverlapWarnings, TellOfABodyInTheFloorAndInAnother) {
  const Body floor = body(plane(), Vector3d::Zero(), BodyType::kStatic);
  for (const BodyShape& shape :
       {cube(0.1), BodyShape(rtbus::shapes::Sphere{0.05}), BodyShape(rtbus::config::Capsule{0.02, 0.1}),
        BodyShape(rtbus::config::Cylinder{0.05, 0.1}), hull(0.1)}) {
    EXPECT_EQ(overlap_warnings(scene_of({floor, body(shape, {0.0, -0.03, 0.0})})).size(), 1u) << name_of(shape);
    EXPECT_EQ(overlap_warnings(scene_of({body(shape, Vector3d::Zero()), body(cube(0.04), {0.02, 0.02, 0.02})})).size(),
              1u)
        << name_of(shape);
  }
}

TEST(OverlapWarnings, NeedABodyThatMoves) {
  EXPECT_THAT(overlap_warnings(scene_of({body(cube(0.1), Vector3d::Zero(), BodyType::kStatic),
                                         body(cube(0.1), Vector3d::Zero(), BodyType::kStatic)})),
              testing::IsEmpty());
}

}  // namespace
