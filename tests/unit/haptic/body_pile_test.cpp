/// How a body in a pile is taken to move between two answers.
#include "haptic_node/rendering/body_pile.hpp"

#include <gtest/gtest.h>

#include "haptic_node/rendering/contact_solver.hpp"

namespace {

using Eigen::Vector3d;
using haptic::PileBody;

constexpr double kMobility = 0.01, kHand_m_s = 0.02;
const Vector3d kPush(0, 0, -0.5), kSpeed(0, 0, -0.01);

PileBody told() {
  PileBody pile;
  pile.set_mobility(kMobility);
  pile.learn(kPush, kSpeed, kHand_m_s);
  return pile;
}

TEST(PileBody, GoesOnAsItWentUnderTheSamePushAndFasterUnderMore) {
  const PileBody pile = told();
  EXPECT_NEAR((pile.way_m(0.1 * kPush, 0.1) - 0.1 * kSpeed).norm(), 0.0, 1e-12);
  EXPECT_NEAR(pile.way_m(0.1 * 1.4 * kPush, 0.1).z(), -0.1 * (0.01 + 0.2 * kMobility), 1e-12);
}

TEST(PileBody, DoesNotComeBackWhenThePushGoes) {
  PileBody pile = told();
  pile.learn(2.0 * kPush, Vector3d::Zero(), kHand_m_s);
  EXPECT_NEAR(pile.way_m(Vector3d::Zero(), 0.1).norm(), 0.0, 1e-12);
  EXPECT_EQ(pile.advance_m_s({0, 0, 1}), 0.0);
}

TEST(PileBody, DoesNotSlideOnAsFastAsItSlipped) {
  PileBody pile = told();
  pile.learn(kPush, 20.0 * kSpeed, kHand_m_s);
  EXPECT_NEAR(pile.speed_m_s().norm(), kHand_m_s, 1e-12);
}

TEST(PileBody, ComesToRestWithoutNews) {
  PileBody pile = told();
  for (int i = 0; i < 100; ++i) pile.brake(0.9);
  EXPECT_LT(pile.way_m(10.0 * kPush, 0.1).norm(), 1e-5);
}

// The contact solver with such a pile as one side: the proxy and the pile move as the pile's law says, from no push to
// a hard one.
TEST(PileBody, IsSolvedWithTheProxyInOneRow) {
  const PileBody pile = told();
  constexpr double kH = 1e-3, kMass = 0.01;
  const Vector3d normal(0, 0, 1);
  for (const double towards_m_s : {-0.02, 0.0, 0.01, 0.05, 1.0}) {
    haptic::SolverBody proxy;
    proxy.inverse_mass_per_kg = 1.0 / kMass;
    proxy.velocity_m_s = -towards_m_s * normal;
    haptic::SolverContact row;
    row.normal = normal;
    pile.fill_row(Vector3d::Zero(), kH, row);
    haptic::prepare_contacts(&proxy, &row, 1);
    haptic::relax_contacts(&proxy, &row, 1, 12, haptic::kTolerance_m_s);
    const double impulse = row.impulse_n_s.dot(normal);
    const double surface_m_s = pile.way_m(-row.impulse_n_s, kH).z() / kH;
    if (impulse > 0.0) {
      EXPECT_NEAR(proxy.velocity_m_s.z(), surface_m_s, 1e-9) << towards_m_s;
    } else {
      EXPECT_GE(proxy.velocity_m_s.z(), surface_m_s - 1e-12) << towards_m_s;
    }
    EXPECT_EQ(impulse > 0.0, towards_m_s > 0.0) << towards_m_s;
  }
}

}  // namespace
