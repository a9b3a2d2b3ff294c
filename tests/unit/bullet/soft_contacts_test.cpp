/// What the engine says of soft bodies to a method that moves the proxy by itself, and what its tool does to them.
#include <gtest/gtest.h>

#include <cmath>
#include <memory>
#include <numbers>
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
constexpr double kAbove_m = 2 * kRadius_m + 2 * kMargin_m + kTool_m + 0.01;

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

std::unique_ptr<World> with_placed_tool(const Scene& scene, const Vector3d& at_m, double tick_s = 0.0) {
  auto world = bullet(scene);
  physics::ProxyParameters tool;
  tool.device = "haptic0";
  tool.radius_m = kTool_m;
  tool.friction = 0.5;
  tool.position_m = at_m;
  tool.tick_s = tick_s;
  world->add_proxy(tool);
  world->place_proxy(0, at_m, Vector3d::Zero());
  return world;
}

constexpr double kSpring_n_per_m = 300.0;

physics::ProxyTarget target_at(const Vector3d& at_m, const Vector3d& push_n = Vector3d::Zero()) {
  physics::ProxyTarget out;
  out.position_m = out.hand_m = at_m;
  out.stiffness_n_per_m = kSpring_n_per_m;
  out.damping_n_s_per_m = 3.0;
  out.force_n = push_n;
  return out;
}

/// Steps with the tool on its spring to `at_m`. @returns its mean reaction over the second half.
Vector3d press(World& world, const Vector3d& at_m, double duration_s, const Vector3d& push_n = Vector3d::Zero(),
               const Vector3d& velocity_m_s = Vector3d::Zero()) {
  const int steps = static_cast<int>(std::lround(duration_s / kStep_s));
  Vector3d sum_n = Vector3d::Zero();
  for (int i = 0; i < steps; ++i) {
    world.place_proxy(0, at_m, Vector3d::Zero());
    physics::ProxyTarget target = target_at(at_m, push_n);
    target.velocity_m_s = velocity_m_s;
    world.drive_tool(0, target);
    world.step(kStep_s);
    if (i >= steps / 2) sum_n += world.proxy(0).contact_force_n;
  }
  return sum_n / (steps - steps / 2);
}

/// The body has come to rest under its weight. @returns where a tool above it touches.
double settle(World& world, double above_m) {
  press(world, Vector3d(0, above_m, 0), 2.0);
  ContactSet set;
  world.contacts(0, 0.1, set);
  return above_m - set.contacts.back().gap_m;
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
  EXPECT_GT(contact.normal.y(), 0.8);
  EXPECT_NEAR(contact.gap_m, 0.002, 0.0015);
  EXPECT_DOUBLE_EQ(contact.friction, 0.25);
  world->contacts(0, 0.0005, set);
  EXPECT_TRUE(set.contacts.empty());
}

TEST(SoftContacts, AskingChangesNothing) {
  const Vector3d at(0.01, 2 * kRadius_m + kMargin_m + kTool_m - 0.003, 0);
  const auto asked = with_placed_tool(soft_ball(true), at), left = with_placed_tool(soft_ball(true), at);
  ContactSet set;
  physics::ToolReaction reaction;
  for (int i = 0; i < 100; ++i) {
    for (World* world : {asked.get(), left.get()}) press(*world, at, kStep_s);
    asked->contacts(0, 0.05, set);
    asked->tool_reaction(0, 0.05, 0.03, Vector3d(0, -0.01, 0), reaction);
  }
  ASSERT_EQ(reaction.count, 3U);
  for (std::size_t i = 0; i < asked->soft_nodes(); ++i) ASSERT_EQ(asked->soft_node(i), left->soft_node(i));
}

TEST(SoftContacts, WhatPushesTheToolMovesTheBody) {
  const Vector3d at(0, 2 * kRadius_m + 2 * kMargin_m + kTool_m, 0);
  const auto world = with_placed_tool(soft_ball(false), at);
  press(*world, at, kStep_s);
  const Vector3d before_m = middle_of(*world);
  const Vector3d push_n(0.0, -1.0, 0);
  Vector3d given_n_s = Vector3d::Zero();
  constexpr int kSteps = 100;
  for (int i = 0; i < kSteps; ++i) {
    press(*world, at, kStep_s, push_n);
    given_n_s -= kStep_s * world->proxy(0).contact_force_n;
    // Without mass: what it is pushed with is what it pushes with.
    ASSERT_LT((world->proxy(0).contact_force_n + world->proxy(0).coupling_force_n).norm(), 1e-3);
  }
  EXPECT_LT(given_n_s.y(), -1e-3);
  EXPECT_LT(middle_of(*world).y(), before_m.y());
}

// Newton's third law to the end: what the hand felt last arrives when the tool has left.
TEST(SoftContacts, WhatIsOwedReachesTheBodyThoughTheToolHasLeft) {
  const Vector3d touching_m(0, 2 * (kRadius_m + kMargin_m) + kTool_m - 1e-3, 0), away_m(0, kAbove_m, 0);
  const Vector3d owed_n(0.05, -0.1, 0.0);
  constexpr int kOwedSteps = 20;
  const auto velocity_after = [&](const Vector3d& owed) {
    const auto world = with_placed_tool(soft_ball(false), touching_m);
    press(*world, touching_m, 0.02);
    press(*world, away_m, 0.05);
    Vector3d before_m = Vector3d::Zero();
    for (int i = 0; i < kOwedSteps; ++i) {
      world->place_proxy(0, away_m, Vector3d::Zero());
      physics::ProxyTarget target = target_at(away_m);
      target.owed_n = owed;
      world->drive_tool(0, target);
      before_m = middle_of(*world);
      world->step(kStep_s);
      EXPECT_LT((world->proxy(0).contact_force_n + owed).norm(), 1e-9) << "what the bodies got is told";
    }
    return Vector3d((middle_of(*world) - before_m) / kStep_s);
  };
  const Vector3d gained_n_s = kMass_kg * (velocity_after(owed_n) - velocity_after(Vector3d::Zero()));
  const Vector3d given_n_s = kOwedSteps * kStep_s * owed_n;
  EXPECT_LT((gained_n_s - given_n_s).norm(), 0.1 * given_n_s.norm()) << gained_n_s.transpose();
}

// Long after, or with a tool that is new, what is owed is no longer the body's.
TEST(SoftContacts, NothingOfWhatIsOwedReachesABodyThatTheToolDidNotTouchOfLate) {
  const Vector3d touching_m(0, 2 * (kRadius_m + kMargin_m) + kTool_m - 1e-3, 0), away_m(0, kAbove_m, 0);
  for (const bool anew : {false, true}) {
    const auto nodes_after = [&](const Vector3d& owed_n) {
      const auto world = with_placed_tool(soft_ball(false), touching_m);
      press(*world, touching_m, 0.02);
      press(*world, away_m, anew ? 0.05 : 1.0);
      if (anew) world->reset_proxy(0, away_m);
      for (int i = 0; i < 100; ++i) {
        world->place_proxy(0, away_m, Vector3d::Zero());
        physics::ProxyTarget target = target_at(away_m);
        target.owed_n = owed_n;
        world->drive_tool(0, target);
        world->step(kStep_s);
      }
      return middle_of(*world);
    };
    EXPECT_EQ(nodes_after(Vector3d(0.05, 0.1, 0)), nodes_after(Vector3d::Zero()))
        << (anew ? "a new tool" : "long after");
  }
}

TEST(SoftContacts, SayThatTheWorldIsAtRestAndWhenItNoLongerIs) {
  const auto world = with_placed_tool(soft_ball(true), Vector3d(0, kAbove_m, 0));
  const double touches_m = settle(*world, kAbove_m);
  const auto rest = [&] {
    physics::ToolReaction reaction;
    world->tool_reaction(0, 0.1, 0.02, Vector3d::Zero(), reaction);
    return reaction.rest;
  };
  press(*world, Vector3d(0, touches_m - 2e-3, 0), 1.2);
  EXPECT_EQ(rest(), 1.0);
  physics::ProxyTarget target = target_at(Vector3d(0, touches_m - 2e-3, 0));
  target.hand_m.y() -= 1.1e-3;
  world->drive_tool(0, target);
  world->step(kStep_s);
  EXPECT_EQ(rest(), 0.0);
}

TEST(SoftContacts, ARigidBodyThatMovesIsNoRest) {
  Scene scene = soft_ball(true);
  scene.bodies.push_back(body("box", rtbus::shapes::Box{Vector3d::Constant(0.01)}, Vector3d(1, 0.5, 0), 0.02));
  const auto world = with_placed_tool(scene, Vector3d(0, kAbove_m, 0));
  const auto rest = [&] {
    physics::ToolReaction reaction;
    world->tool_reaction(0, 0.1, 0.02, Vector3d::Zero(), reaction);
    return reaction.rest;
  };
  press(*world, Vector3d(0, kAbove_m - 0.03, 0), 0.3);
  EXPECT_EQ(rest(), 0.0) << "it falls";
  press(*world, Vector3d(0, kAbove_m - 0.03, 0), 2.0);
  EXPECT_EQ(rest(), 1.0) << "it lies";
}

// What yields may rattle: that is what the mean is for. 20 mg are light for a tool of 300 N/m at 1 kHz, and where there
// are more such bodies than are told together, they yield.
TEST(SoftContacts, ALightBodyThatMovesIsRestAndAHeavyOneIsNot) {
  const auto rest = [](double mass_kg) {
    Scene scene;
    scene.file = "test.yaml";
    scene.gravity_m_s2 = Vector3d(0, -0.02, 0);
    for (std::size_t i = 0; i <= physics::kMostTogether; ++i) {
      scene.bodies.push_back(body("chaff" + std::to_string(i), rtbus::shapes::Box{Vector3d::Constant(0.01)},
                                  Vector3d(0.1, 0, 0.1 * static_cast<double>(i)), 20e-6));
    }
    scene.bodies.push_back(body("box", rtbus::shapes::Box{Vector3d::Constant(0.01)}, Vector3d(0.2, 0, 0), mass_kg));
    const auto world = with_placed_tool(scene, Vector3d(0, kAbove_m, 0), 1e-3);
    press(*world, Vector3d(0, kAbove_m, 0), 1.5);
    EXPECT_LT(world->body_pose(0).position_m.y(), -10e-3) << "it falls";
    physics::ToolReaction reaction;
    world->tool_reaction(0, 1.0, 0.02, Vector3d::Zero(), reaction);
    EXPECT_GT(reaction.count, 0U);
    return reaction.rest;
  };
  EXPECT_EQ(rest(20e-6), 1.0);
  EXPECT_EQ(rest(0.02), 0.0);
}

// So few as are told together are free bodies, however light.
TEST(SoftContacts, AFewLightBodiesDoNotYield) {
  for (const std::size_t bodies : {physics::kMostTogether, physics::kMostTogether + 1}) {
    Scene scene;
    scene.file = "test.yaml";
    for (std::size_t i = 0; i < bodies; ++i) {
      scene.bodies.push_back(body("chaff" + std::to_string(i), rtbus::shapes::Box{Vector3d::Constant(0.01)},
                                  Vector3d(0, 0, 0.1 * static_cast<double>(i)), 20e-6));
    }
    const auto world = with_placed_tool(scene, Vector3d(0, 0.02, 0), 1e-3);
    press(*world, Vector3d(0, 0.02, 0), 0.01);
    physics::ToolReaction reaction;
    world->tool_reaction(0, 1.0, 0.02, Vector3d::Zero(), reaction);
    EXPECT_EQ(reaction.count > 0, bodies > physics::kMostTogether) << bodies;
  }
}

TEST(SoftContacts, ABodyThatMovesByItselfIsNoRestEvenWhereItTurnsInItsPlace) {
  const auto rest = [](const rtbus::config::BodyMotion& motion) {
    Scene scene = soft_ball(true);
    scene.bodies.push_back(body("plate", rtbus::shapes::Box{Vector3d(0.05, 0.005, 0.05)}, Vector3d(1, 0.1, 0)));
    scene.bodies.back().type = rtbus::config::BodyType::kKinematic;
    scene.bodies.back().motion = motion;
    const auto world = with_placed_tool(scene, Vector3d(0, kAbove_m, 0));
    press(*world, Vector3d(0, kAbove_m - 0.03, 0), 2.5);
    physics::ToolReaction reaction;
    world->tool_reaction(0, 0.1, 0.02, Vector3d::Zero(), reaction);
    EXPECT_GT(reaction.count, 0U);
    return reaction.rest;
  };
  EXPECT_EQ(rest(rtbus::config::SinusoidMotion{Vector3d::Zero(), 1.0, 0.0}), 1.0);
  EXPECT_EQ(rest(rtbus::config::SinusoidMotion{Vector3d(0, 0.01, 0), 1.0, 0.0}), 0.0);
  EXPECT_EQ(rest(rtbus::config::SpinMotion{Vector3d::UnitY(), 1.0, 0.1, 0.0}), 0.0);
}

// The proxy swings and the hand holds still: spring and push are a spring from the hand. A debt, which comes late,
// moves the tool of a hand that moves.
TEST(SoftContacts, ADebtDoesNotMoveTheToolOfAHandAtRest) {
  const auto swings_m = [](double hand_swings_m) {
    const auto world = with_placed_tool(soft_ball(true), Vector3d(0, kAbove_m, 0));
    const Vector3d goal_m(0, settle(*world, kAbove_m) - 0.006, 0);
    press(*world, goal_m, 2.0);
    double least_m = kAbove_m, most_m = -kAbove_m;
    for (int step = 0; step < 600; ++step) {
      const double phase_rad = 2.0 * std::numbers::pi * 5.0 * step * kStep_s;
      const Vector3d swing = Vector3d::UnitY() * std::sin(phase_rad);
      physics::ProxyTarget target = target_at(goal_m + 1e-3 * swing, -1e-3 * kSpring_n_per_m * swing);
      target.owed_n = 0.1 * swing;
      target.hand_m = goal_m + hand_swings_m * swing;
      world->place_proxy(0, target.position_m, Vector3d::Zero());
      world->drive_tool(0, target);
      world->step(kStep_s);
      physics::ToolReaction told;
      world->tool_reaction(0, 0.05, 0.0, Vector3d::Zero(), told);
      least_m = std::min(least_m, told.instants[0].tool_m.y());
      most_m = std::max(most_m, told.instants[0].tool_m.y());
    }
    return most_m - least_m;
  };
  const double rests_m = swings_m(0.0), moves_m = swings_m(5e-3);
  EXPECT_GT(moves_m, 0.2e-3);
  EXPECT_LT(rests_m, 0.02 * moves_m);
}

TEST(SoftContacts, TellWhatTheToolBearsAtRest) {
  const auto world = with_placed_tool(soft_ball(true), Vector3d(0, kAbove_m, 0));
  const Vector3d at(0, settle(*world, kAbove_m) - 0.006, 0);
  press(*world, at, 2.0);
  const Vector3d bears_n = press(*world, at, 0.2);
  physics::ToolReaction told;
  world->tool_reaction(0, 0.05, 0.1, Vector3d::Zero(), told);
  ASSERT_EQ(told.count, 3U);
  EXPECT_GT(bears_n.y(), 0.05);
  for (std::size_t i = 0; i < told.count; ++i) {
    EXPECT_LT((told.instants[i].reaction_n - bears_n).norm(), 0.02 * bears_n.norm()) << i;
    EXPECT_EQ(told.instants[i].gap_m, 0.0);
  }
  // Its spring is stretched by that force.
  EXPECT_NEAR(told.instants[0].tool_m.y() - at.y(), bears_n.y() / kSpring_n_per_m, 2e-4);
}

/// What is told ahead beside what the world then does; and the stiffness beside another place of the tool.
TEST(SoftContacts, ForetellWhatTheToolWillBear) {
  const auto world = with_placed_tool(soft_ball(true), Vector3d(0, kAbove_m, 0));
  const Vector3d at(0, settle(*world, kAbove_m) - 0.004, 0);
  press(*world, at, 1.0);
  constexpr double kAhead_s = 0.1;
  const Vector3d velocity_m_s(0, -0.02, 0);
  physics::ToolReaction told;
  world->tool_reaction(0, 0.05, kAhead_s, velocity_m_s, told);
  ASSERT_EQ(told.count, 3U);
  Vector3d reaction_n = Vector3d::Zero();
  const double half_s = 0.5 * told.instants[1].after_s;
  int count = 0;
  for (double t = kStep_s; t <= told.instants[1].after_s + half_s; t += kStep_s) {
    press(*world, at + t * velocity_m_s, kStep_s, Vector3d::Zero(), velocity_m_s);
    if (t < half_s) continue;
    reaction_n += world->proxy(0).contact_force_n;
    ++count;
  }
  reaction_n /= count;
  EXPECT_LT((told.instants[1].reaction_n - reaction_n).norm(), 0.03 * reaction_n.norm())
      << told.instants[1].reaction_n.transpose() << " told, " << reaction_n.transpose();
  EXPECT_GT(told.stiffness_n_per_m, 10.0);
  EXPECT_LT(told.stiffness_n_per_m, 300.0);
  EXPECT_EQ(world->recoveries(), 0U);
}

TEST(SoftContacts, TellAGapBeforeTheTouch) {
  const auto world = with_placed_tool(soft_ball(true), Vector3d(0, kAbove_m, 0));
  press(*world, Vector3d(0, settle(*world, kAbove_m) + 0.003, 0), 0.1);
  physics::ToolReaction told;
  world->tool_reaction(0, 0.05, 0.1, Vector3d(0, -0.1, 0), told);
  ASSERT_EQ(told.count, 3U);
  EXPECT_NEAR(told.instants[0].gap_m, 0.003, 0.0003);
  EXPECT_TRUE(told.instants[0].reaction_n.isZero(0.0));
  EXPECT_GT(told.instants[0].normal.y(), 0.8);
  EXPECT_EQ(told.instants[2].gap_m, 0.0);
  EXPECT_GT(told.instants[2].reaction_n.y(), 0.1) << "6 mm further on it presses";
  world->tool_reaction(0, 0.0005, 0.0, Vector3d::Zero(), told);
  EXPECT_EQ(told.count, 0U);
}

}  // namespace
}  // namespace tests
