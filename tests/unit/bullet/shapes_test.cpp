/// Every shape falls onto a floor and must lie there as high as geometry says.
#include <gtest/gtest.h>

#include <cstdio>

#include "tests/support/temporary_file.hpp"
#include "tests/unit/bullet/scenes.hpp"

namespace {

using rtbus::config::Body;
using rtbus::config::Scene;
using tests::bullet;
using tests::Vector3d;

Scene read(const tests::TemporaryFolder& folder, const std::string& bodies) {
  auto map =
      rtbus::config::load(folder.write("scene.yaml",
                                       "schema: scene/1\nbodies:\n  - {name: floor, type: static, shape: {plane: {}}, "
                                       "friction: 0.6}\n" +
                                           bodies));
  return rtbus::config::read_scene(map);
}

physics::BodyPose drop(const Scene& scene, std::size_t body, double seconds = 3.0) {
  const auto world = bullet(scene);
  for (int i = 0; i < static_cast<int>(seconds * 2000); ++i) world->step(0.5e-3);
  EXPECT_EQ(world->awake_bodies(), 0U);
  return world->body_pose(body);
}

TEST(BulletShapes, RestAtTheirOwnHeight) {
  struct Row {
    rtbus::config::BodyShape shape;
    double height_m;
  };
  const Row rows[] = {{rtbus::shapes::Box{{0.02, 0.01, 0.03}}, 0.01},
                      {rtbus::shapes::Sphere{0.012}, 0.012},
                      {rtbus::config::Cylinder{0.015, 0.03}, 0.015}};
  for (const Row& row : rows) {
    Scene scene = tests::floor_scene();
    scene.bodies.push_back(tests::body("body", row.shape, {0, row.height_m + 0.01, 0}, 0.05));
    EXPECT_NEAR(drop(scene, 1).position_m.y(), row.height_m, 0.1e-3) << name_of(row.shape);
  }
}

TEST(BulletShapes, LaysACapsuleOnItsSide) {
  Scene scene = tests::floor_scene();
  scene.bodies.push_back(tests::body("pill", rtbus::config::Capsule{0.008, 0.04}, {0, 0.02, 0}, 0.02));
  scene.bodies[1].q_WB = Eigen::Quaterniond(Eigen::AngleAxisd(1.5, Vector3d::UnitZ()));
  scene.bodies[1].angular_damping_per_s = 5.0;
  EXPECT_NEAR(drop(scene, 1).position_m.y(), 0.008, 0.1e-3);
}

// A wedge turns about its centre of mass, a third of the way in, while its pose is told for the file's origin.
TEST(BulletShapes, TurnsAHullAboutItsCentreOfMass) {
  const tests::TemporaryFolder folder;
  folder.write("wedge.obj", "v 0 0 -15\nv 40 0 -15\nv 0 20 -15\nv 0 0 15\nv 40 0 15\nv 0 20 15\n");
  const Scene lying = read(folder,
                           "  - {name: gem, type: dynamic, mass_kg: 0.03, friction: 0.6, position_m: [0.1, 0.002, "
                           "0.2], shape: {convex_hull: {file: wedge.obj, metres_per_unit: 0.001}}}\n");
  const physics::BodyPose pose = drop(lying, 1);
  EXPECT_NEAR(pose.position_m.x(), 0.1, 0.3e-3);
  EXPECT_NEAR(pose.position_m.y(), 0.0, 0.2e-3);
  EXPECT_NEAR(pose.position_m.z(), 0.2, 0.3e-3);
  EXPECT_GT(std::abs(pose.orientation.w()), 0.9999);

  // In free fall the centre of mass, (40/3, 20/3, 0) mm, keeps its course while the origin circles around it.
  Scene spinning = lying;
  spinning.bodies.erase(spinning.bodies.begin());
  spinning.gravity_m_s2.setZero();
  const auto world = bullet(spinning);
  const Vector3d centre(0.04 / 3.0, 0.02 / 3.0, 0.0);
  const Vector3d start = spinning.bodies[0].p_WB + centre;
  world->add_proxy({"haptic0", 0.1, 0.002, 0.0, {0.135, 0.03, 0.2}});  // hits the thin end from above
  for (int i = 0; i < 1500; ++i) {
    world->set_proxy_target(0, {{0.135, 0.03 - 0.1 * i * 1e-3, 0.2}, {0, -0.1, 0}, 300.0, 6.0});
    world->step(1e-3);
  }
  const physics::BodyPose turned = world->body_pose(0);
  EXPECT_LT(std::abs(turned.orientation.w()), 0.999) << "it was hit off its centre";
  const Vector3d moved = turned.position_m + turned.orientation * centre - start;
  EXPECT_LT(moved.y(), -1e-3);
  EXPECT_NEAR(moved.z(), 0.0, 1e-3);
}

TEST(BulletShapes, HoldsABallInAMeshAndLetsNothingThroughIt) {
  const tests::TemporaryFolder folder;
  folder.write("bowl.obj",
               "v -0.1 0.05 -0.1\nv 0.1 0.05 -0.1\nv 0.1 0.05 0.1\nv -0.1 0.05 0.1\nv 0 0.01 0\n"
               "f 5 2 1\nf 5 3 2\nf 5 4 3\nf 5 1 4\n");
  const Scene scene =
      read(folder,
           "  - {name: bowl, type: static, friction: 0.6, shape: {mesh: {file: bowl.obj}}}\n"
           "  - {name: ball, type: dynamic, mass_kg: 0.02, friction: 0.6, position_m: [0.03, 0.06, "
           "0.02], linear_damping_per_s: 2, angular_damping_per_s: 5, shape: {sphere: {radius_m: 0.01}}}\n");
  const Vector3d rest = drop(scene, 2, 6.0).position_m;
  // Four slopes of 0.4: the centre hangs r·√(1 + 0.4²) above the bottom.
  EXPECT_NEAR(rest.x(), 0.0, 1e-3);
  EXPECT_NEAR(rest.z(), 0.0, 1e-3);
  EXPECT_NEAR(rest.y(), 0.01 + 0.01 * std::sqrt(1.16), 0.5e-3);
}

/// Height of the first bounce of a ball that falls from 0.1 m, over the height that its restitution says.
double bounce_over_law(double restitution, double h) {
  Scene scene = tests::floor_scene();
  scene.bodies[0].restitution = 1.0;
  scene.bodies.push_back(tests::body("ball", rtbus::shapes::Sphere{0.01}, {0, 0.11, 0}, 0.02));
  scene.bodies[1].restitution = restitution;
  const auto world = bullet(scene);
  double highest_m = 0.0;
  bool hit = false;
  double before_m = 0.11;
  for (int i = 0; i < static_cast<int>(0.3 / h); ++i) {
    world->step(h);
    const double y = world->body_pose(1).position_m.y();
    hit = hit || y > before_m;
    if (hit) highest_m = std::max(highest_m, y - 0.01);
    before_m = y;
  }
  return highest_m / (0.1 * restitution * restitution);
}

TEST(BulletShapes, BounceAsHighAsRestitutionSays) {
  for (const double restitution : {0.4, 0.6, 0.8}) {
    for (const double h : {0.25e-3, 1e-3, 2e-3}) {
      const double ratio = bounce_over_law(restitution, h);
      std::printf("restitution %.1f, step %.2f ms: bounce %.3f of the height it should have\n", restitution, h * 1e3,
                  ratio);
      // What is left is the way of one step at 1.4 m/s, from where the ball turns to where it should.
      EXPECT_NEAR(ratio, 1.0, 0.01 + 1.4 * h / (0.1 * restitution * restitution));
    }
  }
}

// Nothing may keep jumping: what bounces comes to rest, at its height.
TEST(BulletShapes, ComeToRestAfterBouncing) {
  Scene scene = tests::floor_scene();
  scene.bodies[0].restitution = 1.0;
  scene.bodies.push_back(tests::body("ball", rtbus::shapes::Sphere{0.01}, {0, 0.05, 0}, 0.02));
  scene.bodies.push_back(tests::body("box", rtbus::shapes::Box{{0.01, 0.01, 0.01}}, {0.1, 0.05, 0}, 0.02));
  scene.bodies[1].restitution = scene.bodies[2].restitution = 0.5;
  const auto world = bullet(scene);
  for (int i = 0; i < 4000; ++i) world->step(1e-3);
  EXPECT_EQ(world->awake_bodies(), 0U);
  EXPECT_NEAR(world->body_pose(1).position_m.y(), 0.01, 0.1e-3);
  EXPECT_NEAR(world->body_pose(2).position_m.y(), 0.01, 0.1e-3);
}

TEST(BulletShapes, SlowDownInTheAirAsDampingSays) {
  // Terminal speed g/λ.
  Scene scene;
  scene.bodies.push_back(tests::body("ball", rtbus::shapes::Sphere{0.01}, {0, 0, 0}, 0.02));
  scene.bodies[0].linear_damping_per_s = 4.0;
  const auto world = bullet(scene);
  for (int i = 0; i < 4000; ++i) world->step(1e-3);
  const double y = world->body_pose(0).position_m.y();
  world->step(1e-3);
  EXPECT_NEAR((world->body_pose(0).position_m.y() - y) / 1e-3, -9.81 / 4.0, 0.02);
}

}  // namespace
