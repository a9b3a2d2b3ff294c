/// The analytic engine beside closed forms. Implicit Euler leaves two kinds of quantities:
///  - exact at every step, whatever its length: forces and places of a proxy that a body holds, speeds under a constant
///    force (friction included), rest. They are the closed form's to 1e-6, relative (in fact to rounding).
///  - of first order in the step: places and times of what moves. The error halves with the step, and what it tends to
///  is
///    the closed form: extrapolated from a few steps (Romberg) it is met to 1e-6, relative.
#include <algorithm>
#include <cmath>
#include <functional>
#include <numbers>
#include <vector>

#include <gtest/gtest.h>

#include "physics_node/analytic/analytic_world.hpp"

namespace {

using Eigen::Vector3d;
using physics::AnalyticWorld;
using physics::ProxyParameters;
using physics::ProxyReadout;
using physics::ProxyTarget;
using rtbus::shapes::PlacedShape;

constexpr double kRelative = 1e-6;
constexpr double kMass_kg = 0.1;
constexpr double kGravity_m_s2 = 9.81;

void expect_closed_form(double value, double exact, const char* what) {
  EXPECT_NEAR(value, exact, kRelative * std::abs(exact)) << what;
}

PlacedShape placed(rtbus::shapes::Shape shape, double friction = 0.0) {
  PlacedShape result;
  result.shape = shape;
  result.friction = friction;
  return result;
}

AnalyticWorld world_of(std::vector<PlacedShape> shapes, const Vector3d& start_m, double radius_m = 0.0) {
  AnalyticWorld world(std::move(shapes));
  ProxyParameters parameters;
  parameters.device = "haptic0";
  parameters.mass_kg = kMass_kg;
  parameters.radius_m = radius_m;
  parameters.friction = 1.0;
  parameters.position_m = start_m;
  world.add_proxy(parameters);
  return world;
}

/// A force alone: neither spring nor damper.
ProxyTarget pushed(const Vector3d& force_n) {
  ProxyTarget target;
  target.force_n = force_n;
  return target;
}

ProxyReadout run(AnalyticWorld& world, const ProxyTarget& target, double step_s, int steps) {
  for (int i = 0; i < steps; ++i) {
    world.set_proxy_target(0, target);
    world.step(step_s);
  }
  return world.proxy(0);
}

/// A figure of a run with a step of 2⁻ˡᵉᵛᵉˡ of the coarsest.
using Figure = std::function<double(int level)>;

/// First order as claimed, and the closed form where it leads to.
void expect_first_order(const Figure& figure, double exact, const char* what) {
  std::vector<double> row;
  double order = 0.0;
  for (int level = 0; level < 5; ++level) {
    row.push_back(figure(level));
    if (level > 0) order = std::log2(std::abs((row[level - 1] - exact) / (row[level] - exact)));
  }
  EXPECT_GT(std::abs(row.back() - exact), 1e-9 * std::abs(exact)) << what << " is exact already: nothing to converge";
  EXPECT_NEAR(order, 1.0, 0.05) << what;
  // Romberg for errors h, h², h³, …
  for (std::size_t k = 1; k < row.size(); ++k) {
    const double factor = std::pow(2.0, static_cast<double>(k));
    for (std::size_t i = row.size() - 1; i >= k; --i) row[i] = (factor * row[i] - row[i - 1]) / (factor - 1.0);
  }
  expect_closed_form(row.back(), exact, what);
}

TEST(AnalyticClosedForm, TheWallPushesBackAsSpringAndDamperSayWhateverTheHandDoes) {
  constexpr double kStiffness = 500.0, kDamping = 2.0, kRadius_m = 0.005;
  constexpr double kDepth_m = 0.008, kSwing_m = 0.003, kRate_rad_s = 12.0;
  for (const double step_s : {1e-4, 1e-3, 0.02, 0.2}) {
    AnalyticWorld world = world_of({placed(rtbus::shapes::Plane{})}, {0, kRadius_m, 0}, kRadius_m);
    for (int i = 0; i < 500; ++i) {
      const double phase = kRate_rad_s * i * step_s;
      const double y_m = kRadius_m - kDepth_m + kSwing_m * std::sin(phase);
      const double speed_m_s = kSwing_m * kRate_rad_s * std::cos(phase);
      const ProxyReadout proxy =
          run(world, {{0, y_m, 0}, {0, speed_m_s, 0}, kStiffness, kDamping, Vector3d::Zero()}, step_s, 1);
      ASSERT_NEAR(proxy.position_m.y(), kRadius_m, kRelative * kRadius_m) << step_s << ' ' << i;
      const double exact_n = kStiffness * (kRadius_m - y_m) - kDamping * speed_m_s;
      ASSERT_NEAR(proxy.contact_force_n.y(), exact_n, kRelative * exact_n) << step_s << ' ' << i;
    }
  }
}

TEST(AnalyticClosedForm, FallsOntoTheWallAsADampedOscillatorAndStaysThere) {
  // From rest at 20 mm, pulled towards −5 mm; before it touches: y = −5 mm + 25 mm·e^(−δt)(cos ωt + δ/ω·sin ωt).
  constexpr double kStiffness = 200.0, kDamping = 1.0, kHeight_m = 0.02, kTarget_m = -0.005;
  const double decay = kDamping / (2.0 * kMass_kg);
  const double omega = std::sqrt(kStiffness / kMass_kg - decay * decay);
  const auto exact_m = [&](double t) {
    return kTarget_m +
           (kHeight_m - kTarget_m) * std::exp(-decay * t) * (std::cos(omega * t) + decay / omega * std::sin(omega * t));
  };
  double low_s = 0.0, high_s = std::numbers::pi / omega;  // it touches within half a period
  for (int i = 0; i < 100; ++i) (exact_m(0.5 * (low_s + high_s)) > 0.0 ? low_s : high_s) = 0.5 * (low_s + high_s);
  const ProxyTarget target{{0, kTarget_m, 0}, Vector3d::Zero(), kStiffness, kDamping, Vector3d::Zero()};
  const double before_s = 0.8 * low_s;
  expect_first_order(
      [&](int level) {
        AnalyticWorld world = world_of({placed(rtbus::shapes::Plane{})}, {0, kHeight_m, 0});
        const int steps = 400 << level;
        return run(world, target, before_s / steps, steps).position_m.y();
      },
      exact_m(before_s), "height before it touches");
  expect_first_order(
      [&](int level) {
        // The time at which it touches, between two steps by their straight line.
        AnalyticWorld world = world_of({}, {0, kHeight_m, 0});
        const double step_s = low_s / (400 << level);
        for (int i = 1;; ++i) {
          const double before_m = world.proxy(0).position_m.y();
          const double after_m = run(world, target, step_s, 1).position_m.y();
          if (after_m <= 0.0) return step_s * (i - 1 + before_m / (before_m - after_m));
        }
      },
      low_s, "time of the touch");
  AnalyticWorld world = world_of({placed(rtbus::shapes::Plane{})}, {0, kHeight_m, 0});
  const ProxyReadout rest = run(world, target, 1e-3, static_cast<int>(low_s / 1e-3) + 10);
  EXPECT_NEAR(rest.position_m.y(), 0.0, kRelative * kHeight_m);  // inelastic: it does not bounce
  expect_closed_form(rest.contact_force_n.y(), kStiffness * -kTarget_m, "force at rest");
}

TEST(AnalyticClosedForm, FallsFreelyUnderAConstantForce) {
  constexpr double kEnd_s = 0.3;
  const ProxyTarget weight = pushed({0, -kMass_kg * kGravity_m_s2, 0});
  for (const int steps : {3, 30, 3000}) {
    AnalyticWorld world = world_of({placed(rtbus::shapes::Plane{})}, {0, 1, 0});
    const ProxyReadout proxy = run(world, weight, kEnd_s / steps, steps);
    expect_closed_form(proxy.velocity_m_s.y(), -kGravity_m_s2 * kEnd_s, "speed, exact at any step");
    // x⁺ = x + h·v⁺ is ahead of the parabola by g·h·t/2, no more and no less.
    const double ahead_m = 0.5 * kGravity_m_s2 * (kEnd_s / steps) * kEnd_s;
    expect_closed_form(proxy.position_m.y(), 1.0 - 0.5 * kGravity_m_s2 * kEnd_s * kEnd_s - ahead_m, "height");
  }
  expect_first_order(
      [&](int level) {
        AnalyticWorld world = world_of({}, {0, 1, 0});
        return run(world, weight, kEnd_s / (10 << level), 10 << level).position_m.y();
      },
      1.0 - 0.5 * kGravity_m_s2 * kEnd_s * kEnd_s, "height");
}

/// A block on a floor with friction: a proxy under its weight, pushed along the floor.
struct Block {
  double friction = 0.4;
  double weight_n = kMass_kg * kGravity_m_s2;
  double radius_m = 0.01;

  [[nodiscard]] AnalyticWorld on_floor() const {
    return world_of({placed(rtbus::shapes::Plane{}, friction)}, {0, radius_m, 0}, radius_m);
  }
  [[nodiscard]] ProxyTarget push(double force_n) const { return pushed({force_n, -weight_n, 0}); }
};

TEST(AnalyticClosedForm, ABlockWithFrictionSpeedsUpUnderAConstantPush) {
  constexpr double kPush_n = 1.0, kEnd_s = 0.25;
  const Block block;
  const double acceleration = (kPush_n - block.friction * block.weight_n) / kMass_kg;
  for (const int steps : {5, 250, 2500}) {
    AnalyticWorld world = block.on_floor();
    const ProxyReadout proxy = run(world, block.push(kPush_n), kEnd_s / steps, steps);
    expect_closed_form(proxy.velocity_m_s.x(), acceleration * kEnd_s, "speed, exact at any step");
    expect_closed_form(proxy.contact_force_n.y(), block.weight_n, "what carries it");
    expect_closed_form(proxy.contact_force_n.x(), -block.friction * block.weight_n, "friction");
    expect_closed_form(proxy.position_m.y(), block.radius_m, "height");
  }
  expect_first_order(
      [&](int level) {
        AnalyticWorld world = block.on_floor();
        return run(world, block.push(kPush_n), kEnd_s / (20 << level), 20 << level).position_m.x();
      },
      0.5 * acceleration * kEnd_s * kEnd_s, "way");
}

TEST(AnalyticClosedForm, ABlockStaysWhereFrictionHoldsIt) {
  const Block block;
  for (const double share : {0.5, 0.999}) {
    AnalyticWorld world = block.on_floor();
    const double push_n = share * block.friction * block.weight_n;
    const ProxyReadout proxy = run(world, block.push(push_n), 1e-3, 1000);
    EXPECT_EQ(proxy.position_m.x(), 0.0) << share;
    expect_closed_form(proxy.contact_force_n.x(), -push_n, "friction");
  }
}

TEST(AnalyticClosedForm, ABlockThatIsLetGoSlidesToItsStop) {
  // Pushed for so long that its stop falls onto a step: v = a·t₁, stops after v/(μg), v²/(2μg) further on. What it is
  // ahead by while it speeds up, h·v/2, it loses while it slows down.
  const Block block;
  constexpr double kPushed_s = 0.1, kSliding_s = 0.15;
  const double braking = block.friction * kGravity_m_s2;
  const double push_n = kMass_kg * braking * (1.0 + kSliding_s / kPushed_s);
  const double speed_m_s = braking * kSliding_s;
  for (const int pushing : {10, 100, 1000}) {
    AnalyticWorld world = block.on_floor();
    const double step_s = kPushed_s / pushing;
    const ProxyReadout fastest = run(world, block.push(push_n), step_s, pushing);
    expect_closed_form(fastest.velocity_m_s.x(), speed_m_s, "speed when it is let go");
    expect_closed_form(fastest.position_m.x(), 0.5 * speed_m_s * (kPushed_s + step_s), "way, half a step ahead");
    const auto sliding = static_cast<int>(std::lround(kSliding_s / step_s));
    const ProxyReadout almost = run(world, block.push(0.0), step_s, sliding - 1);
    expect_closed_form(almost.velocity_m_s.x(), braking * step_s, "speed one step before its stop");
    const ProxyReadout stopped = run(world, block.push(0.0), step_s, 1);
    EXPECT_NEAR(stopped.velocity_m_s.x(), 0.0, kRelative * speed_m_s);
    expect_closed_form(stopped.position_m.x(), 0.5 * speed_m_s * (kPushed_s + kSliding_s), "way, exact at any step");
    expect_closed_form(run(world, block.push(0.0), step_s, 100).position_m.x(), stopped.position_m.x(), "it stays");
  }
}

TEST(AnalyticClosedForm, ASphereHoldsTheProxyAtItsNearestPointWithTheForceOfTheSpring) {
  constexpr double kStiffness = 400.0, kRadius_m = 0.05, kTool_m = 0.005, kDepth_m = 0.006;
  for (const double angle : {0.0, 0.7, 2.4}) {
    const Vector3d outwards(std::sin(angle), std::cos(angle), 0.0);
    AnalyticWorld world = world_of({placed(rtbus::shapes::Sphere{kRadius_m})}, {0.02, kRadius_m + 0.01, 0}, kTool_m);
    const double reach_m = kRadius_m + kTool_m;
    const ProxyTarget target{(reach_m - kDepth_m) * outwards, Vector3d::Zero(), kStiffness,
                             2.0 * std::sqrt(kStiffness * kMass_kg), Vector3d::Zero()};
    const ProxyReadout proxy = run(world, target, 1e-3, 20000);
    EXPECT_NEAR((proxy.position_m - reach_m * outwards).norm(), 0.0, kRelative * reach_m) << angle;
    expect_closed_form(proxy.contact_force_n.norm(), kStiffness * kDepth_m, "force");
    EXPECT_NEAR((proxy.contact_force_n.normalized() - outwards).norm(), 0.0, kRelative) << angle;
  }
}

TEST(AnalyticClosedForm, SlidesOffASphereWhereItsSpeedLiftsItOff) {
  // Under its weight, from rest at θ₀ from the top and without friction, it leaves a sphere at cos θ = ⅔·cos θ₀.
  constexpr double kReach_m = 0.5, kStart_rad = 0.3;
  const ProxyTarget weight = pushed({0, -kMass_kg * kGravity_m_s2, 0});
  expect_first_order(
      [&](int level) {
        AnalyticWorld world = world_of({placed(rtbus::shapes::Sphere{kReach_m})},
                                       kReach_m * Vector3d(std::sin(kStart_rad), std::cos(kStart_rad), 0));
        const double step_s = 2e-3 / (1 << level);
        double force_n[2] = {1.0, 1.0}, cosine[2] = {1.0, 1.0};
        for (int i = 0; i < (2000 << level); ++i) {
          const ProxyReadout proxy = run(world, weight, step_s, 1);
          if (proxy.contacts == 0) break;
          force_n[0] = std::exchange(force_n[1], proxy.contact_force_n.norm());
          cosine[0] = std::exchange(cosine[1], proxy.position_m.y() / proxy.position_m.norm());
        }
        // The force reaches zero between two steps: where, by the straight line through the last two.
        return cosine[1] - force_n[1] * (cosine[1] - cosine[0]) / (force_n[1] - force_n[0]);
      },
      2.0 / 3.0 * std::cos(kStart_rad), "cosine where it leaves");
}

}  // namespace
