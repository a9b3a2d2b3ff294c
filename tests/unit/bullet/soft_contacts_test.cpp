/// What the engine says of soft bodies to a method that moves the proxy by itself, and what it does with its pushes.
#include <gtest/gtest.h>

#include <cmath>
#include <memory>
#include <vector>

#include "rtbus/config/closed_surface.hpp"
#include "tests/unit/bullet/scenes.hpp"

namespace tests {
namespace {

using physics::BodyKind;
using physics::ContactSet;
using physics::World;
using rtbus::config::Scene;

constexpr double kStep_s = 1e-3, kRadius_m = 0.04, kMargin_m = 0.001, kTool_m = 0.01, kMass_kg = 0.1;

/// A ball of 80 mm on the floor, or alone in space.
Scene soft_ball(bool on_floor) {
  Scene scene;
  if (on_floor) {
    scene = floor_scene();
  } else {
    scene.file = "test.yaml";
    scene.gravity_m_s2.setZero();
  }
  rtbus::config::SoftBody body;
  body.name = "ball";
  body.mesh = std::make_shared<const rtbus::config::TriangleMesh>(rtbus::config::make_ball(200, kRadius_m));
  body.closed = true;
  body.p_WB = Vector3d(0, kRadius_m + kMargin_m, 0);
  body.mass_kg = kMass_kg;
  body.pose_matching_hz = 20.0;
  body.bulk_modulus_pa = 5000.0;
  body.damping_per_s = 4.0;
  scene.soft_bodies.push_back(body);
  return scene;
}

std::unique_ptr<World> with_placed_tool(const Scene& scene, const Vector3d& at_m) {
  auto world = bullet(scene);
  physics::ProxyParameters tool;
  tool.device = "haptic0";
  tool.radius_m = kTool_m;
  tool.friction = 0.5;
  tool.position_m = at_m;
  world->add_proxy(tool);
  world->place_proxy(0, at_m, Vector3d::Zero());
  return world;
}

Vector3d middle_of(const World& world) {
  Vector3d sum = Vector3d::Zero();
  for (std::size_t i = 0; i < world.soft_nodes(); ++i) sum += world.soft_node(i);
  return sum / static_cast<double>(world.soft_nodes());
}

TEST(SoftContacts, NameTheSoftBodyAfterTheRigidOnes) {
  const double above_m = 2 * kRadius_m + 2 * kMargin_m + kTool_m + 0.002;
  const auto world = with_placed_tool(soft_ball(true), Vector3d(0, above_m, 0));
  world->step(kStep_s);
  ContactSet set;
  world->contacts(0, 0.2, set);
  ASSERT_EQ(set.contacts.size(), 2U);
  EXPECT_EQ(set.bodies[0].kind, BodyKind::kStatic);
  EXPECT_EQ(set.bodies[1].kind, BodyKind::kSoft);
  EXPECT_EQ(set.bodies[1].body, world->bodies());
  const physics::Contact& contact = set.contacts[1];
  EXPECT_EQ(contact.row, 1U);
  EXPECT_GT(contact.normal.y(), 0.99);
  // Means over a patch lie a little below the ball's top: by its width squared over eight radii.
  EXPECT_NEAR(contact.gap_m, 0.002, 0.0015);
  EXPECT_GT(contact.compliance_m_per_n, 0.0);
  EXPECT_DOUBLE_EQ(contact.friction, 0.25);
  world->contacts(0, 0.0005, set);
  EXPECT_TRUE(set.contacts.empty());
}

TEST(SoftContacts, AskingChangesNothing) {
  const Vector3d at(0.01, 2 * kRadius_m + kMargin_m + kTool_m, 0);
  const auto asked = with_placed_tool(soft_ball(true), at), left = with_placed_tool(soft_ball(true), at);
  ContactSet set;
  for (int i = 0; i < 300; ++i) {
    for (World* world : {asked.get(), left.get()}) {
      world->apply_hand_force(0, world->bodies(), Vector3d(0, -0.3, 0), Vector3d::Zero());
      world->step(kStep_s);
    }
    asked->contacts(0, 0.05, set);
  }
  for (std::size_t i = 0; i < asked->soft_nodes(); ++i) ASSERT_EQ(asked->soft_node(i), left->soft_node(i));
}

TEST(SoftContacts, WhatAHandFeelsMovesTheBody) {
  const auto world = with_placed_tool(soft_ball(false), Vector3d(0, 2 * kRadius_m + kMargin_m + kTool_m, 0));
  world->step(kStep_s);
  const Vector3d before_m = middle_of(*world);
  const Vector3d force_n(0.02, -0.05, 0);
  constexpr int kSteps = 40;
  for (int i = 0; i < kSteps; ++i) {
    world->apply_hand_force(0, world->bodies(), force_n, Vector3d::Zero());
    world->step(kStep_s);
  }
  const double time_s = kSteps * kStep_s;
  // Damped at 4 1/s: a little less than half F·t²/m.
  const Vector3d due_m = 0.5 * time_s * time_s / kMass_kg * force_n;
  EXPECT_LT((middle_of(*world) - before_m - due_m).norm(), 0.1 * due_m.norm());
}

/// The probe's figure beside what the body itself does under more load.
TEST(SoftContacts, ComplianceIsWhatTheBodyGivesWay) {
  const Vector3d at(0, 2 * kRadius_m + kMargin_m + kTool_m, 0);
  const auto world = with_placed_tool(soft_ball(true), at);
  ContactSet set;
  const auto press = [&](double force_n, double duration_s) {
    double depth_m = 0.0;
    int count = 0;
    const int steps = static_cast<int>(duration_s / kStep_s);
    for (int i = 0; i < steps; ++i) {
      world->apply_hand_force(0, world->bodies(), Vector3d(0, -force_n, 0), Vector3d::Zero());
      world->step(kStep_s);
      if (i < steps / 2) continue;
      world->contacts(0, 0.05, set);
      depth_m += set.contacts.at(0).gap_m;
      ++count;
    }
    return depth_m / count;
  };
  press(0.3, 1.0);
  const double before_m = press(0.3, 0.5);
  const double compliance = set.contacts.at(0).compliance_m_per_n;
  const double deeper_m = press(0.35, 0.1) - before_m;
  EXPECT_GT(compliance, 1e-3);
  EXPECT_NEAR(compliance, deeper_m / 0.05, 0.3 * compliance);
  EXPECT_EQ(world->recoveries(), 0U);
}

}  // namespace
}  // namespace tests
