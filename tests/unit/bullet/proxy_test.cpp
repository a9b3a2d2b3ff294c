/// The tool in Bullet: against the exact engine, against Newton's law, and against hostile hands.
#include <gtest/gtest.h>

#include <cstring>
#include <limits>
#include <random>

#include "tests/unit/bullet/scenes.hpp"

namespace {

using physics::ProxyReadout;
using physics::ProxyTarget;
using tests::bullet;
using tests::Vector3d;

constexpr double kMassKg = 0.1;
constexpr double kRadiusM = 0.01;

std::size_t add_proxy(physics::World& world, const Vector3d& at, double friction = 1.0, double radius_m = kRadiusM) {
  return world.add_proxy({"haptic0", kMassKg, radius_m, friction, at});
}

/// Both engines along one path; the largest differences.
struct Difference {
  double position_m = 0.0;
  double force_n = 0.0;
  double rms_force_n = 0.0;
};
Difference compare(const rtbus::config::Scene& scene, double h, double seconds, Vector3d (*path)(double t)) {
  const auto exact = physics::make_world("analytic", scene);
  const auto world = bullet(scene, 20);
  add_proxy(*exact, path(0.0));
  add_proxy(*world, path(0.0));
  Difference out;
  for (int i = 1; i <= static_cast<int>(seconds / h); ++i) {
    const ProxyTarget target{path(i * h), (path(i * h) - path((i - 1) * h)) / h, 300.0, 6.0};
    for (physics::World* each : {exact.get(), world.get()}) {
      each->set_proxy_target(0, target);
      each->step(h);
    }
    const ProxyReadout a = exact->proxy(0);
    const ProxyReadout b = world->proxy(0);
    out.position_m = std::max(out.position_m, (a.position_m - b.position_m).norm());
    out.force_n = std::max(out.force_n, (a.coupling_force_n - b.coupling_force_n).norm());
    out.rms_force_n += (a.coupling_force_n - b.coupling_force_n).squaredNorm() * h / seconds;
  }
  out.rms_force_n = std::sqrt(out.rms_force_n);
  return out;
}

// Stated tolerance: 1 µm and 1 mN on a wall, where both solve the same equation; 0.02 mm and 5 mN on a sphere, whose
// contact Bullet takes as the plane that touches it where the step begins.
TEST(BulletProxy, AgreesWithTheExactEngineOnAWall) {
  for (const double h : {1e-3, 4e-3}) {
    const Difference d = compare(tests::floor_scene(), h, 3.0, [](double t) {
      return Vector3d(0.0, kRadiusM + 0.01 - 0.02 * std::sin(2.0 * t), 0.0);
    });
    std::printf("wall, %g ms: %.3g mm, %.3g mN\n", h * 1e3, d.position_m * 1e3, d.force_n * 1e3);
    EXPECT_LT(d.position_m, 1e-6) << h;
    EXPECT_LT(d.force_n, 1e-3) << h;
  }
}

TEST(BulletProxy, AgreesWithTheExactEngineOnASphere) {
  auto scene = tests::floor_scene();
  scene.bodies = {tests::body("ball", rtbus::shapes::Sphere{0.05})};
  scene.bodies[0].friction = 0.0;
  for (const double h : {1e-3, 4e-3}) {
    // Down onto the ball beside its pole, and across it.
    const Difference d = compare(scene, h, 3.0, [](double t) {
      return Vector3d(0.02 * std::sin(1.5 * t), 0.055 + 0.02 * std::exp(-3.0 * t), 0.01 * std::cos(1.5 * t));
    });
    std::printf("sphere, %g ms: %.3g mm, %.3g mN, RMS %.3g mN\n", h * 1e3, d.position_m * 1e3, d.force_n * 1e3,
                d.rms_force_n * 1e3);
    EXPECT_LT(d.position_m, 0.02e-3) << h;
    EXPECT_LT(d.force_n, 5e-3) << h;
  }
}

TEST(BulletProxy, GivesABlockTheImpulseThatTheHandGave) {
  // No friction anywhere: what left the hand along z is in the block, or still in the proxy.
  for (const double h : {1e-3, 5e-3}) {
    auto scene = tests::floor_scene();
    scene.bodies[0].friction = 0.0;
    scene.bodies.push_back(tests::body("block", rtbus::shapes::Box{{0.03, 0.02, 0.02}}, {0, 0.02, -0.02}, 0.2));
    scene.bodies[1].friction = 0.0;
    scene.deactivation.enabled = false;
    const auto world = bullet(scene, 20);
    add_proxy(*world, {0, 0.02, 0.02}, 0.0, 0.005);
    double given_n_s = 0.0;
    double to_block_n_s = 0.0;
    Vector3d before = world->body_pose(1).position_m;
    double block_m_s = 0.0;
    for (int i = 0; i < static_cast<int>(1.5 / h); ++i) {
      const double z = 0.02 - 0.08 * i * h;
      world->set_proxy_target(0, {{0, 0.02, z}, {0, 0, -0.08}, 200.0, 5.0});
      world->step(h);
      given_n_s += world->proxy(0).coupling_force_n.z() * h;
      to_block_n_s -= world->proxy(0).contact_force_n.z() * h;
      block_m_s = (world->body_pose(1).position_m.z() - before.z()) / h;
      before = world->body_pose(1).position_m;
    }
    EXPECT_LT(block_m_s, -0.07) << "it was pushed, at " << h;
    EXPECT_NEAR(to_block_n_s, 0.2 * block_m_s, 0.01 * 0.2 * 0.08) << h;
    EXPECT_NEAR(given_n_s, 0.2 * block_m_s + kMassKg * world->proxy(0).velocity_m_s.z(), 0.01 * 0.3 * 0.08) << h;
  }
}

TEST(BulletProxy, FeelsTheWeightOfABlockItHoldsUp) {
  // The proxy is the only thing under a block that stands on its middle; friction keeps it there.
  rtbus::config::Scene scene;
  scene.bodies.push_back(tests::body("block", rtbus::shapes::Box{{0.02, 0.02, 0.02}}, {0, 0.03, 0}, 0.15));
  const auto world = bullet(scene, 50);
  add_proxy(*world, {0, 0, 0});
  double force_n = 0.0;
  for (int i = 0; i < 300; ++i) {
    world->set_proxy_target(0, {{0, 0, 0}, {0, 0, 0}, 2000.0, 40.0});
    world->step(1e-3);
    if (i >= 200) force_n += world->proxy(0).contact_force_n.y() / 100.0;
  }
  EXPECT_NEAR(force_n, -0.15 * 9.81, 0.05 * 0.15 * 9.81);
}

TEST(BulletProxy, MovesAStackTwiceInTheSameWayBitForBit) {
  std::vector<double> run[2];
  for (auto& out : run) {
    const auto scene = tests::stack_scene(4, 4, 4, 0.02, 1e-4);
    const auto world = bullet(scene);
    add_proxy(*world, {0.03, 0.04, -0.03}, 1.0, 0.005);
    for (int i = 0; i < 1500; ++i) {
      world->set_proxy_target(0, {{0.03, 0.04, -0.03 + 0.05 * i * 1e-3}, {0, 0, 0.05}, 300.0, 6.0});
      world->step(1e-3);
      out.push_back(world->proxy(0).contact_force_n.z());
    }
    for (std::size_t i = 0; i < world->bodies(); ++i) out.push_back(world->body_pose(i).position_m.x());
  }
  EXPECT_EQ(std::memcmp(run[0].data(), run[1].data(), run[0].size() * sizeof(double)), 0);
  EXPECT_GT(*std::max_element(run[0].begin(), run[0].end()), 0.0);
}

TEST(BulletProxy, NeitherBreaksNorIsBrokenByBodiesWhenTheHandGoesMad) {
  const double huge = std::numeric_limits<double>::max();
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const auto scene = tests::stack_scene(3, 3, 3, 0.02, 1e-4);
  const auto world = bullet(scene);
  add_proxy(*world, {0.02, 0.03, -0.02});
  std::mt19937_64 random(3);
  std::uniform_real_distribution<double> u(-1.0, 1.0);
  const double sizes[] = {0.05, 0.05, 0.05, 10.0, 1e6, huge};
  for (int i = 0; i < 3000; ++i) {
    const double size = sizes[random() % 6];
    ProxyTarget target{{size * u(random), size * u(random), size * u(random)},
                       {size * u(random), size * u(random), 0.0},
                       random() % 5 == 0 ? huge : 1e4,
                       random() % 5 == 0 ? huge : 10.0};
    if (random() % 10 == 0) target.position_m.x() = nan;
    world->set_proxy_target(0, target);
    world->step(random() % 20 == 0 ? 0.2 : 1e-3);
    const ProxyReadout proxy = world->proxy(0);
    ASSERT_TRUE(proxy.position_m.allFinite() && proxy.velocity_m_s.allFinite() && proxy.coupling_force_n.allFinite() &&
                proxy.contact_force_n.allFinite())
        << i;
    for (std::size_t b = 0; b < world->bodies(); ++b) {
      ASSERT_TRUE(world->body_pose(b).position_m.allFinite() && world->body_pose(b).orientation.coeffs().allFinite())
          << b << " in step " << i;
    }
  }
  // And the proxy is as good as new.
  world->reset_proxy(0, {0, 5.0, 0});
  for (int i = 0; i < 2000; ++i) {
    world->set_proxy_target(0, {{0, 5.1, 0}, {0, 0, 0}, 300.0, 6.0});
    world->step(1e-3);
  }
  EXPECT_NEAR(world->proxy(0).position_m.y(), 5.1, 1e-5);
}

TEST(BulletProxy, GetsASmallRadiusWhenItHasNone) {
  const auto scene = tests::stack_scene(1, 1, 1, 0.02, 0.0);
  const auto world = bullet(scene);
  add_proxy(*world, {0.5, 0.05, 0}, 1.0, 0.0);
  for (int i = 0; i < 2000; ++i) {
    world->set_proxy_target(0, {{0.5, -0.005, 0}, {0, 0, 0}, 300.0, 6.0});
    world->step(1e-3);
  }
  EXPECT_NEAR(world->proxy(0).position_m.y(), 0.05 * 0.02, 1e-5);
}

}  // namespace
