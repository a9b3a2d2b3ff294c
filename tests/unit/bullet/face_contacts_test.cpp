/// How bodies of the engine bullet slide on a plane, on a table and on a mesh: without rocking, since all that touches
/// is found in each step.
#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <memory>
#include <vector>

#include "tests/unit/bullet/scenes.hpp"

namespace face_contacts_test {
namespace {

using tests::Vector3d;
namespace shapes = rtbus::shapes;

constexpr double kMass_kg = 0.3, kFriction = 0.5, kTick_s = 1e-3;  // friction of the pair: its square

rtbus::config::BodyShape wedge() {
  auto mesh = std::make_shared<rtbus::config::TriangleMesh>();
  for (const double x : {-0.02, 0.02}) {
    mesh->vertices_m.insert(mesh->vertices_m.end(),
                            {Vector3d(x, 0, -0.03), Vector3d(x, 0, 0.03), Vector3d(x, 0.03, 0.03)});
  }
  return rtbus::config::ConvexHull{mesh};
}

struct Body {
  const char* what;
  rtbus::config::BodyShape shape;
  double height_m;
  Eigen::Quaterniond q_WB = Eigen::Quaterniond::Identity();
};

/// Four triangles around the middle, whose heights are rounded.
rtbus::config::BodyShape flat_mesh() {
  auto mesh = std::make_shared<rtbus::config::TriangleMesh>();
  mesh->vertices_m = {{-0.4, 0, -0.3}, {0.4, 0, -0.3}, {0.4, 0, 0.3}, {-0.4, 0, 0.3}, {0.005, 1e-7, 0.003}};
  mesh->triangles = {{0, 4, 1}, {1, 4, 2}, {2, 4, 3}, {3, 4, 0}};
  return rtbus::config::Mesh{mesh};
}

/// A plane, the upper side of a box, and a mesh.
std::vector<rtbus::config::Body> floors() {
  return {tests::body("floor", shapes::Plane{}),
          tests::body("table", shapes::Box{Vector3d(0.4, 0.05, 0.3)}, {0, -0.05, 0}),
          tests::body("mesh", flat_mesh(), {0, -0.13e-3, 0})};
}

/// Rests for 0.2 s, and is pushed at its centre along the floor for 0.3 s. @returns how far its y axis leaves the
/// upright, or the floor where it lies there, at most [rad].
double tilts_rad(const rtbus::config::Body& floor, const Body& each, const Vector3d& push_n) {
  rtbus::config::Scene scene = tests::floor_scene();
  scene.bodies[0] = floor;
  scene.bodies.push_back(tests::body("body", each.shape, {0, each.height_m, 0}, kMass_kg));
  scene.bodies.back().q_WB = each.q_WB;
  const auto world = tests::bullet(scene);
  const std::size_t proxy = world->add_proxy({"haptic0", 0.1, 0.005, 0.0, {0, 0.5, 0}});
  world->place_proxy(proxy, {0, 0.5, 0}, Vector3d::Zero());
  for (int i = 0; i < 200; ++i) world->step(kTick_s);
  const Vector3d before_m = world->body_pose(1).position_m;
  double most_rad = 0.0;
  for (int i = 0; i < 300; ++i) {
    world->apply_hand_force(proxy, 1, push_n, Vector3d::Zero());
    world->step(kTick_s);
    const Vector3d axis = world->body_pose(1).orientation * Vector3d(Vector3d::UnitY());
    most_rad = std::max(most_rad, std::min(std::abs(axis.y()), std::hypot(axis.x(), axis.z())));
  }
  EXPECT_GT((world->body_pose(1).position_m - before_m).norm(), 0.02) << each.what << " moves";
  std::printf("%s on the %s tilts by %.2g rad\n", each.what, floor.name.c_str(), most_rad);
  return most_rad;
}

// With one point found in a step what slides lost corners, and tilted by up to some milliradians.
TEST(BulletFaceContacts, WhatSlidesDoesNotRock) {
  const Vector3d push_n = 1.5 * kFriction * kFriction * kMass_kg * 9.81 * Vector3d(0.6, 0, 0.8);
  for (const Body& each : {Body{"box", shapes::Box{Vector3d(0.03, 0.01, 0.02)}, 0.01}, Body{"wedge", wedge(), 0.0},
                           Body{"cylinder", rtbus::config::Cylinder{0.03, 0.02}, 0.01}}) {
    for (const auto& floor : floors()) EXPECT_LE(tilts_rad(floor, each, push_n), 1e-6) << each.what << floor.name;
  }
}

// Nor does what rolls, which lay on one of its ends at a time.
TEST(BulletFaceContacts, WhatRollsDoesNotRock) {
  const Eigen::Quaterniond lies(Eigen::AngleAxisd(std::acos(0.0), Vector3d::UnitX()));
  for (const Body& each : {Body{"lying cylinder", rtbus::config::Cylinder{0.01, 0.05}, 0.01, lies},
                           Body{"lying capsule", rtbus::config::Capsule{0.01, 0.05}, 0.01, lies}}) {
    for (const auto& floor : floors()) {
      EXPECT_LE(tilts_rad(floor, each, {0.3, 0, 0}), 1e-6) << each.what << floor.name;
    }
  }
}

/// Where the body is after it has been pushed for so long.
Vector3d pushed_to_m(const rtbus::config::Scene& scene, const Vector3d& push_n, int steps) {
  const auto world = tests::bullet(scene);
  const std::size_t proxy = world->add_proxy({"haptic0", 0.1, 0.005, 0.0, {0, 0.5, 0}});
  world->place_proxy(proxy, {0, 0.5, 0}, Vector3d::Zero());
  for (int i = 0; i < steps; ++i) {
    world->apply_hand_force(proxy, 1, push_n, Vector3d::Zero());
    world->step(kTick_s);
  }
  return world->body_pose(1).position_m;
}

// Its middle is higher than the kerb: the face that it is beyond is the upper one, and no point of its rim is over
// that.
TEST(BulletFaceContacts, ACanStopsBeforeAKerb) {
  constexpr double kRadius_m = 0.02, kKerb_m = 0.05;
  rtbus::config::Scene scene = tests::floor_scene();
  scene.bodies.push_back(tests::body("can", rtbus::config::Cylinder{kRadius_m, 0.06}, {0, 0.03, 0}, kMass_kg));
  scene.bodies.back().q_WB = Eigen::AngleAxisd(std::acos(-1.0) / 8.0, Vector3d::UnitY());
  scene.bodies.push_back(tests::body("kerb", shapes::Box{Vector3d(0.02, 0.004, 0.2)}, {kKerb_m + 0.02, 0.004, 0}));
  const Vector3d at_m = pushed_to_m(scene, {1.1 * kFriction * kFriction * kMass_kg * 9.81, 0, 0}, 1500);
  EXPECT_NEAR(at_m.x(), kKerb_m - kRadius_m, 1e-4);
}

// Both sides of it are nearer to each other than what touches.
TEST(BulletFaceContacts, AThinPlateHoldsOnItsNearSide) {
  constexpr double kEdge_m = 0.02, kThick_m = 2e-4;
  auto mesh = std::make_shared<rtbus::config::TriangleMesh>();
  for (const double y : {0.0, -kThick_m}) {
    for (const double x : {-0.1, 0.1}) mesh->vertices_m.insert(mesh->vertices_m.end(), {{x, y, -0.1}, {x, y, 0.1}});
  }
  mesh->triangles = {{0, 1, 3}, {0, 3, 2}, {4, 7, 5}, {4, 6, 7}};
  rtbus::config::Scene scene = tests::floor_scene();
  scene.bodies[0] = tests::body("plate", rtbus::config::Mesh{mesh});
  scene.bodies.push_back(
      tests::body("cube", shapes::Box{Vector3d::Constant(0.5 * kEdge_m)}, {0.003, 0.5 * kEdge_m, 0.001}, kMass_kg));
  EXPECT_NEAR(pushed_to_m(scene, {0.1, 0, 0}, 500).y(), 0.5 * kEdge_m + 0.1e-3, 0.05e-3) << "on the skin of the mesh";
}

}  // namespace
}  // namespace face_contacts_test
