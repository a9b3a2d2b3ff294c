/// What every engine must do, whoever wrote it. A new row of the registry is tested for free. Where engines may differ
/// by their solver, the tolerance is the suite's and wide; what must be exact for the analytic engine is in its unit
/// tests.
#include <cmath>
#include <limits>
#include <memory>
#include <random>

#include <gtest/gtest.h>

#include "physics_node/engine_registry.hpp"

namespace {

using Eigen::Vector3d;
using physics::ProxyParameters;
using physics::ProxyReadout;
using physics::ProxyTarget;
using physics::World;

class WorldConformance : public testing::TestWithParam<physics::EngineEntry> {
 protected:
  static rtbus::config::Body fixed_body(const char* name, rtbus::config::BodyShape shape,
                                        const Vector3d& position = {0, 0, 0}) {
    rtbus::config::Body body;
    body.name = name;
    body.shape = shape;
    body.p_WB = position;
    body.friction = 0.5;
    return body;
  }
  static rtbus::config::Scene floor_scene() {
    rtbus::config::Scene scene;
    scene.bodies = {fixed_body("floor", rtbus::shapes::Plane{})};
    return scene;
  }
  static rtbus::config::Scene cluttered_scene() {
    rtbus::config::Scene scene = floor_scene();
    scene.bodies.push_back(fixed_body("ball", rtbus::shapes::Sphere{0.05}, {0.1, 0.05, 0}));
    scene.bodies.push_back(fixed_body("block", rtbus::shapes::Box{{0.05, 0.05, 0.05}}, {-0.1, 0.05, 0}));
    return scene;
  }
  static std::unique_ptr<World> make(const rtbus::config::Scene& scene) { return GetParam().factory(scene, {}); }

  static std::size_t add_proxy(World& world, const Vector3d& position, double friction = 1.0) {
    ProxyParameters parameters;
    parameters.device = "haptic0";
    parameters.mass_kg = kMassKg;
    parameters.radius_m = kRadiusM;
    parameters.friction = friction;
    parameters.position_m = position;
    return world.add_proxy(parameters);
  }
  static ProxyTarget pull(const Vector3d& position, double K = 200.0, double B = 6.26) {
    return {position, Vector3d::Zero(), K, B};
  }
  static ProxyReadout run(World& world, const ProxyTarget& target, double h, int steps) {
    for (int i = 0; i < steps; ++i) {
      world.set_proxy_target(0, target);
      world.step(h);
    }
    return world.proxy(0);
  }
  static bool finite(const ProxyReadout& r) {
    return r.position_m.allFinite() && r.velocity_m_s.allFinite() && r.orientation.coeffs().allFinite() &&
           r.angular_velocity_rad_s.allFinite() && r.coupling_force_n.allFinite() && r.contact_force_n.allFinite();
  }

  static constexpr double kMassKg = 0.1;
  static constexpr double kRadiusM = 0.01;
};

TEST_P(WorldConformance, StepsWithoutAProxy) {
  const auto world = make(cluttered_scene());
  for (int i = 0; i < 10; ++i) world->step(1e-3);
  EXPECT_EQ(world->bodies(), 3U);
}

TEST_P(WorldConformance, CountsHandlesFromZero) {
  const auto world = make(floor_scene());
  EXPECT_EQ(add_proxy(*world, {0, 0.1, 0}), 0U);
  EXPECT_EQ(add_proxy(*world, {0.1, 0.1, 0}), 1U);
  EXPECT_NEAR(world->proxy(1).position_m.x(), 0.1, 1e-12);
}

TEST_P(WorldConformance, HoldsAProxyThatNobodyPulls) {
  const auto world = make(floor_scene());
  add_proxy(*world, {0, 0.1, 0});
  for (int i = 0; i < 100; ++i) world->step(1e-2);
  EXPECT_NEAR((world->proxy(0).position_m - Vector3d(0, 0.1, 0)).norm(), 0.0,
              1e-9);  // no gravity on a tool in the hand
}

TEST_P(WorldConformance, BringsTheProxyToItsTargetInFreeAir) {
  for (const double h : {1e-3, 1e-2, 0.1}) {
    const auto world = make(floor_scene());
    add_proxy(*world, {0, 0.1, 0});
    const ProxyReadout proxy = run(*world, pull({0.05, 0.15, -0.02}), h, static_cast<int>(std::max(3.0 / h, 100.0)));
    EXPECT_NEAR((proxy.position_m - Vector3d(0.05, 0.15, -0.02)).norm(), 0.0, 1e-5) << h;
    EXPECT_NEAR(proxy.coupling_force_n.norm(), 0.0, 1e-3) << h;
    EXPECT_EQ(proxy.contacts, 0U) << h;
  }
}

TEST_P(WorldConformance, FollowsAMovingTargetWithoutDragBecauseTheDamperIsRelative) {
  const auto world = make(floor_scene());
  add_proxy(*world, {0, 0.1, 0});
  double x = 0.0;
  for (int i = 1; i <= 2000; ++i) {
    x = 0.1 * i * 1e-3;
    world->set_proxy_target(0, {{x, 0.1, 0}, {0.1, 0, 0}, 200.0, 6.26});
    world->step(1e-3);
  }
  EXPECT_NEAR(world->proxy(0).position_m.x(), x, 1e-5);
  EXPECT_NEAR(world->proxy(0).coupling_force_n.norm(), 0.0, 2e-3);
}

TEST_P(WorldConformance, StopsAtTheWallWithTheForceOfTheSpring) {
  for (const double h : {1e-3, 1e-2}) {
    const auto world = make(floor_scene());
    add_proxy(*world, {0, 0.05, 0});
    const ProxyReadout proxy = run(*world, pull({0, kRadiusM - 0.01, 0}), h, 2000);  // 10 mm beyond touching
    EXPECT_NEAR(proxy.position_m.y(), kRadiusM, 1e-4) << h;
    EXPECT_NEAR(proxy.contact_force_n.y(), 200.0 * 0.01, 0.02) << h;
    EXPECT_GE(proxy.contacts, 1U) << h;
  }
}

TEST_P(WorldConformance, DoesNotTunnelInOneLongStep) {
  const auto world = make(cluttered_scene());
  add_proxy(*world, {0, 0.5, 0});
  const ProxyReadout proxy = run(*world, pull({0, -1.0, 0}, 2000.0, 10.0), 0.2, 20);
  EXPECT_GE(proxy.position_m.y(), kRadiusM - 1e-3);
}

TEST_P(WorldConformance, BalancesForcesAtRestAndMomentumInMotion) {
  const auto world = make(cluttered_scene());
  add_proxy(*world, {0, 0.1, 0});
  Vector3d before = Vector3d::Zero();
  for (int i = 0; i < 4000; ++i) {
    const double t = i * 1e-3;
    world->set_proxy_target(0, pull({0.12 * std::sin(3 * t), 0.03 * std::cos(5 * t), 0.03 * std::sin(2 * t)}));
    world->step(1e-3);
    const ProxyReadout proxy = world->proxy(0);
    const Vector3d needed_n = kMassKg * (proxy.velocity_m_s - before) / 1e-3;
    ASSERT_NEAR((needed_n - proxy.coupling_force_n - proxy.contact_force_n).norm(), 0.0, 1e-3) << i;
    before = proxy.velocity_m_s;
  }
  const ProxyReadout rest = run(*world, pull({0, 0, 0}), 1e-3, 3000);
  EXPECT_NEAR((rest.coupling_force_n + rest.contact_force_n).norm(), 0.0, 0.01);
}

TEST_P(WorldConformance, KeepsFrictionInsideItsCone) {
  for (const double friction : {0.0, 0.4, 1.0}) {  // times 0.5 of the floor
    const auto world = make(floor_scene());
    add_proxy(*world, {0, kRadiusM, 0}, friction);
    run(*world, pull({0, kRadiusM - 0.01, 0}), 1e-3, 1000);
    double largest = 0.0;
    for (int i = 0; i < 2000; ++i) {
      world->set_proxy_target(0, pull({2e-5 * i, kRadiusM - 0.01, 0}));
      world->step(1e-3);
      const Vector3d force = world->proxy(0).contact_force_n;
      ASSERT_LE(std::hypot(force.x(), force.z()), 0.5 * friction * force.y() * 1.02 + 1e-3) << friction << ' ' << i;
      largest = std::max(largest, std::hypot(force.x(), force.z()));
    }
    EXPECT_NEAR(largest, 0.5 * friction * 2.0, 0.1) << friction;  // and it is used when the pull is wide enough
  }
}

TEST_P(WorldConformance, ResetsAtZeroEnergy) {
  const auto world = make(floor_scene());
  add_proxy(*world, {0, 0.05, 0});
  run(*world, pull({0.3, -0.2, 0}, 2000.0, 1.0), 1e-3, 30);
  const Vector3d place(0.02, 0.2, 0.1);
  world->reset_proxy(0, place);
  const ProxyReadout reset = world->proxy(0);
  EXPECT_NEAR((reset.position_m - place).norm(), 0.0, 1e-12);
  EXPECT_EQ(reset.velocity_m_s.norm(), 0.0);
  EXPECT_EQ(reset.contacts, 0U);
  const ProxyReadout after = run(*world, pull(place), 1e-3, 100);
  EXPECT_NEAR((after.position_m - place).norm(), 0.0, 1e-9);
  EXPECT_NEAR(after.coupling_force_n.norm(), 0.0, 1e-6);
}

TEST_P(WorldConformance, StaysStableOverTheTableOfStiffnessAndStep) {
  for (const double K : {10.0, 200.0, 2000.0, 20000.0}) {
    for (const double h : {1e-4, 1e-3, 5e-3, 0.02, 0.055, 0.2}) {
      for (const double zeta : {0.0, 0.7}) {
        const auto world = make(floor_scene());
        add_proxy(*world, {0, 0.05, 0});
        const ProxyTarget target = pull({0.02, kRadiusM - 0.005, 0}, K, 2 * zeta * std::sqrt(K * kMassKg));
        double farthest_m = 0.0;
        for (int i = 0; i < 1000; ++i) {
          run(*world, target, h, 1);
          ASSERT_TRUE(finite(world->proxy(0))) << K << ' ' << h << ' ' << zeta;
          farthest_m = std::max(farthest_m, world->proxy(0).position_m.norm());
        }
        // It starts 46 mm from the target: nothing may carry it beyond as far again on the other side.
        EXPECT_LT(farthest_m, 0.12) << K << ' ' << h << ' ' << zeta;
      }
    }
  }
}

TEST_P(WorldConformance, IsBitIdenticalWhenRunTwice) {
  ProxyReadout last[2];
  for (ProxyReadout& out : last) {
    const auto world = make(cluttered_scene());
    add_proxy(*world, {0, 0.1, 0});
    std::mt19937_64 random(11);
    std::uniform_real_distribution<double> u(-0.15, 0.15);
    for (int i = 0; i < 1000; ++i) {
      world->set_proxy_target(0, pull({u(random), u(random), u(random)}, 800.0, 12.0));
      world->step(2e-3);
    }
    out = world->proxy(0);
  }
  EXPECT_EQ(last[0].position_m, last[1].position_m);
  EXPECT_EQ(last[0].velocity_m_s, last[1].velocity_m_s);
  EXPECT_EQ(last[0].contact_force_n, last[1].contact_force_n);
}

TEST_P(WorldConformance, StaysFiniteForHostileTargetsAndSteps) {
  const double huge = std::numeric_limits<double>::max();
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const double inf = std::numeric_limits<double>::infinity();
  const auto world = make(cluttered_scene());
  add_proxy(*world, {0, 0.1, 0});
  for (const double p : {0.0, 1e-300, -1e6, huge, -huge, nan, inf}) {
    for (const double K : {0.0, 1e-300, 1e12, huge, -1.0, nan}) {
      for (const double h : {1e-3, 0.2}) {
        world->set_proxy_target(0, {{p, -p, p}, {-p, p, p}, K, K});
        world->step(h);
        ASSERT_TRUE(finite(world->proxy(0))) << p << ' ' << K << ' ' << h;
      }
    }
  }
  world->reset_proxy(0, {huge, nan, 0});
  world->step(1e-3);
  ASSERT_TRUE(finite(world->proxy(0)));
  // And it is usable again afterwards.
  world->reset_proxy(0, {0, 0.1, 0});
  EXPECT_NEAR(run(*world, pull({0, 0.2, 0}), 1e-3, 3000).position_m.y(), 0.2, 1e-5);
}

TEST_P(WorldConformance, LeavesABodyItStartsDeepIn) {
  const auto world = make(cluttered_scene());
  add_proxy(*world, {0.1, 0.05, 0});  // the centre of the ball
  const ProxyReadout proxy = run(*world, pull({0.1, 0.2, 0}), 1e-3, 5000);
  EXPECT_NEAR(proxy.position_m.y(), 0.2, 1e-3);
}

TEST_P(WorldConformance, FindsContactsWithTheirGapsAndNormals) {
  struct Case {
    Vector3d at, normal;
    double surface_m;  // from the proxy's centre
    std::uint32_t body;
  };
  const Vector3d ball(0.1, 0.05, 0), block(-0.1, 0.05, 0);
  const Vector3d corner = block + Vector3d(-0.05, 0.05, 0.05), edge = block + Vector3d(-0.05, 0.05, 0);
  const Vector3d diagonal = Vector3d(-1, 1, 1).normalized(), across = Vector3d(-1, 1, 0).normalized();
  // Bullet rounds the edges of boxes by a tenth of the half extent, 5 mm here, but no more than 0.04 of its units,
  // which with nothing that moves are 1/30 m.
  const double rounding_m = std::string(GetParam().name) == "bullet" ? 0.04 / 30.0 : 0.0;
  for (const double far_m : {-0.0005, 0.0, 0.0005, 0.004}) {
    const double d = kRadiusM + far_m;
    for (const Case& c : {Case{{0, d, 0.3}, {0, 1, 0}, d, 0}, Case{ball + Vector3d(0.05 + d, 0, 0), {1, 0, 0}, d, 1},
                          Case{ball + Vector3d(0.6, 0.8, 0) * (0.05 + d), {0.6, 0.8, 0}, d, 1},
                          Case{block + Vector3d(0.01, 0.05 + d, -0.02), {0, 1, 0}, d, 2},
                          Case{edge + across * d, across, d + rounding_m * (std::sqrt(2.0) - 1.0), 2},
                          Case{corner + diagonal * d, diagonal, d + rounding_m * (std::sqrt(3.0) - 1.0), 2}}) {
      const auto world = make(cluttered_scene());
      add_proxy(*world, c.at, 0.8);
      physics::ContactSet set;
      world->contacts(0, 0.005, set);
      EXPECT_EQ(set.radius_m, 0.005);
      EXPECT_EQ(set.proxy_radius_m, kRadiusM);
      EXPECT_EQ(set.proxy_mass_kg, kMassKg);
      ASSERT_EQ(set.contacts.size(), 1U) << c.body << ' ' << far_m;
      ASSERT_EQ(set.bodies.size(), 1U);
      const physics::Contact& contact = set.contacts[0];
      EXPECT_NEAR(contact.gap_m, c.surface_m - kRadiusM, 2e-7) << c.body << ' ' << far_m;
      EXPECT_NEAR((contact.normal - c.normal).norm(), 0.0, 3e-5) << c.body << ' ' << far_m;
      EXPECT_NEAR((contact.point_m - (c.at - c.normal * c.surface_m)).norm(), 0.0, 1e-6) << c.body << ' ' << far_m;
      EXPECT_NEAR(contact.friction, 0.8 * 0.5, 1e-7);
      EXPECT_EQ(contact.surface_velocity_m_s.norm(), 0.0);
      EXPECT_EQ(contact.inverse_mass_per_kg.norm(), 0.0);
      EXPECT_EQ(set.bodies[contact.row].body, c.body);
      EXPECT_EQ(set.bodies[contact.row].kind, physics::BodyKind::kStatic);
    }
  }
}

TEST_P(WorldConformance, ListsContactsByTheirGapUpToTheRadius) {
  const auto world = make(cluttered_scene());
  add_proxy(*world, {0.1, 0.05 + 0.05 + kRadiusM + 0.001, 0});  // 1 mm above the ball, 101 mm above the floor
  physics::ContactSet set;
  world->contacts(0, 0.0005, set);
  EXPECT_TRUE(set.contacts.empty());
  EXPECT_TRUE(set.bodies.empty());
  world->contacts(0, 0.2, set);
  ASSERT_EQ(set.contacts.size(), 3U);
  EXPECT_EQ(set.bodies[set.contacts[0].row].body, 1U);
  EXPECT_NEAR(set.contacts[1].gap_m, 0.101, 1e-6);
  EXPECT_LE(set.contacts[1].gap_m, set.contacts[2].gap_m);
  EXPECT_EQ(set.contacts_overflow, 0U);
}

TEST_P(WorldConformance, KeepsTheNearestSixteenContactsAndCountsTheRest) {
  rtbus::config::Scene scene;
  for (int i = 0; i < 20; ++i) {  // a ring of balls, each a little farther than the one before
    const double angle = 0.3 * i;
    scene.bodies.push_back(fixed_body(("bead" + std::to_string(i)).c_str(), rtbus::shapes::Sphere{0.001},
                                      Vector3d(std::cos(angle), 0, std::sin(angle)) * (0.012 + 1e-4 * i)));
  }
  const auto world = make(scene);
  add_proxy(*world, {0, 0, 0});
  physics::ContactSet set;
  world->contacts(0, 0.01, set);
  ASSERT_EQ(set.contacts.size(), physics::kMaxContacts);
  EXPECT_EQ(set.contacts_overflow, 4U);
  for (std::size_t i = 0; i < set.contacts.size(); ++i) {
    EXPECT_EQ(set.bodies[set.contacts[i].row].body, i);
    EXPECT_NEAR(set.contacts[i].gap_m, 0.001 + 1e-4 * static_cast<double>(i), 1e-7);
  }
}

TEST_P(WorldConformance, LetsGoOfAReleasedProxyUntilItIsReset) {
  const auto world = make(floor_scene());
  add_proxy(*world, {0, 0.05, 0});
  run(*world, pull({0, kRadiusM - 0.01, 0}), 1e-3, 500);
  const Vector3d held = world->proxy(0).position_m;
  world->release_proxy(0);
  world->release_proxy(0);  // twice is once
  const ProxyReadout free = run(*world, pull({0.3, 0.3, 0.3}, 2000.0), 1e-3, 100);
  EXPECT_EQ((free.position_m - held).norm(), 0.0);
  EXPECT_EQ(free.coupling_force_n.norm() + free.contact_force_n.norm() + free.velocity_m_s.norm(), 0.0);
  EXPECT_EQ(free.contacts, 0U);
  physics::ContactSet set;
  world->contacts(0, 1.0, set);
  EXPECT_TRUE(set.contacts.empty());
  world->reset_proxy(0, {0, 0.05, 0});
  EXPECT_NEAR(run(*world, pull({0, kRadiusM - 0.01, 0}), 1e-3, 2000).contact_force_n.y(), 2.0, 0.02);
}

TEST_P(WorldConformance, GoesOnBitForBitWhetherAskedForContactsOrNot) {
  ProxyReadout last[2];
  for (int asked = 0; asked < 2; ++asked) {
    const auto world = make(cluttered_scene());
    add_proxy(*world, {0, 0.1, 0});
    std::mt19937_64 random(13);
    std::uniform_real_distribution<double> u(-0.15, 0.15);
    physics::ContactSet set;
    for (int i = 0; i < 1000; ++i) {
      world->set_proxy_target(0, pull({u(random), u(random), u(random)}, 800.0, 12.0));
      world->step(2e-3);
      if (asked == 1) world->contacts(0, 0.05, set);
    }
    last[asked] = world->proxy(0);
  }
  EXPECT_EQ(last[0].position_m, last[1].position_m);
  EXPECT_EQ(last[0].contact_force_n, last[1].contact_force_n);
}

/// Rows whose module this build has; EngineRegistry.BuildsWhatItPromises makes sure that none is missing by mistake.
std::vector<physics::EngineEntry> present_engines() {
  std::vector<physics::EngineEntry> out;
  for (const physics::EngineEntry& entry : physics::registered_engines()) {
    // Programs of their own are held to the rules from outside: `rtbus conformance ENGINE.yaml`.
    const bool is_program = !entry.program.empty() || entry.name == physics::kExternalEngine;
    if (!is_program && physics::engine_present(entry)) out.push_back(entry);
  }
  return out;
}

INSTANTIATE_TEST_SUITE_P(Engines, WorldConformance, testing::ValuesIn(present_engines()),
                         [](const auto& row) { return std::string(row.param.name); });

}  // namespace
