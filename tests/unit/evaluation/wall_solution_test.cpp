// The closed form of the wall, held against energy, against known oscillators and against brute force.
#include "tools/evaluation/work_precision/wall_solution.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

namespace {

using tools::HandPage;
using tools::WallMoment;
using tools::WallParameters;
using tools::WallSolution;

TEST(WallSolution, WithoutFrictionIsAParabolaAndAHalfSine) {
  WallParameters p;
  p.viscous_n_s_per_m = p.coulomb_n = 0.0;
  const WallSolution wall(p, 0.02, {}, 0.2);
  const double fall_s = std::sqrt(2 * 0.02 / 9.81);
  EXPECT_NEAR(wall.at(0.05).height_m, 0.02 - 0.5 * 9.81 * 0.05 * 0.05, 1e-15);
  // In the wall: y = −d + (d²ω² + v²)^½/ω · …; the lowest point follows from the energy.
  const double speed = 9.81 * fall_s, sag_m = 0.041 * 9.81 / 200.0;
  const double omega = std::sqrt(200.0 / 0.041);
  const double lowest_m = -sag_m - std::hypot(sag_m, speed / omega);
  double seen_m = 0.0;
  for (double t = fall_s; t < 0.12; t += 1e-6) seen_m = std::min(seen_m, wall.at(t).height_m);
  EXPECT_NEAR(seen_m, lowest_m, 1e-9);
}

TEST(WallSolution, RestsWhereFrictionHoldsAndNeverMakesEnergy) {
  WallParameters p;
  p.damping_n_s_per_m = 0.02;
  const WallSolution wall(p, 0.02, {}, 3.0);
  const double weight_n = p.mass_kg * p.gravity_m_s2;
  const WallMoment rest = wall.at(3.0);
  EXPECT_EQ(rest.velocity_m_s, 0.0);
  EXPECT_LE(std::abs(rest.force_n - weight_n), p.coulomb_n);
  EXPECT_GT(wall.events(), 8u);  // bounces
  double energy_j = weight_n * 0.02;
  for (double t = 0.0; t < 3.0; t += 1e-4) {
    const WallMoment at = wall.at(t);
    const double depth_m = std::max(0.0, -at.height_m);
    const double now_j = 0.5 * p.mass_kg * at.velocity_m_s * at.velocity_m_s + weight_n * at.height_m +
                         0.5 * p.stiffness_n_per_m * depth_m * depth_m;
    EXPECT_LE(now_j, energy_j + 1e-12);
    energy_j = now_j;
  }
}

TEST(WallSolution, IsWhatAVeryFineIntegrationTendsTo) {
  WallParameters p;
  p.stiffness_n_per_m = 500.0;
  p.damping_n_s_per_m = 1.0;
  p.hand_stiffness_n_per_m = 300.0;
  p.hand_damping_n_s_per_m = 3.0;
  p.hand_mass_kg = 0.08;
  const std::vector<HandPage> hand = tools::push_pages(0.02, -0.025, 0.05, 0.1);
  const WallSolution wall(p, 0.02, hand, 1.0);
  double before_m = 0.0;
  for (const double h : {4e-6, 1e-6}) {
    double y = 0.02, v = 0.0, worst_m = 0.0;
    std::size_t page = 0;
    const double m = p.mass_kg + p.hand_mass_kg;
    for (int i = 0; i < static_cast<int>(1.0 / h); ++i) {
      const double t = i * h;
      while (page + 1 < hand.size() && hand[page + 1].begin_s <= t) ++page;
      const double u = t - hand[page].begin_s;
      double goal_m = 0.0, goal_m_s = 0.0;
      for (int k = 4; k >= 0; --k) {
        goal_m_s = goal_m_s * u + goal_m;
        goal_m = goal_m * u + hand[page].position_m[static_cast<std::size_t>(k)];
      }
      double force = -p.mass_kg * p.gravity_m_s2 - p.viscous_n_s_per_m * v + p.hand_stiffness_n_per_m * (goal_m - y) +
                     p.hand_damping_n_s_per_m * (goal_m_s - v);
      if (y < 0.0) force += std::max(0.0, -p.stiffness_n_per_m * y - p.damping_n_s_per_m * v);
      const double momentum = m * v + h * force, friction = h * p.coulomb_n;
      v = std::abs(momentum) <= friction ? 0.0 : (momentum - std::copysign(friction, momentum)) / m;
      y += h * v;
      worst_m = std::max(worst_m, std::abs(y - wall.at(t + h).height_m));
    }
    if (before_m > 0.0) {
      EXPECT_NEAR(before_m / worst_m, 4.0, 0.1);  // the integration is of first order, and errs alone
    }
    before_m = worst_m;
  }
  EXPECT_LT(before_m, 5e-8);
}

TEST(WallSolution, PagesOfAPushJoinSmoothly) {
  const std::vector<HandPage> hand = tools::push_pages(0.02, -0.025, 0.05, 0.1);
  ASSERT_EQ(hand.size(), 4u);
  const auto at = [](const HandPage& page, double t) {
    double x = 0.0, v = 0.0;
    for (int k = 4; k >= 0; --k) {
      v = v * t + x;
      x = x * t + page.position_m[static_cast<std::size_t>(k)];
    }
    return std::pair{x, v};
  };
  for (std::size_t i = 0; i + 1 < hand.size(); ++i) {
    const auto [x0, v0] = at(hand[i], hand[i + 1].begin_s - hand[i].begin_s);
    const auto [x1, v1] = at(hand[i + 1], 0.0);
    EXPECT_NEAR(x0, x1, 1e-15);
    EXPECT_NEAR(v0, v1, 1e-13);
  }
  EXPECT_NEAR(at(hand[3], 1.0).first, -0.005, 1e-15);
}

}  // namespace
