#include "physics_node/analytic/analytic_world.hpp"

#include <cmath>
#include <limits>
#include <stdexcept>

#include <gtest/gtest.h>

namespace {

using Eigen::Vector3d;
using physics::AnalyticWorld;
using physics::ProxyParameters;
using physics::ProxyReadout;
using physics::ProxyTarget;
using rtbus::shapes::Box;
using rtbus::shapes::PlacedShape;
using rtbus::shapes::Plane;
using rtbus::shapes::Sphere;

PlacedShape placed(rtbus::shapes::Shape shape, double friction = 0.0, const Vector3d& position = Vector3d::Zero()) {
  PlacedShape result;
  result.shape = shape;
  result.p_WB = position;
  result.friction = friction;
  return result;
}

ProxyParameters point_proxy(const Vector3d& position, double mass_kg = 0.1, double friction = 1.0) {
  ProxyParameters parameters;
  parameters.device = "haptic0";
  parameters.mass_kg = mass_kg;
  parameters.friction = friction;
  parameters.position_m = position;
  return parameters;
}

ProxyTarget pulled_to(const Vector3d& position, double K, double B, const Vector3d& velocity = Vector3d::Zero()) {
  return {position, velocity, K, B};
}

TEST(AnalyticWorld, FollowsImplicitEulerInClosedFormInFreeAir) {
  // One axis: v⁺ = (m v + h(K(x_T − x) + B v_T)) / (m + hB + h²K) is a linear map; iterate it beside the world.
  const double m = 0.1, K = 200, B = 6.26, x_T = 0.02, v_T = 0.3;
  for (const double h : {1e-4, 1e-3, 0.02, 0.2}) {
    AnalyticWorld world({});
    world.add_proxy(point_proxy({0, 0, 0}, m));
    double x = 0, v = 0;
    for (int i = 0; i < 200; ++i) {
      world.set_proxy_target(0, pulled_to({x_T, 0, 0}, K, B, {v_T, 0, 0}));
      world.step(h);
      v = (m * v + h * (K * (x_T - x) + B * v_T)) / (m + h * B + h * h * K);
      x += h * v;
      ASSERT_NEAR(world.proxy(0).position_m.x(), x, 1e-14) << h << ' ' << i;
      ASSERT_NEAR(world.proxy(0).velocity_m_s.x(), v, 1e-12) << h << ' ' << i;
    }
  }
}

TEST(AnalyticWorld, ConvergesToTheContinuousOscillatorAsTheStepShrinks) {
  // Undamped: x(t) = x_T(1 − cos ωt). Implicit Euler is of first order, so a tenth of the step is a tenth of the error.
  const double m = 0.1, K = 200, omega = std::sqrt(K / m), end_s = 0.05;
  double error[2];
  for (int level = 0; level < 2; ++level) {
    const int steps = level == 0 ? 5000 : 50000;
    AnalyticWorld world({});
    world.add_proxy(point_proxy({0, 0, 0}, m));
    for (int i = 0; i < steps; ++i) {
      world.set_proxy_target(0, pulled_to({0.01, 0, 0}, K, 0));
      world.step(end_s / steps);
    }
    error[level] = std::abs(world.proxy(0).position_m.x() - 0.01 * (1 - std::cos(omega * end_s)));
  }
  EXPECT_LT(error[0], 1e-4);
  EXPECT_NEAR(error[0] / error[1], 10.0, 0.5);
}

TEST(AnalyticWorld, RestsOnTheWallWithTheForceOfTheSpringAtEveryStepSize) {
  for (const double h : {1e-4, 1e-3, 0.055, 0.2}) {
    for (const double K : {10.0, 200.0, 20000.0}) {
      AnalyticWorld world({placed(Plane{})});
      world.add_proxy(point_proxy({0, 0.02, 0}));
      const double B = 2 * 0.7 * std::sqrt(K * 0.1);
      for (int i = 0; i < 30000 && (i < 10 || i * h < 3.0); ++i) {
        world.set_proxy_target(0, pulled_to({0, -0.002, 0}, K, B));
        world.step(h);
      }
      const ProxyReadout proxy = world.proxy(0);
      EXPECT_NEAR(proxy.position_m.y(), 0.0, 1e-12) << h << ' ' << K;
      EXPECT_NEAR(proxy.velocity_m_s.y(), 0.0, 1e-9) << h << ' ' << K;
      EXPECT_NEAR(proxy.contact_force_n.y(), K * 0.002, K * 1e-9) << h << ' ' << K;
      EXPECT_EQ(proxy.contacts, 1U);
    }
  }
}

TEST(AnalyticWorld, ReachesTheWallInTheStepInWhichItTouches) {
  AnalyticWorld world({placed(Plane{})});
  world.add_proxy(point_proxy({0, 0.1, 0}));
  world.set_proxy_target(0, pulled_to({0, -50, 0}, 2000, 10));
  world.step(0.2);
  EXPECT_NEAR(world.proxy(0).position_m.y(), 0.0, 1e-12);
  EXPECT_NEAR(world.proxy(0).velocity_m_s.y(), -0.1 / 0.2, 1e-9);  // n·v⁺ = −gap/h
  world.step(0.2);
  EXPECT_NEAR(world.proxy(0).velocity_m_s.y(), 0.0, 1e-9);
}

TEST(AnalyticWorld, ObeysNewtonInEveryStepOfABusyPath) {
  AnalyticWorld world({placed(Plane{}, 0.4), placed(Sphere{0.05}, 0.4, {0.05, 0, 0}),
                       placed(Box{{0.03, 0.03, 0.03}}, 0.4, {-0.1, 0, 0})});
  world.add_proxy(point_proxy({0, 0.1, 0}, 0.1));
  Vector3d v = Vector3d::Zero();
  for (int i = 0; i < 5000; ++i) {
    const double t = i * 1e-3;
    world.set_proxy_target(
        0, pulled_to({0.15 * std::sin(7 * t), 0.03 * std::sin(11 * t), 0.05 * std::cos(5 * t)}, 800, 12));
    world.step(1e-3);
    const ProxyReadout proxy = world.proxy(0);
    const Vector3d rate = 0.1 * (proxy.velocity_m_s - v) / 1e-3;
    ASSERT_NEAR((rate - proxy.coupling_force_n - proxy.contact_force_n).norm(), 0.0, 1e-9) << i;
    v = proxy.velocity_m_s;
  }
}

TEST(AnalyticWorld, SticksInsideTheFrictionConeAndSlidesOnItOutside) {
  for (const double pull_m : {0.0009, 0.0011}) {  // against 0.5 · 0.002 of the cone
    AnalyticWorld world({placed(Plane{}, 0.5)});
    world.add_proxy(point_proxy({0, 0, 0}));
    ProxyReadout proxy;
    for (int i = 0; i < 3000; ++i) {
      world.set_proxy_target(0, pulled_to({pull_m, -0.002, 0}, 500, 10));
      world.step(1e-3);
      proxy = world.proxy(0);
      const double tangential_n = std::hypot(proxy.contact_force_n.x(), proxy.contact_force_n.z());
      ASSERT_LE(tangential_n, 0.5 * proxy.contact_force_n.y() + 1e-9);
    }
    if (pull_m < 0.001) {
      EXPECT_EQ(proxy.position_m.x(), 0.0);
      EXPECT_NEAR(proxy.contact_force_n.x(), -500 * pull_m, 1e-9);
    } else {
      // It stops where the spring is back inside the cone, a little later for the speed it had.
      EXPECT_GE(proxy.position_m.x(), pull_m - 0.001 - 1e-9);
      EXPECT_LE(proxy.position_m.x(), pull_m - 0.001 + 2e-5);
      EXPECT_NEAR(proxy.velocity_m_s.x(), 0.0, 1e-12);
    }
  }
}

TEST(AnalyticWorld, TakesTheProductOfBothFrictions) {
  AnalyticWorld world({placed(Plane{}, 0.5)});
  world.add_proxy(point_proxy({0, 0, 0}, 0.1, 0.4));
  for (int i = 0; i < 200; ++i) {
    world.set_proxy_target(0, pulled_to({0.01 * i, -0.002, 0}, 500, 0));
    world.step(1e-3);
  }
  const Vector3d force = world.proxy(0).contact_force_n;
  EXPECT_NEAR(-force.x() / force.y(), 0.2, 1e-9);
}

TEST(AnalyticWorld, StaysOnASphereWhileItIsDraggedAround) {
  AnalyticWorld world({placed(Sphere{0.05}, 0.3)});
  ProxyParameters parameters = point_proxy({0, 0.06, 0});
  parameters.radius_m = 0.005;
  world.add_proxy(parameters);
  for (int i = 0; i < 6000; ++i) {
    const double angle = std::max(0, i - 500) * 1e-3;
    world.set_proxy_target(0, pulled_to(Vector3d(std::sin(angle), std::cos(angle), 0) * 0.050, 1000, 14));
    world.step(1e-3);
    if (i < 500) continue;
    ASSERT_NEAR(world.proxy(0).position_m.norm(), 0.055, 1e-8) << i;
    ASSERT_EQ(world.proxy(0).contacts, 1U) << i;
  }
  // Behind the target by no more than friction allows: tan(lag) is about 0.3 at that depth.
  const Vector3d p = world.proxy(0).position_m;
  const double lag = std::fmod(5.499 - std::atan2(p.x(), p.y()) + 4 * M_PI, 2 * M_PI);
  EXPECT_GT(lag, 0.0);
  EXPECT_LT(lag, 0.1);
}

TEST(AnalyticWorld, FallsOffABoxEdgeAndIsHeldByTheNextFace) {
  AnalyticWorld world({placed(Box{{0.05, 0.05, 0.05}})});
  world.add_proxy(point_proxy({0, 0.05, 0}));
  for (int i = 0; i < 4000; ++i) {  // over the top edge, then down the side, pressed inwards
    const double t = i * 1e-3;
    const Vector3d target =
        t < 1 ? Vector3d(0.06 * t, 0.045, 0) : Vector3d(0.06 - 0.015 * std::min(t - 1, 1.0), 0.0, 0);
    world.set_proxy_target(0, pulled_to(target, 1000, 14));
    world.step(1e-3);
    const Vector3d p = world.proxy(0).position_m;
    ASSERT_GE(std::max({std::abs(p.x()), std::abs(p.y()), std::abs(p.z())}), 0.05 - 1e-9) << i;
  }
  EXPECT_NEAR(world.proxy(0).position_m.x(), 0.05, 1e-9);
  EXPECT_NEAR(world.proxy(0).contact_force_n.x(), 1000 * 0.005, 1e-6);
}

TEST(AnalyticWorld, LosesEnergyTowardsAFixedTarget) {
  for (const double B : {0.0, 1.0}) {
    for (const double h : {1e-4, 1e-3, 0.05, 0.2}) {
      AnalyticWorld world({});
      world.add_proxy(point_proxy({0.05, 0.02, 0}));
      double before = 0.5 * 500 * (0.05 * 0.05 + 0.02 * 0.02);
      for (int i = 0; i < 500; ++i) {
        world.set_proxy_target(0, pulled_to({0, 0, 0}, 500, B));
        world.step(h);
        const ProxyReadout proxy = world.proxy(0);
        const double energy = 0.5 * 0.1 * proxy.velocity_m_s.squaredNorm() + 0.5 * 500 * proxy.position_m.squaredNorm();
        ASSERT_LE(energy, before * (1 + 1e-12) + 1e-30) << B << ' ' << h << ' ' << i;
        before = energy;
      }
    }
  }
}

TEST(AnalyticWorld, MakesNoSpeedFromAnObstacleInTheWay) {
  // A heavy, nearly free proxy is thrown at a sphere with steps longer than the sphere.
  AnalyticWorld world({placed(Sphere{0.05})});
  world.add_proxy(point_proxy({-0.2, 0.001, 0}, 1.0));
  world.set_proxy_target(0, pulled_to({0.5, 0.03, 0}, 0.5, 0));
  double speed = 0.0;
  Vector3d position(-0.2, 0.001, 0);
  for (int i = 0; i < 100; ++i) {
    world.step(0.1);
    const ProxyReadout proxy = world.proxy(0);
    const double spring_gain =
        0.5 * 0.5 *
        ((position - Vector3d(0.5, 0.03, 0)).squaredNorm() - (proxy.position_m - Vector3d(0.5, 0.03, 0)).squaredNorm());
    ASSERT_LE(0.5 * proxy.velocity_m_s.squaredNorm(), 0.5 * speed * speed + std::max(spring_gain, 0.0) + 1e-6) << i;
    speed = proxy.velocity_m_s.norm();
    position = proxy.position_m;
  }
}

TEST(AnalyticWorld, LeavesABodyItStartedInSlowlyAndWithoutKineticEnergy) {
  AnalyticWorld world({placed(Plane{})});
  world.add_proxy(point_proxy({0, -0.05, 0}));
  double height = -0.05;
  for (int i = 0; i < 1000; ++i) {
    world.set_proxy_target(0, pulled_to({0, -0.05, 0}, 200, 6));
    world.step(1e-3);
    const ProxyReadout proxy = world.proxy(0);
    ASSERT_LE(proxy.position_m.y() - height, AnalyticWorld::kRecoverySpeedMS * 1e-3 + 1e-12);
    ASSERT_LE(proxy.velocity_m_s.norm(), 1e-9);
    height = proxy.position_m.y();
  }
  EXPECT_NEAR(height, 0.0, 1e-12);
  EXPECT_NEAR(world.proxy(0).contact_force_n.y(), 10.0, 1e-6);
}

TEST(AnalyticWorld, HasNoGravityAndNoContactBetweenProxies) {
  AnalyticWorld world({});
  world.add_proxy(point_proxy({0, 1, 0}));
  world.add_proxy(point_proxy({0, 1, 0}));
  for (int i = 0; i < 100; ++i) world.step(0.01);
  EXPECT_EQ(world.proxy(0).position_m, Vector3d(0, 1, 0));
  EXPECT_EQ(world.proxy(1).position_m, Vector3d(0, 1, 0));
}

TEST(AnalyticWorld, RejectsAProxyWithoutMass) {
  AnalyticWorld world({});
  EXPECT_THROW(world.add_proxy(point_proxy({0, 0, 0}, 0.0)), std::invalid_argument);
  EXPECT_THROW(world.add_proxy(point_proxy({0, 0, 0}, std::numeric_limits<double>::quiet_NaN())),
               std::invalid_argument);
}

}  // namespace
