#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "haptic_node/rendering/direct.hpp"
#include "haptic_node/rendering/interpolation.hpp"
#include "haptic_node/rendering/registry.hpp"
#include "haptic_node/rendering/remote_virtual_coupling.hpp"
#include "haptic_node/rendering/virtual_coupling.hpp"

namespace {

using Eigen::Vector3d;
using haptic::Direct;
using haptic::Mapping;
using haptic::MappingConfig;
using haptic::RenderInput;
using rtbus::shapes::Box;
using rtbus::shapes::PlacedShape;
using rtbus::shapes::Plane;
using rtbus::shapes::Sphere;

RenderInput at(const Vector3d& position_m, const Vector3d& velocity_m_s = Vector3d::Zero()) {
  RenderInput input;
  input.dt_s = 1e-3;
  input.position_m = position_m;
  input.velocity_m_s = velocity_m_s;
  return input;
}

PlacedShape placed(rtbus::shapes::Shape shape, const Vector3d& p_WB = Vector3d::Zero()) {
  PlacedShape out;
  out.shape = shape;
  out.p_WB = p_WB;
  return out;
}

class DirectOnAPlane : public testing::Test {
 protected:
  Mapping mapping_{MappingConfig{}};
  Direct direct_{200.0, 0.5, mapping_, {placed(Plane{})}};
};

TEST_F(DirectOnAPlane, IsZeroInFreeAir) {
  EXPECT_EQ(direct_.render(at({0.01, 0.02, 0.03}, {1.0, -1.0, 0.0})).force_n, Vector3d::Zero());
}

TEST_F(DirectOnAPlane, IsASpringDamperInside) {
  // −K·y − B·v (paper, Fig. 8): 200·0.002 + 0.5·0.1 = 0.45 N.
  const auto out = direct_.render(at({0.01, -0.002, 0.0}, {0.3, -0.1, 0.0}));
  EXPECT_NEAR(out.force_n.y(), 0.45, 1e-12);
  EXPECT_NEAR(out.force_n.x(), 0.0, 1e-12) << "no drag along the wall";
  EXPECT_LT((out.proxy_position_m - Vector3d(0.01, 0.0, 0.0)).norm(), 1e-12);
}

TEST_F(DirectOnAPlane, NeverPullsTheHandIn) {
  const auto out = direct_.render(at({0.0, -0.0001, 0.0}, {0.0, 1.0, 0.0}));
  EXPECT_EQ(out.force_n.norm(), 0.0);
}

TEST(Direct, FollowsAScaledAndTurnedMapping) {
  MappingConfig config;
  config.position_scale = 10.0;
  config.force_scale = 0.1;
  config.q_WD = Eigen::AngleAxisd(M_PI / 2.0, Vector3d::UnitX());  // the device's z points to −y of the world
  const Mapping mapping(config);
  Direct direct(300.0, 0.0, mapping, {placed(Plane{})});
  const auto out = direct.render(at({0.0, 0.0, 0.004}));
  // 4 mm beyond the wall at the device is 4 cm in the world; the gain is at the device: 1.2 N back along −z.
  EXPECT_LT((out.force_n - Vector3d(0.0, 0.0, -1.2)).norm(), 1e-12);
}

TEST(Direct, PushesRadiallyOutOfASphere) {
  const Mapping mapping{MappingConfig{}};
  Direct direct(500.0, 0.0, mapping, {placed(Sphere{0.03})});
  const Vector3d inward = Vector3d(1.0, 2.0, -0.5).normalized();
  (void)direct.render(at(0.031 * inward));
  const auto out = direct.render(at(0.028 * inward));
  EXPECT_LT((out.force_n - 1.0 * inward).norm(), 1e-6);
}

TEST(Direct, SlidesAroundASphereWithoutSticking) {
  const Mapping mapping{MappingConfig{}};
  Direct direct(500.0, 0.0, mapping, {placed(Sphere{0.03})});
  for (int k = 0; k <= 1000; ++k) {
    const double angle = 1.5 * static_cast<double>(k) * 1e-3;
    const Vector3d direction(std::cos(angle), std::sin(angle), 0.0);
    const auto out = direct.render(at(0.028 * direction));
    if (k > 0) {
      ASSERT_NEAR(out.force_n.norm(), 1.0, 0.01);
      ASSERT_GT(out.force_n.normalized().dot(direction), 0.999);
    }
  }
}

TEST(Direct, DoesNotPopThroughAThinBox) {
  const Mapping mapping{MappingConfig{}};
  Direct direct(500.0, 0.0, mapping, {placed(Box{{0.05, 0.002, 0.05}})});
  // From above right through a 4 mm plate, 1 mm per tick, and 10 mm out at the other side.
  Vector3d force = Vector3d::Zero();
  for (int k = 0; k <= 22; ++k) force = direct.render(at({0.0, 0.010 - 0.001 * k, 0.0})).force_n;
  EXPECT_NEAR(force.y(), 500.0 * 0.014, 1e-6) << "still held by the upper face";
}

TEST(Direct, LetsGoWhenTheHandGoesRoundTheEdge) {
  const Mapping mapping{MappingConfig{}};
  Direct direct(500.0, 0.0, mapping, {placed(Box{{0.02, 0.002, 0.02}})});
  (void)direct.render(at({0.0, 0.003, 0.0}));
  for (int k = 0; k <= 40; ++k) (void)direct.render(at({0.001 * k, 0.001, 0.0}));
  const auto out = direct.render(at({0.04, 0.001, 0.0}));
  EXPECT_LT(out.force_n.norm(), 1e-6);
}

TEST(Direct, IsHeldByBothWallsOfACorner) {
  const Mapping mapping{MappingConfig{}};
  PlacedShape side = placed(Plane{});
  side.q_WB = Eigen::AngleAxisd(-M_PI / 2.0, Vector3d::UnitZ());  // its outside is +x
  Direct direct(100.0, 0.0, mapping, {placed(Plane{}), side});
  (void)direct.render(at({0.01, 0.01, 0.0}));
  const auto out = direct.render(at({-0.003, -0.002, 0.0}));
  EXPECT_LT((out.force_n - Vector3d(0.3, 0.2, 0.0)).norm(), 1e-9);
}

TEST(RemoteVirtualCoupling, IsASpringDamperToTheNewestProxy) {
  haptic::RemoteVirtualCoupling law(200.0, 0.5);
  RenderInput input = at({0.0, -0.004, 0.0}, {0.1, -0.2, 0.0});
  input.proxy.valid = true;
  input.proxy.position_m = {0.001, 0.0, 0.0};
  input.proxy.velocity_m_s = {0.1, 0.0, 0.0};
  const auto out = law.render(input);
  EXPECT_LT((out.force_n - Vector3d(0.2, 0.8 + 0.1, 0.0)).norm(), 1e-12);
  EXPECT_EQ(out.proxy_position_m, input.proxy.position_m);
}

TEST(RemoteVirtualCoupling, HasNoDragWhileTheProxyFollows) {
  haptic::RemoteVirtualCoupling law(200.0, 5.0);
  RenderInput input = at({0.01, 0.0, 0.0}, {0.3, 0.0, 0.0});
  input.proxy.valid = true;
  input.proxy.position_m = input.position_m;
  input.proxy.velocity_m_s = input.velocity_m_s;
  EXPECT_EQ(law.render(input).force_n.norm(), 0.0);
}

TEST(RemoteVirtualCoupling, IsZeroBeforePhysicsHasAnswered) {
  haptic::RemoteVirtualCoupling law(200.0, 0.5);
  EXPECT_EQ(law.render(at({0.01, 0.0, 0.0})).force_n.norm(), 0.0);
}

TEST(RemoteVirtualCoupling, DampsTheAbsoluteVelocityInThePapersForm) {
  haptic::RemoteVirtualCoupling law(200.0, 0.5, true);
  RenderInput input = at({0.0, -0.004, 0.0}, {0.1, -0.2, 0.0});
  input.proxy.valid = true;
  input.proxy.velocity_m_s = {5.0, 5.0, 5.0};
  EXPECT_LT((law.render(input).force_n - Vector3d(-0.05, 0.8 + 0.1, 0.0)).norm(), 1e-12);
}

/// A force that physics made, in the first cycle that sees it.
RenderInput server_force(double force_n, double period_s) {
  RenderInput input = at(Vector3d::Zero());
  input.proxy.valid = true;
  input.proxy.fresh = true;
  input.proxy.period_s = period_s;
  input.proxy.server_force_n = {0.0, force_n, 0.0};
  return input;
}

/// The force in each of `cycles` cycles from the arrival on.
std::vector<double> ramp(haptic::Interpolation& law, RenderInput input, int cycles) {
  std::vector<double> out;
  for (int j = 0; j < cycles; ++j) {
    out.push_back(law.render(input).force_n.y());
    input.proxy.fresh = false;
  }
  return out;
}

// Eq. (1): f_j = f_{i−1} + (f_i − f_{i−1})·(j mod N)/N. Physics at 50 Hz, haptics at 1 kHz: N is 20, not the 0.05 that
// the printed eq. (2), T_h/T_s, gives.
TEST(Interpolation, RampsOverNTicksPerStep) {
  haptic::Interpolation law("interpolation", true);
  (void)ramp(law, server_force(1.0, 0.020), 20);
  const auto forces = ramp(law, server_force(3.0, 0.020), 20);
  for (int j = 0; j < 20; ++j) EXPECT_NEAR(forces[j], 1.0 + 2.0 * j / 20.0, 1e-12) << j;
  EXPECT_NEAR(law.render(server_force(3.0, 0.020)).force_n.y(), 3.0, 1e-12) << "the next force begins where it ends";
}

TEST(Interpolation, WaitsAtTheNewestForceWhenTheNextIsLate) {
  haptic::Interpolation law("interpolation", true);
  (void)ramp(law, server_force(1.0, 0.005), 5);
  const auto forces = ramp(law, server_force(3.0, 0.005), 12);
  for (int j = 5; j < 12; ++j) EXPECT_EQ(forces[j], 3.0);
}

TEST(Interpolation, IsContinuousInTheImprovedFormWhenAForceComesEarly) {
  haptic::Interpolation paper("interpolation", true);
  haptic::Interpolation improved("interpolation", false);
  for (auto* law : {&paper, &improved}) (void)ramp(*law, server_force(4.0, 0.020), 3);
  const double before = 3.0 / 20.0 * 4.0;
  EXPECT_EQ(ramp(paper, server_force(4.0, 0.020), 1)[0], 4.0) << "the published ramp jumps to f_{i-1}";
  EXPECT_NEAR(ramp(improved, server_force(4.0, 0.020), 1)[0], before + (4.0 - before) / 20.0, 1e-12);
}

TEST(Interpolation, GivesTheNewestForceAtOnceWhenPhysicsIsAsFastAsTheLoop) {
  haptic::Interpolation law("interpolation", false);
  EXPECT_EQ(ramp(law, server_force(2.0, 0.001), 1)[0], 2.0);
}

TEST(Interpolation, BeginsAtZeroForceAfterResetAndWithoutAValidProxy) {
  for (const bool by_reset : {true, false}) {
    haptic::Interpolation law("interpolation", true);
    (void)ramp(law, server_force(5.0, 0.005), 8);
    if (by_reset) {
      law.reset();
    } else {
      EXPECT_EQ(law.render(at(Vector3d::Zero())).force_n.norm(), 0.0);
    }
    EXPECT_EQ(law.render(server_force(5.0, 0.005)).force_n.norm(), 0.0) << "the old force is forgotten";
  }
}

class VirtualCouplingOnAPlane : public testing::Test {
 protected:
  /// Holds the tip there for a second.
  haptic::RenderOutput settle(haptic::VirtualCoupling& law, const Vector3d& tip) {
    haptic::RenderOutput out;
    for (int i = 0; i < 1000; ++i) out = law.render(at(tip));
    return out;
  }
  Mapping mapping_{MappingConfig{}};
};

TEST_F(VirtualCouplingOnAPlane, PushesBackByTheStretchOfItsOneSpring) {
  haptic::VirtualCoupling law(200.0, 4.0, 0.02, false, mapping_, {placed(Plane{})});
  (void)law.render(at({0.0, 0.01, 0.0}));
  const auto out = settle(law, {0.0, -0.003, 0.0});
  EXPECT_LT((out.force_n - Vector3d(0.0, 0.6, 0.0)).norm(), 1e-6);
  EXPECT_NEAR(out.proxy_position_m.y(), 0.0, 1e-9);
}

TEST_F(VirtualCouplingOnAPlane, FollowsInFreeAirWithoutDragUnlessThePapersFormIsAsked) {
  for (const bool paper : {false, true}) {
    haptic::VirtualCoupling law(200.0, 4.0, 0.02, paper, mapping_, {placed(Plane{})});
    haptic::RenderOutput out;
    for (int i = 0; i < 2000; ++i) out = law.render(at({1e-4 * i, 0.05, 0.0}, {0.1, 0.0, 0.0}));
    // Absolute damping: the spring holds back B·v = 0.4 N, less K·h·v = 0.02 N for the step that the proxy has just
    // made, and the hand's own damper 0.4 N again.
    EXPECT_NEAR(out.force_n.x(), paper ? -0.78 : 0.0, 1e-6);
  }
}

TEST_F(VirtualCouplingOnAPlane, IsOneImplicitEulerStepPerCycle) {
  haptic::VirtualCoupling law(300.0, 2.0, 0.05, false, mapping_, {placed(Plane{})});
  (void)law.render(at({0.0, 0.05, 0.0}));
  const auto out = law.render(at({0.0, 0.06, 0.0}, {0.0, 0.5, 0.0}));
  const double h = 1e-3, v = h * (300.0 * 0.01 + 2.0 * 0.5) / (0.05 + h * 2.0 + h * h * 300.0);
  EXPECT_NEAR(out.proxy_velocity_m_s.y(), v, 1e-12);
  EXPECT_NEAR(out.proxy_position_m.y(), 0.05 + h * v, 1e-12);
  EXPECT_NEAR(out.force_n.y(), 300.0 * (0.05 + h * v - 0.06) + 2.0 * (v - 0.5), 1e-9);
}

TEST_F(VirtualCouplingOnAPlane, StaysBoundedWhereTheExplicitStepExplodes) {
  // h²·K = 1e-6·1000 = 1e-3 kg: the explicit step needs m > 0.25 g, and 0.2 g is less.
  double peak_n[2] = {};
  for (const bool paper : {false, true}) {
    haptic::VirtualCoupling law(1000.0, 0.0, 0.0002, paper, mapping_, {});
    (void)law.render(at({0.0, 0.05, 0.0}));
    for (int i = 0; i < 60; ++i) {
      peak_n[paper ? 1 : 0] = std::max(peak_n[paper ? 1 : 0], law.render(at({0.0, 0.051, 0.0})).force_n.norm());
    }
  }
  EXPECT_LE(peak_n[0], 1.0 + 1e-9);
  EXPECT_GT(peak_n[1], 1e6);
}

TEST_F(VirtualCouplingOnAPlane, FeelsTheSameAtEveryScale) {
  Vector3d first = Vector3d::Zero();
  for (const double scale : {0.1, 1.0, 10.0}) {
    MappingConfig config;
    config.position_scale = scale;
    config.force_scale = 1.0 / scale;
    const Mapping mapping(config);
    haptic::VirtualCoupling law(200.0, 1.0, 0.02 / (scale * scale), false, mapping, {placed(Plane{})});
    (void)law.render(at({0.0, 0.01, 0.0}));
    haptic::RenderOutput out;
    for (int i = 0; i < 15; ++i) out = law.render(at({0.0, -0.002, 0.0}, {0.0, -0.1, 0.0}));
    if (scale == 0.1) first = out.force_n;
    EXPECT_LT((out.force_n - first).norm(), 1e-9) << scale;
    EXPECT_GT(first.norm(), 0.1);
  }
}

TEST(Methods, AreFoundByTheirName) {
  for (const auto& row : haptic::registered_methods()) {
    const Mapping mapping{MappingConfig{}};
    const auto instance = row.make({100.0, 1.0, mapping, {placed(Plane{})}});
    EXPECT_EQ(instance->name(), row.name);
    EXPECT_EQ(instance->needs_physics(), row.needs_physics);
    EXPECT_EQ(haptic::find_method(row.name), &row);
  }
  EXPECT_EQ(haptic::find_method("telekinesis"), nullptr);
}

}  // namespace
