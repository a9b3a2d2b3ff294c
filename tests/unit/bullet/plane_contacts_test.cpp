/// How bodies of the engine bullet slide on a plane: without rocking, since all that touches is found in each step.
#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <memory>

#include "tests/unit/bullet/scenes.hpp"

namespace plane_contacts_test {
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

struct Slide {
  const char* what;
  rtbus::config::BodyShape shape;
  double height_m;
  Eigen::Quaterniond q_WB = Eigen::Quaterniond::Identity();
};

/// Pushed at its centre along the plane by 1.5 times its bound. @returns how far its axes tilt at most [rad].
double tilts_rad(const Slide& each) {
  rtbus::config::Scene scene = tests::floor_scene();
  scene.bodies.push_back(tests::body("body", each.shape, {0, each.height_m, 0}, kMass_kg));
  scene.bodies.back().q_WB = each.q_WB;
  const auto world = tests::bullet(scene);
  const std::size_t proxy = world->add_proxy({"haptic0", 0.1, 0.005, 0.0, {0, 0.5, 0}});
  world->place_proxy(proxy, {0, 0.5, 0}, Vector3d::Zero());
  for (int i = 0; i < 200; ++i) world->step(kTick_s);
  const physics::BodyPose before = world->body_pose(1);
  const Vector3d up_B = before.orientation.conjugate() * Vector3d(Vector3d::UnitY());
  double most_rad = 0.0;
  for (int i = 0; i < 300; ++i) {
    world->apply_hand_force(proxy, 1, Vector3d(0.6, 0, 0.8) * 1.5 * kFriction * kFriction * kMass_kg * 9.81,
                            Vector3d::Zero());
    world->step(kTick_s);
    most_rad = std::max(most_rad, (world->body_pose(1).orientation * up_B).cross(Vector3d::UnitY()).norm());
  }
  EXPECT_GT((world->body_pose(1).position_m - before.position_m).norm(), 0.02) << each.what << " slides";
  return most_rad;
}

// With one point found in a step what slides lost corners, and tilted by up to some milliradians.
TEST(BulletPlaneContacts, WhatSlidesDoesNotRock) {
  const Eigen::Quaterniond lies(Eigen::AngleAxisd(std::acos(0.0), Vector3d::UnitX()));
  for (const Slide& each : {Slide{"box", shapes::Box{Vector3d(0.03, 0.01, 0.02)}, 0.01}, Slide{"wedge", wedge(), 0.0},
                            Slide{"cylinder", rtbus::config::Cylinder{0.03, 0.02}, 0.01}}) {
    const double rad = tilts_rad(each);
    std::printf("%s tilts by %.2g rad\n", each.what, rad);
    EXPECT_LE(rad, 1e-6) << each.what;
  }
  for (const Slide& each : {Slide{"lying cylinder", rtbus::config::Cylinder{0.01, 0.05}, 0.01, lies},
                            Slide{"lying capsule", rtbus::config::Capsule{0.01, 0.05}, 0.01, lies}}) {
    rtbus::config::Scene scene = tests::floor_scene();
    scene.bodies.push_back(tests::body("roller", each.shape, {0, each.height_m, 0}, kMass_kg));
    scene.bodies.back().q_WB = each.q_WB;
    const auto world = tests::bullet(scene);
    const std::size_t proxy = world->add_proxy({"haptic0", 0.1, 0.005, 0.0, {0, 0.5, 0}});
    world->place_proxy(proxy, {0, 0.5, 0}, Vector3d::Zero());
    double most_rad = 0.0;
    for (int i = 0; i < 500; ++i) {
      world->apply_hand_force(proxy, 1, Vector3d(i < 200 ? 0.0 : 0.3, 0, 0), Vector3d::Zero());
      world->step(kTick_s);
      const Vector3d axis = world->body_pose(1).orientation * Vector3d(Vector3d::UnitY());
      if (i >= 200) most_rad = std::max(most_rad, std::abs(axis.y()));
    }
    std::printf("%s tilts by %.2g rad\n", each.what, most_rad);
    EXPECT_GT(world->body_pose(1).position_m.x(), 0.02) << each.what << " rolls";
    EXPECT_LE(most_rad, 1e-6) << each.what;
  }
}

}  // namespace
}  // namespace plane_contacts_test
