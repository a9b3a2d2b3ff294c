/// What yields to the proxy, in the world of local_contact: what physics tells of it, and what becomes of that.
#include "haptic_node/rendering/yielding_bodies.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "haptic_node/rendering/local_world.hpp"
#include "rtbus/clock.hpp"
#include "tests/unit/haptic/held_world.hpp"

namespace {

using rtbus::ProxyContacts;

constexpr double kTickS = 1e-3, kHandN_m = 300.0, kHandNs_m = 0.5;
constexpr double kPhysicsS = 0.05;
constexpr double kSoftN_m = 90.0;

/// A soft body that fills x < 0 and bears a tool at `tool_x_m` with kSoftN_m times its depth.
ProxyContacts soft(double tool_x_m, std::uint64_t sample_ns, double told_n_per_m = kSoftN_m) {
  ProxyContacts out;
  out.device_sequence = 1;
  out.device_time_ns = sample_ns;
  out.step_s = kPhysicsS;
  out.yields = 1;
  out.yield_tool_m[0] = {tool_x_m, 0, 0};
  out.yield_reaction_n[0] = {std::max(0.0, -kSoftN_m * tool_x_m), 0, 0};
  out.yield_normal[0] = {1, 0, 0};
  out.yield_gap_m[0] = std::max(0.0, tool_x_m);
  out.yield_stiffness_n_per_m = told_n_per_m;
  return out;
}

struct YieldingBodiesTest : testing::Test, tests::HeldWorld {
  YieldingBodiesTest() : HeldWorld(kHandN_m, kHandNs_m) {}
};

TEST_F(YieldingBodiesTest, AreASpringInSeriesWithTheHands) {
  reset({0.002, 0, 0});
  world->take(soft(0.002, now_ns), now_ns);
  double force_n = 0.0;
  for (int i = 0; i <= 100; ++i) force_n = tick(0.002 - 1e-4 * i, -0.1);
  for (int i = 0; i < 50; ++i) force_n = tick(-0.008);
  const double due_n = 0.008 / (1.0 / kHandN_m + 1.0 / kSoftN_m);
  EXPECT_NEAR(force_n, due_n, 1e-3 * due_n);
  ASSERT_EQ(world->hand_impulses().entries().size(), 1U);
  EXPECT_EQ(world->hand_impulses().entries()[0].body, rtbus::kYieldingBodies);
  EXPECT_NEAR(world->hand_impulses().entries()[0].impulse_n_s.x(), -force_n * kTickS, 1e-12);
  for (int i = 0; i < 100; ++i) force_n = tick(0.001);
  EXPECT_EQ(force_n, 0.0);
}

/// The tool of physics: on a spring like the hand's to where the proxy was, pushed with what the hand felt then.
double settle(YieldingBodiesTest& test, double told_n_per_m) {
  constexpr double kHand = -0.008;
  test.reset({0.0, 0, 0});
  double force_n = 0.0, tool_m = 0.0;
  std::uint64_t sample_ns = test.now_ns;
  test.world->take(soft(0.0, sample_ns, told_n_per_m), test.now_ns);
  for (int step = 0; step < 20; ++step) {
    for (int i = 0; i < 50; ++i) force_n = test.tick(kHand);
    // The answer to the sample of a period ago.
    if (step > 0) test.world->take(soft(tool_m, sample_ns, told_n_per_m), test.now_ns);
    tool_m = (kHandN_m * test.world->position_m().x() - force_n) / (kHandN_m + kSoftN_m);
    sample_ns = test.now_ns;
  }
  return force_n;
}

TEST_F(YieldingBodiesTest, AreFeltAsTheyAreWhateverStiffnessIsTold) {
  const double due_n = 0.008 / (1.0 / kHandN_m + 1.0 / kSoftN_m);
  for (const double told : {0.0, 0.5 * kSoftN_m, kSoftN_m, 2.0 * kSoftN_m, 100.0 * kSoftN_m}) {
    EXPECT_NEAR(settle(*this, told), due_n, 1e-3 * due_n) << told;
  }
}

TEST_F(YieldingBodiesTest, AreMetWhereTheyWillBe) {
  // The tool goes on into the body at 0.02 m/s; a hand that does just that feels what is told for each instant.
  ProxyContacts ahead = soft(-0.001, now_ns);
  ahead.yields = 3;
  for (std::size_t i = 0; i < 3; ++i) {
    const double at_m = -0.001 - 0.05 * static_cast<double>(i) * 0.02;
    ahead.yield_after_s[i] = 0.05 * static_cast<double>(i);
    ahead.yield_tool_m[i] = {at_m, 0, 0};
    ahead.yield_reaction_n[i] = {0.1 + 2.0 * static_cast<double>(i * i), 0, 0};  // no spring of any stiffness
    ahead.yield_normal[i] = {1, 0, 0};
  }
  ahead.yield_stiffness_n_per_m = 1e4;  // the proxy goes with the tool
  reset({-0.001, 0, 0});
  world->take(ahead, now_ns);
  double force_n = 0.0;
  for (int i = 1; i <= 75; ++i) {
    const double due_n = i <= 50 ? 0.1 + 0.04 * i : 2.1 + 0.12 * (i - 50);
    force_n = tick(-0.001 - 2e-5 * i - due_n / kHandN_m, -0.02);
  }
  EXPECT_NEAR(force_n, 5.1, 0.15);
}

TEST_F(YieldingBodiesTest, HoldAcrossOnlyAsFarAsFrictionDoes) {
  ProxyContacts told = soft(-0.01, now_ns);
  told.yield_stiffness_across_n_per_m = kSoftN_m;
  told.yield_friction = 0.1;
  reset({-0.01, 0, 0});
  world->take(told, now_ns);
  Eigen::Vector3d force_n = Eigen::Vector3d::Zero();
  for (int i = 0; i < 100; ++i) force_n = tick(Eigen::Vector3d(-0.013, 0.0, 2e-4));
  EXPECT_NEAR(force_n.x(), 0.9, 0.01);
  EXPECT_NEAR(force_n.z(), -2e-4 / (1.0 / kSoftN_m + 1.0 / kHandN_m), 1e-3);
  for (int i = 0; i < 100; ++i) force_n = tick(Eigen::Vector3d(-0.013, 0.0, 0.02));
  EXPECT_NEAR(force_n.z(), -0.1 * force_n.x(), 1e-6);
}

/// What physics tells of a body that wavers by ±0.1 N under a hand that goes no deeper: least and most of the force in
/// the last second of three, and the mean of what the body is given.
struct Wavering {
  double least_n = 1e9, most_n = 0.0, given_n = 0.0, felt_n = 0.0;
};
Wavering wavering(YieldingBodiesTest& test, double rest, double along_m_s) {
  constexpr double kDepth = -0.004;
  Wavering out;
  test.reset({kDepth, 0, 0});
  for (int answer = 0; answer < 60; ++answer) {
    ProxyContacts told = soft(kDepth, test.now_ns);
    told.yield_reaction_n[0][0] += answer % 2 == 0 ? 0.1 : -0.1;
    told.yield_rest = rest;
    test.world->take(told, test.now_ns);
    for (int i = 0; i < 50; ++i) {
      const double force_n = test.tick({-0.006, 0, 0}, {0, along_m_s, 0}).x();
      if (answer < 40) continue;
      out.least_n = std::min(out.least_n, force_n);
      out.most_n = std::max(out.most_n, force_n);
      out.felt_n += force_n / 1000.0;
      const auto given = test.world->hand_impulses().entries();
      if (!given.empty()) out.given_n -= given[0].impulse_n_s.x() / kTickS / 1000.0;
    }
  }
  return out;
}

TEST_F(YieldingBodiesTest, AreFeltByTheirMeanWhereTheWorldIsAtRest) {
  const Wavering moving = wavering(*this, 0.0, 0.02);
  EXPECT_GT(moving.most_n - moving.least_n, 0.08);
  EXPECT_NEAR(moving.given_n, moving.felt_n, 1e-9);
  const Wavering resting = wavering(*this, 1.0, 0.0);
  EXPECT_LT(resting.most_n - resting.least_n, 0.02);
  EXPECT_GT(resting.most_n - resting.least_n, 0.0) << "the mean goes on following";
  EXPECT_NEAR(resting.felt_n, moving.felt_n, 0.01 * moving.felt_n);
  EXPECT_NEAR(resting.given_n, resting.felt_n, 0.01 * resting.felt_n) << "the third law, in the mean";
}

/// A tool at a wall, which fills x < 0, that a soft body pushes with `reaction_n`, in a world at rest.
ProxyContacts soft_at_wall(const Eigen::Vector3d& reaction_n, double depth_m, std::uint64_t sample_ns) {
  ProxyContacts out = soft(0.0, sample_ns);
  out.contacts = out.bodies = 1;
  out.contact_normal[0] = {1, 0, 0};
  out.contact_gap_m[0] = -depth_m;
  out.contact_friction[0] = 0.5;
  out.yield_tool_m[0] = {-depth_m, 0, 0};
  out.yield_reaction_n[0] = rtbus::array_of(reaction_n);
  out.yield_friction = 0.5;
  out.yield_rest = 1.0;
  return out;
}

// Between a wall and a soft body that wavers the tool stands, and so does the force of the hand's spring.
TEST_F(YieldingBodiesTest, AWallBearsWhatWavers) {
  constexpr double kHand_m = -0.002;
  reset({0.0, 0, 0});
  double least_n = 1e9, most_n = 0.0, aside_n = 0.0;
  for (int answer = 0; answer < 60; ++answer) {
    const double more_n = answer % 2 == 0 ? 0.05 : -0.05;
    world->take(soft_at_wall({-0.1 + more_n, 0.5 * more_n, 0}, 0.0, now_ns), now_ns);
    for (int i = 0; i < 50; ++i) {
      const Eigen::Vector3d force_n = tick({kHand_m, 0, 0});
      if (answer < 40) continue;
      least_n = std::min(least_n, force_n.x());
      most_n = std::max(most_n, force_n.x());
      aside_n = std::max(aside_n, std::abs(force_n.y()));
    }
  }
  EXPECT_NEAR(least_n, -kHand_m * kHandN_m, 1e-3);
  EXPECT_NEAR(most_n, -kHand_m * kHandN_m, 1e-3);
  EXPECT_LT(aside_n, 2e-3) << "friction of the wall";
}

// A soft body that wavers lifts the tool off a wall now and then. By its mean the tool would lie there.
TEST_F(YieldingBodiesTest, AWallCatchesWhatTheMeanLetsDown) {
  constexpr double kHand_m = -0.002, kAtWall_n = -kHand_m * kHandN_m;
  reset({0.0, 0, 0});
  double least_n = 1e9, highest_m = 0.0;
  for (int answer = 0; answer < 60; ++answer) {
    const double reaction_n = answer % 6 < 4 ? 0.1 * kAtWall_n : 1.8 * kAtWall_n;
    world->take(soft_at_wall({reaction_n, 0, 0}, 0.0, now_ns), now_ns);
    for (int i = 0; i < 50; ++i) {
      const double force_n = tick({kHand_m, 0, 0}).x();
      if (answer < 40) continue;
      least_n = std::min(least_n, force_n);
      highest_m = std::max(highest_m, world->position_m().x());
    }
  }
  EXPECT_GT(highest_m, 1e-5) << "it is lifted";
  EXPECT_NEAR(least_n, kAtWall_n, 0.02 * kAtWall_n);
}

// The hand pulls it out of a wall, and a soft body back in.
TEST_F(YieldingBodiesTest, DoNotPullTheToolIntoAWall) {
  constexpr double kDepth_m = 0.001;
  stiffness_n_per_m = 40.0;
  damping_n_s_per_m = 0.1;
  reset({-kDepth_m, 0, 0});
  double before_m = -kDepth_m, back_m = 0.0;
  for (int answer = 0; answer < 10; ++answer) {
    world->take(soft_at_wall({-0.4, 0, 0}, -before_m, now_ns), now_ns);
    for (int i = 0; i < 50; ++i) {
      (void)tick(0.003);
      back_m = std::max(back_m, before_m - world->position_m().x());
      before_m = world->position_m().x();
    }
  }
  EXPECT_LT(back_m, 1e-5) << "it comes out";
  EXPECT_NEAR(before_m, 0.0, 1e-5) << "and stays at the wall";
}

TEST_F(YieldingBodiesTest, AtRestGiveWayToTheHandAtOnceAndLetItGo) {
  ProxyContacts told = soft(-0.004, now_ns);
  told.yield_rest = 1.0;
  reset({-0.004, 0, 0});
  world->take(told, now_ns);
  double before_n = 0.0;
  for (int i = 0; i < 4000; ++i) before_n = tick(-0.006);
  const double due_n = 1e-4 / (1.0 / kHandN_m + 1.0 / kSoftN_m);
  EXPECT_NEAR(tick(-0.0061) - before_n, 2.0 * due_n, 0.1 * due_n) << "twice what is told of the stiffness at first";
  for (int i = 0; i < 4000; ++i) (void)tick(-0.0061);
  EXPECT_NEAR(tick(-0.0061) - before_n, due_n, 1e-4) << "and then the body's";
  (void)tick(0.005);
  EXPECT_NEAR(tick(0.005), 0.0, 1e-3) << "the mean fades, of next to nothing";
}

TEST_F(YieldingBodiesTest, AHandThatMovesEndsTheMeanBeforeAnAnswerCanSaySo) {
  ProxyContacts told = soft(-0.004, now_ns);
  told.yield_rest = 1.0;
  reset({-0.004, 0, 0});
  world->take(told, now_ns);
  const auto unlike_n = [&](double hand_m) {
    const double felt_n = tick(hand_m);
    return std::abs(felt_n + world->hand_impulses().entries()[0].impulse_n_s.x() / kTickS);
  };
  for (int i = 0; i < 4000; ++i) (void)tick(-0.006);
  EXPECT_GT(unlike_n(-0.0065), 0.05) << "the mean is felt";
  double left_n = 1.0;
  for (int i = 0; i < 200; ++i) left_n = unlike_n(-0.0075);
  EXPECT_LT(left_n, 1e-9);
}

// A tool that creeps aside on a soft body is felt by the mean as one that stands is, however far it comes.
TEST_F(YieldingBodiesTest, AHandThatCreepsRests) {
  const auto wavers_n = [this](double creeps_m_s) {
    constexpr double kDepth = -0.004;
    reset({kDepth, 0, 0});
    double least_n = 1e9, most_n = 0.0, aside_m = 0.0;
    for (int answer = 0; answer < 100; ++answer) {
      ProxyContacts told = soft(kDepth, now_ns);
      told.yield_reaction_n[0][0] += answer % 2 == 0 ? 0.1 : -0.1;
      told.yield_rest = 1.0;
      world->take(told, now_ns);
      for (int i = 0; i < 50; ++i) {
        aside_m += creeps_m_s * kTickS;
        const double force_n = tick({-0.006, aside_m, 0}, {0, creeps_m_s, 0}).x();
        if (answer < 40) continue;
        least_n = std::min(least_n, force_n);
        most_n = std::max(most_n, force_n);
      }
    }
    return most_n - least_n;
  };
  EXPECT_LT(wavers_n(0.5e-3), 0.02);
  EXPECT_GT(wavers_n(10e-3), 0.08);
}

TEST_F(YieldingBodiesTest, AnAnswerThatAgreesChangesNoForce) {
  reset({0.0, 0, 0});
  world->take(soft(0.0, now_ns), now_ns);
  double before_n = 0.0;
  for (int i = 0; i < 100; ++i) before_n = tick(-0.006);
  world->take(soft(world->position_m().x(), now_ns), now_ns);
  EXPECT_NEAR(tick(-0.006), before_n, 1e-3 * before_n);
  ASSERT_TRUE(world->correction_m().has_value());
  EXPECT_LT(*world->correction_m(), 1e-5);
}

TEST_F(YieldingBodiesTest, MakeNoEnergyPressedAndReleased) {
  reset({0.0, 0, 0});
  world->take(soft(0.0, now_ns), now_ns);
  // Half a tick before and half a tick after it: what the hold of a tick gives is the loop's, and the passivity
  // observer's.
  const auto way_m = [](int i) { return -0.004 * (1.0 - std::cos(2.0 * M_PI * i / 400.0)); };
  double put_in_j = 0.0, most_j = 0.0;
  for (int i = 0; i < 400; ++i) {
    const double moved_m = 0.5 * (way_m(i + 1) - way_m(i - 1));
    put_in_j -= tick(way_m(i), moved_m / kTickS) * moved_m;
    most_j = std::max(most_j, put_in_j);
  }
  EXPECT_GT(most_j, 1e-4);
  EXPECT_GE(put_in_j, -1e-9);
}

TEST_F(YieldingBodiesTest, AreGoneWhenAnAnswerSaysSo) {
  reset({0.0, 0, 0});
  world->take(soft(0.0, now_ns), now_ns);
  double force_n = 0.0;
  for (int i = 0; i < 100; ++i) force_n = tick(-0.006);
  ASSERT_GT(force_n, 0.1);
  ProxyContacts nothing;
  nothing.device_time_ns = now_ns;
  nothing.step_s = kPhysicsS;
  world->foresee({{-0.006, 0, 0}, Eigen::Vector3d::Zero(), kHandN_m, kHandNs_m}, now_ns + rtbus::kNsPerMs, kTickS);
  world->take(nothing, now_ns + rtbus::kNsPerMs);
  double before_n = force_n;
  for (int i = 0; i < 300; ++i) {
    force_n = tick(-0.006);
    EXPECT_LE(force_n, before_n + 1e-9);
    EXPECT_GT(force_n, before_n - 0.1);
    before_n = force_n;
  }
  EXPECT_EQ(force_n, 0.0);
}

}  // namespace
