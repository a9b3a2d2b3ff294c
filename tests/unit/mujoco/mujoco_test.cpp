// The engine mujoco beside closed forms and beside Bullet: a block that is pushed, a box that tips, a push at a corner.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <memory>
#include <numbers>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "physics_node/mujoco/simulation.hpp"
#include "tests/unit/bullet/scenes.hpp"

namespace {

using rtbus::config::Scene;
using tests::Vector3d;

constexpr double kGravity_m_s2 = 9.81;

/// A constant push on body 1, at its centre of mass, and a torque.
struct Push {
  Vector3d force_n = Vector3d::Zero(), torque_n_m = Vector3d::Zero();
};

physics::BodyPose by_mujoco(const Scene& scene, const Push& push, double step_s, int steps) {
  mujoco::Simulation world(scene, {mujoco::ToolShape{0.005, 0.1}}, step_s, 0.01);
  rtbus_engine_hand hand{};
  hand.tool = RTBUS_TOOL_PLACED;
  hand.target_position_m[1] = 1.0;  // far from everything
  hand.pushes = 1;
  hand.push[0].body = 1;
  std::copy_n(push.force_n.data(), 3, hand.push[0].force_n);
  std::copy_n(push.torque_n_m.data(), 3, hand.push[0].torque_n_m);
  for (int i = 0; i < steps; ++i) {
    world.set_hand(0, hand);
    world.step();
  }
  const rtbus_engine_body body = world.body(1);
  const auto& q = body.orientation_wxyz;
  return {Vector3d(body.position_m[0], body.position_m[1], body.position_m[2]),
          Eigen::Quaterniond(q[0], q[1], q[2], q[3])};
}

physics::BodyPose by_bullet(const Scene& scene, const Push& push, double step_s, int steps) {
  const auto world = tests::bullet(scene);
  physics::ProxyParameters parameters;
  parameters.position_m = Vector3d(0, 1, 0);
  parameters.radius_m = 0.005;
  const std::size_t proxy = world->add_proxy(parameters);
  world->reset_proxy(proxy, parameters.position_m);
  constexpr int kParts = 10;  // 1 ms, as the engine mujoco takes
  for (int i = 0; i < steps * kParts; ++i) {
    world->place_proxy(proxy, parameters.position_m, Vector3d::Zero());
    world->apply_hand_force(proxy, 1, push.force_n, push.torque_n_m);
    world->step(step_s / kParts);
  }
  return world->body_pose(1);
}

Scene block_on_floor(const Vector3d& half_m, double mass_kg, double friction) {
  Scene scene = tests::floor_scene();
  scene.bodies.push_back(tests::body("block", rtbus::shapes::Box{half_m}, {0, half_m.y(), 0}, mass_kg));
  for (auto& body : scene.bodies) body.friction = friction;
  return scene;
}

double angle_about(const physics::BodyPose& pose, const Vector3d& axis) {
  const Eigen::AngleAxisd turned(pose.orientation);
  const double angle = std::remainder(turned.angle(), 2 * std::numbers::pi);
  return angle * turned.axis().dot(axis);
}

/// Distance covered in 0.2 s with 1 N on 0.5 kg, at 100 steps a second.
TEST(Mujoco, FreeBlockSlidesAsNewtonSays) {
  for (const double friction : {0.0, 0.3}) {
    const Scene scene = block_on_floor({0.03, 0.02, 0.02}, 0.5, friction);
    const Push push{Vector3d(0, 0, -1.0)};
    const double m = by_mujoco(scene, push, 0.01, 20).position_m.z(),
                 b = by_bullet(scene, push, 0.01, 20).position_m.z();
    const double truth = -0.5 * (1.0 / 0.5 - friction * friction * kGravity_m_s2) * 0.2 * 0.2;
    std::printf("friction %g: closed form %.3f mm, mujoco %.3f, bullet %.3f\n", friction, 1e3 * truth, 1e3 * m,
                1e3 * b);
    EXPECT_NEAR(m, truth, 0.02 * std::abs(truth));
    EXPECT_NEAR(m, b, 0.03 * std::abs(truth));
  }
}

/// A push at the top of a box: below m·g·w/(2h) it stands, above it turns about its lower edge.
TEST(Mujoco, BoxTipsWhereStaticsSaysAndAsFast) {
  const double w = 0.02, h = 0.04, mass_kg = 0.2;
  const Scene scene = block_on_floor({w, h, w}, mass_kg, 0.9);
  const double threshold_n = mass_kg * kGravity_m_s2 * w / (2 * h);
  const auto at_top = [&](double force_n) { return Push{Vector3d(0, 0, -force_n), Vector3d(-h * force_n, 0, 0)}; };
  const Vector3d axis = -Vector3d::UnitX();

  const double stands = angle_about(by_mujoco(scene, at_top(0.8 * threshold_n), 0.01, 50), axis);
  EXPECT_LT(std::abs(stands), 5e-3);  // its contacts are soft: 0.05 mm of 20 mm

  const double force_n = 1.5 * threshold_n;
  const double inertia = mass_kg * ((h * h + w * w) / 3.0 + h * h + w * w);
  double angle = 0.0, rate = 0.0;
  for (int i = 0; i < 10000; ++i) {
    const double height = h * std::cos(angle) + w * std::sin(angle), arm = w * std::cos(angle) - h * std::sin(angle);
    rate += 1e-5 * (force_n * (height + h) - mass_kg * kGravity_m_s2 * arm) / inertia;
    angle += 1e-5 * rate;
  }
  const double m = angle_about(by_mujoco(scene, at_top(force_n), 0.01, 10), axis);
  const double b = angle_about(by_bullet(scene, at_top(force_n), 0.01, 10), axis);
  std::printf("tipped after 0.1 s: closed form %.4f rad, mujoco %.4f, bullet %.4f\n", angle, m, b);
  EXPECT_NEAR(m, angle, 0.05 * angle);
  EXPECT_NEAR(m, b, 0.1 * angle);
}

/// A push at a corner: the block goes and turns by F·t/m and F·r·t/I.
TEST(Mujoco, PushAtACornerTurnsTheBlock) {
  const Vector3d half_m(0.03, 0.02, 0.02);
  const Scene scene = block_on_floor(half_m, 0.5, 0.0);
  const Push push{Vector3d(0, 0, -0.5), Vector3d(0, half_m.x() * 0.5, 0)};
  const double inertia = 0.5 * (half_m.x() * half_m.x() + half_m.z() * half_m.z()) / 3.0;
  const double turned = 0.5 * push.torque_n_m.y() / inertia * 0.1 * 0.1, gone_m = 0.5 * (0.5 / 0.5) * 0.1 * 0.1;
  const auto m = by_mujoco(scene, push, 0.01, 10), b = by_bullet(scene, push, 0.01, 10);
  std::printf("corner: closed form %.4f rad, %.3f mm; mujoco %.4f, %.3f; bullet %.4f, %.3f\n", turned, 1e3 * gone_m,
              angle_about(m, Vector3d::UnitY()), -1e3 * m.position_m.z(), angle_about(b, Vector3d::UnitY()),
              -1e3 * b.position_m.z());
  EXPECT_NEAR(angle_about(m, Vector3d::UnitY()), turned, 0.02 * turned);
  EXPECT_NEAR(-m.position_m.z(), gone_m, 0.02 * gone_m);
  EXPECT_NEAR(angle_about(m, Vector3d::UnitY()), angle_about(b, Vector3d::UnitY()), 0.03 * turned);
}

/// A block at rest stays where it is, and the answer tells its support whole.
TEST(Mujoco, BlockAtRestStaysAndIsCarried) {
  const Scene scene = block_on_floor({0.03, 0.02, 0.02}, 0.5, 0.5);
  mujoco::Simulation world(scene, {}, 0.01, 0.01);
  for (int i = 0; i < 300; ++i) world.step();
  const rtbus_engine_body body = world.body(1);
  EXPECT_NEAR(body.position_m[1], 0.02, 1e-4);  // contacts are soft
  EXPECT_NEAR(std::hypot(body.position_m[0], body.position_m[2]), 0.0, 1e-5);
  ASSERT_EQ(world.supports().size(), 1U);
  EXPECT_NEAR(world.supports()[0].force_n, 0.5 * kGravity_m_s2, 0.01 * 0.5 * kGravity_m_s2);
  EXPECT_EQ(world.supports()[0].points, 4U);
}

TEST(MujocoDeathTest, AnErrorEndsTheProcessAndWaitsForNoKey) {
  EXPECT_EXIT(mujoco::take_errors();
              mju_error("the stack is full"), testing::ExitedWithCode(1), "mujoco_engine: MuJoCo: the stack is full");
}

/// Viewers draw the scene's shapes at these poses: a capsule stands along y of its body.
TEST(Mujoco, TellsPosesInTheAxesOfTheScene) {
  Scene scene = tests::floor_scene();
  const Eigen::Quaterniond turned(Eigen::AngleAxisd(0.3, Vector3d(1, 2, 3).normalized()));
  scene.bodies.push_back(tests::body("rod", rtbus::config::Capsule{0.01, 0.1}, {0.1, 0.5, 0}, 0.2));
  scene.bodies.push_back(tests::body("post", rtbus::config::Cylinder{0.01, 0.1}, {0.4, 0.1, 0}));
  for (std::size_t i : {1U, 2U}) scene.bodies[i].q_WB = turned;
  const mujoco::Simulation world(scene, {}, 0.01, 0.01);
  for (std::uint32_t i : {1U, 2U}) {
    const rtbus_engine_body body = world.body(i);
    const auto& q = body.orientation_wxyz;
    EXPECT_LT(Eigen::Quaterniond(q[0], q[1], q[2], q[3]).angularDistance(turned), 1e-7) << i;
  }
  const auto& inertia = world.body(1).inertia_kg_m2;
  EXPECT_LT(inertia[1], 0.1 * inertia[0]);  // slender along y
  EXPECT_NEAR(inertia[0], inertia[2], 1e-12);
}

/// In free air the tool is where the hand is, at rest and in motion, whatever the parts of a step.
TEST(Mujoco, ToolFollowsAHandInFreeAir) {
  for (const double step_s : {0.001, 0.01}) {
    mujoco::Simulation world(tests::floor_scene(), {mujoco::ToolShape{0.01, 0.1}}, step_s, 0.01);
    rtbus_engine_hand hand{};
    hand.tool = RTBUS_TOOL_SPRING;
    hand.stiffness_n_per_m = 200.0;
    hand.damping_n_s_per_m = 4.4;
    hand.target_position_m[1] = 0.1;
    hand.target_velocity_m_s[0] = 0.1;
    hand.reset = 1;
    for (int i = 1; i <= std::lround(1.0 / step_s); ++i) {
      hand.target_position_m[0] = 0.1 * step_s * i;
      world.set_hand(0, hand);
      hand.reset = 0;
      world.step();
    }
    EXPECT_NEAR(world.tool(0).position_m[0], 0.1, 1e-6) << step_s;
    EXPECT_NEAR(world.tool(0).position_m[1], 0.1, 1e-6) << step_s;
    EXPECT_NEAR(world.tool(0).velocity_m_s[0], 0.1, 1e-6) << step_s;
  }
}

/// A hand that jumps a metre in a step, at any stiffness: nothing gets faster than it could.
TEST(Mujoco, BearsTargetsThatNoHandHas) {
  Scene scene = tests::floor_scene();
  scene.bodies.push_back(tests::body("ball", rtbus::shapes::Sphere{0.05}, {0.1, 0.05, 0}));
  scene.bodies.push_back(tests::body("block", rtbus::shapes::Box{Vector3d::Constant(0.05)}, {-0.1, 0.05, 0}));
  mujoco::Simulation world(scene, {mujoco::ToolShape{0.01, 0.1}}, 0.001, 0.01);
  rtbus_engine_hand hand{};
  hand.tool = RTBUS_TOOL_SPRING;
  hand.friction = 0.8;
  for (const double stiffness : {10.0, 200.0, 2000.0, 20000.0}) {
    hand.stiffness_n_per_m = stiffness;
    hand.damping_n_s_per_m = 4.4 * std::sqrt(stiffness / 200.0);
    for (int i = 0; i < 200; ++i) {
      hand.reset = i == 0 ? 1 : 0;
      hand.target_position_m[0] = i == 0 ? 0.0 : 0.02;
      hand.target_position_m[1] = i == 0 ? 0.05 : 0.005;
      world.set_hand(0, hand);
      world.step();
      const auto& v = world.tool(0).velocity_m_s;
      ASSERT_LT(std::hypot(v[0], v[1], v[2]), 100.0) << stiffness << ' ' << i;
    }
  }
  for (const double p : {0.0, 1e-300, -1.0, 1.0}) {
    for (const double stiffness : {1e-3, 2e5}) {
      hand.stiffness_n_per_m = stiffness;
      hand.damping_n_s_per_m = 4.4 * std::sqrt(stiffness / 200.0);
      for (int i = 0; i < 3; ++i) {
        for (int axis = 0; axis < 3; ++axis) {
          hand.target_position_m[axis] = axis == 1 ? -p : p;
          hand.target_velocity_m_s[axis] = axis == 0 ? -p : p;
        }
        world.set_hand(0, hand);
        world.step();
        const auto& v = world.tool(0).velocity_m_s;
        EXPECT_LT(std::hypot(v[0], v[1], v[2]), 3000.0)
            << p << ' ' << stiffness << ' ' << i << ": " << v[0] << ' ' << v[1] << ' ' << v[2];
      }
    }
  }
}

std::string refusal(const Scene& scene) {
  try {
    (void)mujoco::mjcf_of(scene, {}, 0.001, 0.01);
  } catch (const rtbus::config::Error& error) {
    return error.what();
  }
  return "";
}

TEST(Mujoco, RefusesByNameWhatItCannotDo) {
  const Scene fine = block_on_floor({0.03, 0.02, 0.02}, 0.5, 0.5);
  EXPECT_EQ(refusal(fine), "");
  Scene scene = fine;
  scene.bodies[1].restitution = 0.5;
  EXPECT_THAT(refusal(scene), testing::HasSubstr("(block) has a restitution, which the engine mujoco cannot do"));
  scene = fine;
  scene.bodies[1].type = rtbus::config::BodyType::kKinematic;
  EXPECT_THAT(refusal(scene), testing::HasSubstr("(block) moves by itself, which"));
  scene = fine;
  scene.bodies[1].shape = rtbus::config::Mesh{std::make_shared<rtbus::config::TriangleMesh>()};
  EXPECT_THAT(refusal(scene), testing::HasSubstr("(block) is a mesh that may be concave, which"));
  scene = fine;
  scene.bodies[1].shape = rtbus::shapes::Plane{};
  EXPECT_THAT(refusal(scene), testing::HasSubstr("(block) is a plane that moves, which"));
  scene = fine;
  scene.soft_bodies.emplace_back().name = "jelly";
  EXPECT_THAT(refusal(scene), testing::HasSubstr("jelly is soft, which the engine mujoco cannot do"));
}

}  // namespace
